//! Page of results.

use std::path::{Path, PathBuf};

use crate::error::{OrCannot as _, Result};

const PAGE_FILE: &str = "index.html";
const STYLE: &str = "body{font:15px/1.5 sans-serif;max-width:1200px;margin:2em auto;padding:0 1em;color:#1f2933}\
pre{overflow-x:auto}\
code{overflow-wrap:anywhere}figure{display:inline-block;width:min(100%,570px);margin:.5em .2em;vertical-align:top}img{width:100%}";

pub struct Page(String);

impl Page {
    /// Starts a page; `command` reproduces its results.
    pub fn new(title: &str, command: &str) -> Self {
        let command = escaped(command);
        Self(format!(
            "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"><title>{title}</title>\n<style>{STYLE}</style></head>\n<body>\n\
<h1>{title}</h1>\n<p><code>{command}</code></p>\n"
        ))
    }

    pub fn heading(&mut self, text: &str) {
        self.0 += &format!("<h2>{}</h2>\n", escaped(text));
    }

    pub fn text(&mut self, text: &str) {
        self.0 += &format!("<p>{}</p>\n", escaped(text));
    }

    pub fn table(&mut self, text: &str) {
        let lines: Vec<_> = text.lines().map(escaped).collect();
        self.0 += &format!("<pre>{}</pre>\n", lines.join("\n"));
    }

    /// Adds a picture and a link to its run's page, if they exist in the page's `directory`.
    pub fn figure(&mut self, caption: &str, directory: &Path, picture: &Path) {
        let shown = |file: &Path, show: fn(String) -> String| {
            let there = Some(file).filter(|file| directory.join(file).exists());
            there.map(|file| show(escaped(&file.to_string_lossy()))).unwrap_or_default()
        };
        let image =
            shown(picture, |file| format!("<img loading=\"lazy\" src=\"{file}\" alt=\"{file}\">"));
        let page = shown(&picture.with_extension("html"), |file| {
            format!("<a href=\"{file}\">its page</a>")
        });
        let caption = escaped(caption);
        self.0 += &format!("<figure><figcaption>{caption}</figcaption>{image}{page}</figure>\n");
    }

    pub fn save(self, directory: &Path) -> Result<PathBuf> {
        let file = directory.join(PAGE_FILE);
        std::fs::write(&file, self.0 + "</body></html>\n").or_cannot_file("write", &file)?;
        Ok(file)
    }
}

fn escaped(text: &str) -> String {
    picture::escape(text, usize::MAX)
}
