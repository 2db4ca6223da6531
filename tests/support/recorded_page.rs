//! The messages of a recorded page, read from its file.

use std::io::Read as _;

use serde_json::Value;

/// The text messages of the page `html`, and how many maps and fields it has.
pub fn messages(html: &str) -> (Vec<Value>, usize) {
    let data = html.split_once("<script id=\"data\" type=\"text/plain\">").unwrap().1;
    let packed = bytes(data.split_once('<').unwrap().0);
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

/// The bytes that `text` is in base64.
fn bytes(text: &str) -> Vec<u8> {
    let value = |letter: u8| match letter {
        b'A'..=b'Z' => letter - b'A',
        b'a'..=b'z' => letter - b'a' + 26,
        b'0'..=b'9' => letter - b'0' + 52,
        b'+' => 62,
        _ => 63,
    };
    let (mut bits, mut count, mut bytes) = (0_u32, 0, Vec::new());
    for letter in text.bytes().filter(|letter| *letter != b'=') {
        bits = bits << 6 | u32::from(value(letter));
        count += 6;
        if count >= 8 {
            count -= 8;
            bytes.push((bits >> count) as u8);
        }
    }
    bytes
}
