//! Protocol of robots that exchange JSON lines, over datagrams, a connection or a serial line.
//!
//! A message is one JSON object in a line of at most [`LONGEST_LINE`] bytes. A datagram may carry
//! several lines. Angles are in radians, distances in metres, times in seconds; left is positive.
//! The robot sends [`Report`]s and receives [`Order`]s.

use std::collections::BTreeMap;

use serde::{Deserialize, Deserializer, Serialize, de::IgnoredAny};

/// Most bytes of a line. A scan of 16,384 beams takes 100 kB in millimetres, 360 kB with all
/// digits.
pub const LONGEST_LINE: usize = 524_288;

/// Report of the robot; each field is optional.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Report {
    /// Number of orders received since the start. The robot answers each order at once with a
    /// report that counts it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heard: Option<u64>,
    /// Wheel angles since the start. They begin a tick.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wheels: Option<[f64; 2]>,
    /// Rad/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speeds: Option<[f64; 2]>,
    /// Robot's clock, with its own zero, at the reading of `wheels` or `odometry`. It dates
    /// measurements in delayed lines and is the reference of `scan_age_s`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clock_s: Option<f64>,
    /// Robot's own odometry in place of `wheels`: x, y and heading.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub odometry: Option<[f64; 3]>,
    /// Gyro angle since the start, counter-clockwise and unwrapped, read with `wheels` or
    /// `odometry`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gyro: Option<f64>,
    /// Whether each wheel is blocked: its motor draws its stall current.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held: Option<[bool; 2]>,
    /// Null for nothing in reach.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub ranges: BTreeMap<String, Option<f64>>,
    /// Beams counter-clockwise; null for nothing in reach, negative for no reading.
    #[serde(skip_serializing_if = "Option::is_none", deserialize_with = "scan")]
    pub scan: Option<Vec<Option<f32>>>,
    /// Age of the scan's first beam when this line is sent, at most 2 s; by default that of the
    /// wheels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scan_age_s: Option<f64>,
    /// Duration of the scan, from its first beam to its last.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scan_time_s: Option<f64>,
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub scans: BTreeMap<String, Scan>,
    /// Bumper and cliff sensor states by the row names of the mission. An omitted one keeps its
    /// state.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub touched: BTreeMap<String, bool>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub battery_v: Option<f64>,
}

/// Narrows beams to single precision, in which one that is too long is infinite. Read as such, it
/// would be an error of its line.
fn narrowed(beams: Vec<Option<f64>>) -> Vec<Option<f32>> {
    beams.into_iter().map(|beam| beam.map(|beam| beam as f32)).collect()
}

fn beams<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<Option<f32>>, D::Error> {
    Vec::deserialize(from).map(narrowed)
}

fn scan<'de, D: Deserializer<'de>>(from: D) -> Result<Option<Vec<Option<f32>>>, D::Error> {
    Ok(Option::deserialize(from)?.map(narrowed))
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Scan {
    #[serde(deserialize_with = "beams")]
    pub ranges: Vec<Option<f32>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub age_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_s: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "lowercase")]
pub enum Order {
    /// Greets a new robot, or one that has braked: it releases its brake and reports at this rate.
    Hello {
        rate_hz: f64,
    },
    /// Drives for `for_s`, then stops, unless another order arrives.
    Drive {
        /// Left and right, rad/s.
        wheels: [f64; 2],
        /// Resulting forward speed, m/s, and turn rate, rad/s.
        twist: [f64; 2],
        for_s: f64,
    },
    /// Stops by every means until the next hello.
    Brake {},
    Ping {},
}

pub fn line(message: &impl Serialize) -> Vec<u8> {
    // A struct of numbers and names always serialises.
    let mut line = serde_json::to_vec(message).unwrap_or_default();
    debug_assert!(!line.contains(&b'\n'));
    line.push(b'\n');
    line
}

pub fn parse<'a, M: Deserialize<'a>>(line: &'a [u8]) -> Result<M, String> {
    serde_json::from_slice(line).map_err(|error| error.to_string())
}

/// Line splitter. It drops empty and overlong lines.
#[derive(Clone, Debug, Default)]
pub struct Lines {
    held: Vec<u8>,
    drops: bool,
    dropped: u64,
}

