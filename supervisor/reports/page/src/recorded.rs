use std::io::Write as _;

use base64::prelude::{BASE64_STANDARD, Engine as _};
use flate2::{Compression, write::DeflateEncoder};
use serde_json::Value;

use crate::assets;

/// Policy that blocks all external references of the page.
const POLICY: &str = "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src 'unsafe-inline'; \
style-src 'unsafe-inline'; img-src data:\">";
/// Modules, each before its importers.
const MODULES: [&str; 9] =
    ["store", "field", "map", "charts", "timeline", "orders", "hand", "net", "page"];
const TITLE: &str = "<title>firsthand</title>";

/// Messages of a recorded run, in a server's order.
#[derive(Debug)]
pub struct Recorded {
    packed: DeflateEncoder<Vec<u8>>,
}

impl Default for Recorded {
    fn default() -> Self {
        Self { packed: DeflateEncoder::new(Vec::new(), Compression::best()) }
    }
}

impl Recorded {
    pub fn text(&mut self, message: &Value) {
        self.add(0, message.to_string().as_bytes());
    }

    pub fn blob(&mut self, message: &[u8]) {
        self.add(1, message);
    }

    /// A `kind` of 0 is text.
    fn add(&mut self, kind: u8, message: &[u8]) {
        let length = message.len() as u32;
        let _ = self.packed.write_all(&length.to_le_bytes());
        let _ = self.packed.write_all(&[kind]);
        let _ = self.packed.write_all(message);
    }

    pub fn html(self, title: &str) -> String {
        let data = BASE64_STANDARD.encode(self.packed.finish().unwrap_or_default());
        let title = title.replace('&', "&amp;").replace('<', "&lt;");
        let style = |file: &str| (link(file), format!("<style>{}</style>", asset(file)));
        let scripts = format!(
            "<script id=\"data\" type=\"text/plain\">{data}</script>\n<script type=\"module\">{}</script>",
            bundle()
        );
        let (license, plot) = (asset("uplot-license.txt"), asset("uplot.js"));
        let parts = [
            (TITLE.to_owned(), format!("{POLICY}\n<title>{title}</title>")),
            style("uplot.css"),
            style("page.css"),
            (
                script("", "uplot.js"),
                format!("<!-- uPlot:\n{license} -->\n<script>{plot}</script>"),
            ),
            (script("type=\"module\" ", "page.js"), scripts),
        ];
        let mut html = asset("").to_owned();
        for (reference, part) in parts {
            html = html.replacen(&reference, &part, 1);
        }
        html
    }
}

fn link(file: &str) -> String {
    format!("<link rel=\"stylesheet\" href=\"/{file}\">")
}

fn script(kind: &str, file: &str) -> String {
    format!("<script {kind}src=\"/{file}\"></script>")
}

fn asset(file: &str) -> &'static str {
    assets::ALL
        .iter()
        .find(|(path, ..)| path.strip_prefix('/') == Some(file))
        .map_or("", |(_, _, text)| text)
}

/// Bundles the modules in one script, each in its own scope.
fn bundle() -> String {
    let mut bundle = String::new();
    for module in MODULES {
        bundle += &format!("const {module}_js = (() => {{\n");
        let mut exports = Vec::new();
        for line in asset(&format!("{module}.js")).lines() {
            if let Some((names, from)) = import(line) {
                bundle += &format!("const {names} = {from}_js;\n");
                continue;
            }
            let exported = line.strip_prefix("export ");
            let words = exported.map(|line| line.split([' ', '(', '{']));
            exports.extend(words.and_then(|mut words| {
                words.find(|word| !["class", "function", "const"].contains(word))
            }));
            bundle += exported.unwrap_or(line);
            bundle.push('\n');
        }
        bundle += &format!("return {{ {} }};\n}})();\n", exports.join(", "));
    }
    bundle
}

fn import(line: &str) -> Option<(&str, &str)> {
    let (names, from) = line.strip_prefix("import ")?.split_once(" from \"./")?;
    Some((names, from.strip_suffix(".js\";")?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recorded_page_refers_to_nothing_and_no_text_of_it_is_markup() {
        let mut recorded = Recorded::default();
        recorded.text(&serde_json::json!({"about": null, "problem": "</script><script>alert(1)"}));
        recorded.blob(&[0; 40]);
        let html = recorded.html("<script>alert(\"&\")</script>");
        assert!(html.contains("<title>&lt;script>alert"));
        assert!(!html.contains("alert(1)"));
        for reference in ["src=\"/", "href=\"/", "import ", "export ", "://\""] {
            let mut found = html.match_indices(reference).map(|(at, _)| &html[at..at + 40]);
            assert_eq!(found.next(), None, "{reference}");
        }
        assert_eq!(html.matches("</script>").count(), 3);
    }

    #[test]
    fn every_module_is_in_the_recorded_page_after_those_that_it_imports() {
        for (at, module) in MODULES.iter().enumerate() {
            let text = asset(&format!("{module}.js"));
            for line in text.lines().filter(|line| line.starts_with("import ")) {
                let (_, from) = import(line).unwrap();
                assert!(MODULES[..at].contains(&from), "{module}: {line}");
            }
        }
    }
}
