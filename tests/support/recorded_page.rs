use std::io::Read as _;

use base64::prelude::{BASE64_STANDARD, Engine as _};
use serde_json::Value;

/// Returns the text messages of the page `html`, and the number of maps and fields.
pub fn messages(html: &str) -> (Vec<Value>, usize) {
    let data = html.split_once("<script id=\"data\" type=\"text/plain\">").unwrap().1;
    let packed = BASE64_STANDARD.decode(data.split_once('<').unwrap().0).unwrap();
    let mut unpacked = Vec::new();
    flate2::read::DeflateDecoder::new(&packed[..]).read_to_end(&mut unpacked).unwrap();
    let (mut texts, mut blobs, mut rest) = (Vec::new(), 0, &unpacked[..]);
    while let Some((head, more)) = rest.split_first_chunk::<5>() {
        let length = u32::from_le_bytes(*head.first_chunk().unwrap()) as usize;
        match head[4] {
            0 => texts.push(serde_json::from_slice(&more[..length]).unwrap()),
            _ => blobs += 1,
        }
        rest = &more[length..];
    }
    (texts, blobs)
}
