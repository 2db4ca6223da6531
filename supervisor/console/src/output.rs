//! Standard output and standard error of a subcommand.

use std::{
    fmt::Display,
    io::{self, Write as _},
};

use serde::Serialize;

use super::failure::Result;

/// Writes and flushes. Accepts a closed reader (`firsthand help tables | head`).
pub fn print_text(text: impl Display) -> Result {
    let mut stdout = io::stdout();
    let written = stdout.write_all(text.to_string().as_bytes()).and_then(|()| stdout.flush());
    Ok(unless_closed(written)?)
}

pub fn print_line(line: impl Display) -> Result {
    print_text(format_args!("{line}\n"))
}

pub fn print(value: &(impl Display + Serialize), json: bool) -> Result {
    print_rows(std::slice::from_ref(value), json, value)
}

pub fn print_rows(values: &[impl Serialize], json: bool, text: impl Display) -> Result {
    if json { print_text(json_lines(values)?) } else { print_text(text) }
}

pub fn json_lines(values: &[impl Serialize]) -> serde_json::Result<String> {
    values.iter().map(serde_json::to_string).map(|line| Ok(line? + "\n")).collect()
}

/// Says `text` on standard error, after the name of the program.
pub fn say(text: impl Display) {
    write_stderr(&format!("firsthand: {text}\n"));
}

/// Ignores errors, such as a closed reader.
pub fn write_stderr(text: &str) {
    let mut stderr = io::stderr();
    let _ = stderr.write_all(text.as_bytes()).and_then(|()| stderr.flush());
}

/// Accepts a pipe without reader, or a closed terminal.
pub(crate) fn unless_closed(written: io::Result<()>) -> io::Result<()> {
    match written {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        Err(error) if error.raw_os_error() == Some(CLOSED_TERMINAL) => Ok(()),
        written => written,
    }
}

const CLOSED_TERMINAL: i32 = rustix::io::Errno::IO.raw_os_error();

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reader_that_went_away_is_no_failure() {
        assert!(unless_closed(Err(io::ErrorKind::BrokenPipe.into())).is_ok());
        assert!(unless_closed(Err(io::Error::from_raw_os_error(CLOSED_TERMINAL))).is_ok());
        assert!(unless_closed(Err(io::ErrorKind::StorageFull.into())).is_err());
    }
}