impl Lines {
    /// Returns the lines that `bytes` complete, without line feeds. A final object needs none,
    /// because a robot may omit it in datagrams.
    pub fn push(&mut self, bytes: &[u8]) -> Vec<Vec<u8>> {
        let mut complete = Vec::new();
        let mut pieces = bytes.split(|byte| *byte == b'\n').peekable();
        while let Some(piece) = pieces.next() {
            let ends = pieces.peek().is_some();
            if self.drops || self.held.len() + piece.len() >= LONGEST_LINE {
                self.dropped += (self.held.len() + piece.len()) as u64;
                self.held.clear();
                self.drops = !ends;
                continue;
            }
            self.held.extend_from_slice(piece);
            if ends {
                let line = std::mem::take(&mut self.held);
                complete.extend(Some(line).filter(|line| !line.trim_ascii().is_empty()));
            }
        }
        assert!(self.held.len() < LONGEST_LINE && (self.held.is_empty() || !self.drops));
        if self.held.trim_ascii_end().ends_with(b"}") {
            let is_object = |line| serde_json::from_slice::<IgnoredAny>(line).map(drop);
            let last = bytes.rsplit(|byte| *byte == b'\n').next().unwrap_or_default();
            match is_object(&self.held) {
                Ok(()) => complete.push(std::mem::take(&mut self.held)),
                // The earlier bytes begin no object that `last` could continue.
                Err(error) if !error.is_eof() && is_object(last).is_ok() => {
                    self.held.truncate(self.held.len() - last.len());
                    self.reset();
                    complete.push(last.to_vec());
                }
                Err(_) => {}
            }
        }
        complete
    }

    pub fn reset(&mut self) {
        self.dropped += self.held.len() as u64;
        self.held.clear();
        self.drops = false;
    }

    pub const fn dropped(&self) -> u64 {
        self.dropped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_order_is_a_line_that_says_itself() {
        let drive = Order::Drive { wheels: [1.0, 2.0], twist: [0.1, 0.2], for_s: 0.25 };
        let said = r#"{"drive":{"wheels":[1.0,2.0],"twist":[0.1,0.2],"for_s":0.25}}"#;
        assert_eq!(line(&drive), format!("{said}\n").as_bytes());
        assert_eq!(line(&Order::Brake {}), b"{\"brake\":{}}\n");
        assert_eq!(parse::<Order>(said.as_bytes()), Ok(drive));
    }

    #[test]
    fn a_report_may_say_any_part_and_no_word_that_is_not_in_the_protocol() {
        let report: Report =
            parse(br#"{"wheels":[1,-2],"ranges":{"front":1.5,"left":null}}"#).unwrap();
        assert_eq!(report.wheels, Some([1.0, -2.0]));
        assert_eq!(report.ranges["left"], None);
        for foreign in ["{\"wheel\":[1,2]}", "{\"wheels\":[1]}", "{\"wheels\":[1e999,0]}", "7"] {
            parse::<Report>(foreign.as_bytes()).unwrap_err();
        }
    }

    #[test]
    fn a_whole_object_is_a_line_without_its_newline_and_a_part_of_one_is_not() {
        let mut lines = Lines::default();
        let whole = br#"{"ranges":{"front":1.2},"heard":1}"#;
        assert_eq!(lines.push(whole), [whole]);
        // Its newline comes late.
        assert!(lines.push(b"\n").is_empty());
        let (first, rest) = whole.split_at(23);
        assert!(first.ends_with(b"}"));
        // A long line is divided over datagrams.
        assert!(lines.push(first).is_empty());
        assert_eq!(lines.push(rest), [whole]);
    }

    #[test]
    fn a_damaged_datagram_without_a_newline_makes_a_robot_deaf_for_one_more_at_most() {
        let whole = br#"{"ranges":{"front":1.2},"heard":1}"#;
        for (damaged, heard) in [("noise", 3), ("noise}", 3), (r#"{"wheels":[1,"#, 2)] {
            let mut lines = Lines::default();
            assert!(lines.push(damaged.as_bytes()).is_empty(), "{damaged}");
            let came: Vec<_> = (0..3).flat_map(|_| lines.push(whole)).collect();
            assert_eq!(came, vec![whole.to_vec(); heard], "{damaged}");
            assert_eq!(lines.dropped() as usize, damaged.len() + (3 - heard) * whole.len());
        }
    }

    #[test]
    fn lines_come_out_of_any_pieces_and_one_that_is_too_long_is_dropped() {
        let mut lines = Lines::default();
        assert!(lines.push(b"ab").is_empty());
        assert_eq!(lines.push(b"c\n\nd\ne"), [b"abc".to_vec(), b"d".to_vec()]);
        lines.reset();
        assert_eq!(lines.dropped(), 1);
        for _ in 0..53 {
            assert!(lines.push(&[b'x'; 10_000]).is_empty());
        }
        assert_eq!(lines.push(b"y\nz\n"), [b"z".to_vec()]);
        assert_eq!(lines.dropped(), 1 + 530_001);
    }
}
