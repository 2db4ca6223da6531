//! Files of records: a JSON object a line.

use std::{
    fs::File,
    io::{self, Write as _},
    path::Path,
};

use serde::Serialize;

/// Append `record` to a file of JSON objects, one a line.
pub(crate) fn append_line(file: &Path, record: &impl Serialize) -> io::Result<()> {
    let mut line = serde_json::to_vec(record)?;
    line.push(b'\n');
    let mut file = File::options().create(true).append(true).open(file)?;
    file.write_all(&line)
}
