//! The common parts of result pages.

use std::path::Path;

/// The page up to its first heading, with `title`.
pub fn head(title: &str) -> String {
    let title = escaped(title);
    format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"><title>{title}</title>\n<style>{STYLE}</style></head>\n<body>\n"
    )
}

pub const END: &str = "</body></html>\n";

const STYLE: &str = "body{font:15px/1.5 sans-serif;max-width:1200px;margin:2em auto;padding:0 1em;color:#1f2933}\
table{border-collapse:collapse;display:block;overflow-x:auto}td,th{border:1px solid #cbd2d9;padding:.3em .6em;text-align:left;vertical-align:top}\
code{overflow-wrap:anywhere}figure{display:inline-block;width:min(100%,570px);margin:.5em .2em;vertical-align:top}img{width:100%}";

/// A picture, if there is one, and a link to the page of its run. Both files are beside the page.
pub fn figure(caption: &str, picture: Option<&Path>, page: Option<&Path>) -> String {
    let escaped_path = |path: &Path| escaped(&path.to_string_lossy());
    let picture = picture.map(escaped_path).map_or(String::new(), |file| {
        format!("<img loading=\"lazy\" src=\"{file}\" alt=\"{file}\">")
    });
    let page = page.map(escaped_path);
    let page = page.map_or(String::new(), |file| format!("<a href=\"{file}\">its page</a>"));
    let caption = escaped(caption);
    format!("<figure><figcaption>{caption}</figcaption>{picture}{page}</figure>\n")
}

/// `text` escaped for HTML, with spaces in place of control characters.
pub fn escaped(text: &str) -> String {
    text.replace(char::is_control, " ")
        .replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}
