//! Answers of the board, recognized by form alone.

use common::mission::LEAST_BAUD;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Answer {
    Done,
    /// `Invalid Command`: the request was missing or garbled.
    Invalid,
    /// Left and right, and a third number of a board with a gyro: its angle in 1e-4 rad,
    /// counter-clockwise. No other answer has several numbers.
    Counts([i32; 2], Option<i32>),
    /// Number greater than any range.
    Baud,
    /// Smaller number: a range, if requested.
    Centimetres(u16),
}

impl Answer {
    /// Parses a line without line feed; the error says why it is no answer.
    pub(crate) fn parse(line: &[u8]) -> Result<Self, String> {
        let none = || format!("{:?} is an unknown answer", String::from_utf8_lossy(line));
        Self::recognized(line).ok_or_else(none)
    }

    fn recognized(line: &[u8]) -> Option<Self> {
        let line = line.strip_suffix(b"\r").unwrap_or(line);
        // A carriage return within marks a lost line feed, after the end of another answer.
        let text = std::str::from_utf8(line).ok()?.trim_matches(' ');
        match text {
            "OK" => return Some(Self::Done),
            "Invalid Command" => return Some(Self::Invalid),
            _ => {}
        }
        let numbers: Result<Vec<i32>, _> = text.split(' ').map(str::parse).collect();
        Some(match numbers.ok()?[..] {
            [left, right] => Self::Counts([left, right], None),
            [left, right, gyro] => Self::Counts([left, right], Some(gyro)),
            [rate] if i64::from(rate) >= LEAST_BAUD.into() => Self::Baud,
            [range] => Self::Centimetres(u16::try_from(range).ok()?),
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_lost_or_gained_bytes_is_refused() {
        // Ranges that lost their line feed keep the carriage return, so they are no counts.
        for line in [
            "12\r34\r",
            "12 34 56 78\r",
            "2147483648 0",
            "-1",
            "1.5",
            "O",
            "1  2",
            "12OK",
            "",
            "\r\r",
        ] {
            assert!(
                Answer::parse(line.as_bytes()).unwrap_err().contains("unknown answer"),
                "{line:?}"
            );
        }
        assert!(Answer::parse(b"\xff\xfe 1").is_err());
    }
}
