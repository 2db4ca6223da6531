//! A long text on a terminal: through the pager, as `man` does.

use std::{
    env,
    io::{self, IsTerminal as _, Write as _},
    process::{Command, Stdio},
};

use console::output::print_text;

/// The greatest width of text, because longer lines are hard to read.
const WIDEST: usize = 100;
/// The width where the terminal tells none.
const DEFAULT: usize = 80;

/// The width of text on standard output; none if that is no terminal: another program gets the Markdown as it is.
pub(super) fn width() -> Option<usize> {
    let stdout = io::stdout();
    stdout.is_terminal().then(|| {
        let size = rustix::termios::tcgetwinsize(&stdout);
        match size.map_or(0, |size| usize::from(size.ws_col)) {
            0 => DEFAULT,
            columns => columns.min(WIDEST),
        }
    })
}

/// Show `text` in the pager that PAGER names, or in `less`; if there is none, print it.
pub(super) fn show(text: &str) -> io::Result<()> {
    let pager = env::var_os("PAGER").unwrap_or_else(|| "less".into());
    // PAGER may have arguments, so a shell reads it. As for git, `less` shows styles and ends at once if the text fits.
    let mut pager = Command::new("sh")
        .arg("-c")
        .arg(pager)
        .env("LESS", "FRX")
        .stdin(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()?;
    if let Some(mut input) = pager.stdin.take() {
        // The reader may quit before the end.
        let _ = input.write_all(text.as_bytes());
    }
    match pager.wait()?.code() {
        Some(NOT_FOUND) => print_text(text),
        _ => Ok(()),
    }
}

/// The exit code of a shell that does not find the command.
const NOT_FOUND: i32 = 127;
