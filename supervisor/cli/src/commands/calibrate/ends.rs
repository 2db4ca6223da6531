//! Ends of squares, typed by a person or read from a file on standard input.

use std::{
    io::{self, BufRead as _, IsTerminal as _, Read as _},
    os::fd::AsFd as _,
};

use common::{poll, signals::Signals};
use glam::DVec2;

use console::{failure::Result, output::write_stderr};

const LONGEST_LINE: u64 = 200;
const FARTHEST_M: f64 = 10.0;

/// Waits until a person has put the robot on its mark, unless standard input is a file.
pub fn await_robot(title: &str, signals: &mut Signals) -> Result {
    if io::stdin().is_terminal() {
        write_stderr(&format!("{title}: put the robot on its mark, then press Enter\n"));
        line(signals)?;
    }
    Ok(())
}

pub fn next(title: &str, signals: &mut Signals) -> Result<DVec2> {
    loop {
        write_stderr(&format!(
            "{title}: where is the robot? metres ahead and to the left of the mark: "
        ));
        if let Some(end) = end(&line(signals)?) {
            return Ok(end);
        }
        write_stderr("give two numbers, such as 0.03 -0.12\n");
    }
}

fn line(signals: &mut Signals) -> Result<String> {
    let mut line = String::new();
    poll::readable(&[io::stdin().as_fd(), signals.as_fd()], None)?;
    if signals.came() {
        return Err("stopped; nothing was written".into());
    }
    if io::stdin().lock().take(LONGEST_LINE).read_line(&mut line)? == 0 {
        return Err("the ends of the squares are missing; nothing was written".into());
    }
    Ok(line.trim().to_owned())
}

/// In metres.
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
