//! Progress on standard error: one rewritten line on a terminal, periodic lines elsewhere.

use std::{
    io::{self, IsTerminal as _},
    time::{Duration, Instant},
};

use super::output::write_stderr;

/// Interval of lines without a terminal.
pub const LINE_EVERY: Duration = Duration::from_secs(5);

pub struct ProgressLine {
    rewrites: bool,
    every: Duration,
    shown: Option<Instant>,
}

impl ProgressLine {
    /// Shows one line per `every` if standard error is not a terminal.
    pub fn new(every: Duration) -> Self {
        Self { rewrites: io::stderr().is_terminal(), every, shown: None }
    }

    /// Shows a due line, and `title` before the first. Without a terminal, only if it `may_stay`.
    pub fn update(&mut self, title: &str, line: impl FnOnce() -> String, may_stay: bool) {
        let waits = |shown: Instant| !self.rewrites && shown.elapsed() < self.every;
        if self.shown.is_some_and(waits) {
            return;
        }
        if self.shown.replace(Instant::now()).is_none() {
            write_stderr(&format!("{title}\n"));
        }
        let line = line();
        if self.rewrites {
            write_stderr(&format!("\r\x1b[K{}", cut(&line, columns())));
        } else if may_stay {
            write_stderr(&format!("{line}\n"));
        }
    }

    pub fn end(&self) {
        if self.rewrites {
            write_stderr("\n");
        }
    }
}

/// Returns 0 if the width is unknown.
fn columns() -> usize {
    rustix::termios::tcgetwinsize(io::stderr()).map_or(0, |size| size.ws_col.into())
}

/// Cuts a line before the last column, because a wrapped line cannot be rewritten; 0: no limit.
fn cut(line: &str, columns: usize) -> &str {
    let shown = columns.checked_sub(1).unwrap_or(usize::MAX);
    line.char_indices().nth(shown).map_or(line, |(end, _)| &line[..end])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_cut_to_less_than_the_terminal_is_wide() {
        assert_eq!(cut("12.3 s  0.50 m", 8), "12.3 s ");
        assert_eq!(cut("12.3 s", 8), "12.3 s");
        assert_eq!(cut("µµµµ", 3), "µµ");
        assert_eq!(cut("12.3 s", 0), "12.3 s");
    }
}
