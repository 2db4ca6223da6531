use std::path::Path;

use console::output::write_stderr;

use super::results::Results;
use crate::error::{OrCannot as _, Result};

const PAGE_FILE: &str = "index.html";
const STYLE: &str = "body{font:15px/1.5 sans-serif;max-width:1200px;margin:2em auto;padding:0 1em;color:#1f2933}\
pre{overflow-x:auto}\
code{overflow-wrap:anywhere}figure{display:inline-block;width:min(100%,570px);margin:.5em .2em;vertical-align:top}img{width:100%}";

pub struct Page<'a> {
    text: String,
    results: &'a Results,
}

impl<'a> Page<'a> {
    pub fn new(title: &str, results: &'a Results) -> Self {
        let command = escaped(&results.command);
        let text = format!(
            "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"><title>{title}</title>\n<style>{STYLE}</style></head>\n<body>\n\
<h1>{title}</h1>\n<p><code>{command}</code></p>\n"
        );
        Self { text, results }
    }

    pub fn element(&mut self, tag: &str, text: &str) {
        let lines: Vec<_> = text.lines().map(escaped).collect();
        self.text += &format!("<{tag}>{}</{tag}>\n", lines.join("\n"));
    }

    /// Adds a picture and a link to its run's page, if they exist beside the page.
    pub fn figure(&mut self, caption: &str, picture: &Path) {
        let shown = |file: &Path, show: fn(String) -> String| {
            let there = Some(file).filter(|file| self.results.directory.join(file).exists());
            there.map(|file| show(escaped(&file.to_string_lossy()))).unwrap_or_default()
        };
        let image =
            shown(picture, |file| format!("<img loading=\"lazy\" src=\"{file}\" alt=\"{file}\">"));
        let page = shown(&picture.with_extension("html"), |file| {
            format!("<a href=\"{file}\">its page</a>")
        });
        let caption = escaped(caption);
        self.text += &format!("<figure><figcaption>{caption}</figcaption>{image}{page}</figure>\n");
    }

    /// Writes the page beside its pictures, and prints its place.
    pub fn save(self) -> Result {
        let file = self.results.directory.join(PAGE_FILE);
        std::fs::write(&file, self.text + "</body></html>\n").or_cannot_file("write", &file)?;
        write_stderr(&format!("rows and pictures: {}\n", file.display()));
        Ok(())
    }
}

fn escaped(text: &str) -> String {
    picture::escape(text, usize::MAX)
}
