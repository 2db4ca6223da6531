//! Record files in the run directory, one JSON object a line. A failed write only logs a warning.

use std::{io, path::Path};

use common::file;

use serde::Serialize;

pub const DEATHS: &str = "deaths.jsonl";
pub const STALLS: &str = "stalls.jsonl";
pub const TARGETS: &str = "targets.jsonl";

pub fn append(directory: &Path, name: &str, record: &impl Serialize) {
    if let Err(error) = append_line(&directory.join(name), record) {
        tracing::warn!(name, %error, "cannot write a record");
    }
}

fn append_line(path: &Path, record: &impl Serialize) -> io::Result<()> {
    let mut line = serde_json::to_vec(record)?;
    line.push(b'\n');
    file::append_bytes(path, &line).map(drop)
}
