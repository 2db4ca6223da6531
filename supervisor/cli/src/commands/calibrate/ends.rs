//! The ends of squares, typed by a person or read from a file.

use std::{
    fs::File,
    io::{self, BufRead, BufReader, Read as _},
    path::Path,
    time::Duration,
};

use common::{poll, signals::Signals};
use glam::DVec2;

use console::{failure::Failure, output::write_stderr};

const LONGEST_LINE: u64 = 200;
const FARTHEST_M: f64 = 10.0;
/// The time between looks for a signal while somebody measures.
const LOOK_EVERY: Duration = Duration::from_millis(200);

pub(super) enum Ends {
    Typed,
    File(BufReader<File>),
}

impl Ends {
    pub(super) fn open(file: Option<&Path>) -> Result<Self, Failure> {
        let Some(file) = file else {
            return Ok(Self::Typed);
        };
        let opened = File::open(file)
            .map_err(|error| format!("cannot read the ends in {}: {error}", file.display()))?;
        Ok(Self::File(BufReader::new(opened)))
    }

    pub(super) fn await_robot(
        &mut self,
        title: &str,
        signals: &mut Signals,
    ) -> Result<(), Failure> {
        if matches!(self, Self::Typed) {
            write_stderr(&format!("{title}: put the robot on its mark, then press Enter\n"));
            self.line(signals)?;
        }
        Ok(())
    }

    /// A line that is no end is asked for again.
    pub(super) fn next(&mut self, title: &str, signals: &mut Signals) -> Result<DVec2, Failure> {
        loop {
            if matches!(self, Self::Typed) {
                write_stderr(&format!(
                    "{title}: where is it? metres ahead and to the left of the mark: "
                ));
            }
            let line = self.line(signals)?;
            match end(&line) {
                Some(end) => return Ok(end),
                None if matches!(self, Self::Typed) => {
                    write_stderr("type two numbers, such as 0.03 -0.12\n");
                }
                None => {
                    return Err(format!(
                        "{title}: {line:?} is no end; give two numbers, such as 0.03 -0.12"
                    )
                    .into());
                }
            }
        }
    }

    fn line(&mut self, signals: &mut Signals) -> Result<String, Failure> {
        let mut line = String::new();
        let read = match self {
            Self::File(file) => file.take(LONGEST_LINE).read_line(&mut line)?,
            Self::Typed => {
                while !poll::is_readable(io::stdin(), LOOK_EVERY)? {
                    if signals.came() {
                        return Err("stopped; nothing was written".into());
                    }
                }
                io::stdin().lock().take(LONGEST_LINE).read_line(&mut line)?
            }
        };
        if read == 0 {
            return Err("the ends of the squares are missing; nothing was written".into());
        }
        Ok(line.trim().to_owned())
    }
}

/// Two numbers, metres.
fn end(line: &str) -> Option<DVec2> {
    let separated = line.replace(',', " ");
    let mut words = separated.split_whitespace().map(str::parse::<f64>);
    let (Some(Ok(x)), Some(Ok(y)), None) = (words.next(), words.next(), words.next()) else {
        return None;
    };
    let end = DVec2::new(x, y);
    (end.is_finite() && end.length() <= FARTHEST_M).then_some(end)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_end_is_two_numbers_with_or_without_a_comma_and_nothing_else() {
        assert_eq!(end("0.03 -0.12"), Some(DVec2::new(0.03, -0.12)));
        assert_eq!(end("0.03, -0.12"), Some(DVec2::new(0.03, -0.12)));
        for wrong in ["", "1", "1 2 3", "a b", "nan 0", "0 inf", "100 0"] {
            assert_eq!(end(wrong), None, "{wrong}");
        }
    }
}
