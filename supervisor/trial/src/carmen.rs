//! Logs in CARMEN's format: one message a line, `ODOM` and `FLASER`.
//!
//! Messages count in the order of the file, because some logs hold times that go back. GMapping
//! writes corrected poses as laser poses, and continues the odometry from each of them with an
//! `ODOM` of time 0. Odometry is then what the messages between them say.

use std::{fs::File, io::BufRead as _, io::BufReader, io::Read as _, path::Path};

use common::kinematics::Pose2;
use glam::DVec2;

use crate::{Instant, Log, LogError, between, moved};

/// Longest line: 16,384 beams of 12 characters, and as much again.
const LONGEST_LINE: u64 = 400_000;
const MOST_BEAMS: usize = 16_384;
/// Most instants: a day at 50 Hz.
const MOST_INSTANTS: usize = 4_320_000;
/// Least time between instants, seconds.
const LEAST_S: f64 = 1e-3;

#[derive(Default)]
struct Reading {
    instants: Vec<Instant>,
    /// Newest odometry pose of the file, and the one without corrections.
    last: Option<Pose2>,
    odometry: Pose2,
    is_corrected: bool,
}

/// Reads a log.
///
/// # Errors
/// Returns an error if the file cannot be read, or if a line is no message of CARMEN.
pub(crate) fn read(file: &Path) -> Result<Log, LogError> {
    let unreadable = |cause| LogError::Unreadable { file: file.to_owned(), cause };
    let mut lines = BufReader::new(File::open(file).map_err(unreadable)?);
    let (mut reading, mut line) = (Reading::default(), Vec::new());
    for number in 1.. {
        line.clear();
        let read = lines.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut line);
        if read.map_err(unreadable)? == 0 {
            break;
        }
        let taken = reading.take(&String::from_utf8_lossy(&line));
        if taken.is_none() || reading.instants.len() > MOST_INSTANTS {
            return Err(LogError::Line { file: file.to_owned(), number });
        }
    }
    let Reading { instants, is_corrected, .. } = reading;
    Ok(Log { instants, is_corrected })
}

impl Reading {
    /// Returns `None` for a line that is too long, or lacks numbers of its message.
    fn take(&mut self, line: &str) -> Option<()> {
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("ODOM") => {
                let [x, y, heading, _, _, _, time_s] = numbers(&mut words)?;
                self.odometry(pose([x, y, heading]), time_s);
            }
            Some("FLASER") => {
                let beams = words.next()?.parse().ok().filter(|it| *it <= MOST_BEAMS)?;
                let beams = words
                    .by_ref()
                    .take(beams)
                    .map(|word| word.parse().ok())
                    .collect::<Option<Vec<f32>>>()?;
                let [x, y, heading, robot_x, robot_y, robot_heading, time_s] = numbers(&mut words)?;
                if self.last.is_none() {
                    self.odometry(pose([robot_x, robot_y, robot_heading]), time_s);
                }
                let instant = self.instants.last_mut()?;
                if instant.scan.is_some() {
                    let again = Instant { time_s: instant.time_s + LEAST_S, ..instant.clone() };
                    self.instants.push(again);
                }
                let instant = self.instants.last_mut()?;
                instant.scan = Some(beams);
                instant.laser = pose([x, y, heading]);
            }
            _ => {}
        }
        Some(())
    }

    fn odometry(&mut self, pose: Pose2, time_s: f64) {
        let before = self.last.replace(pose);
        if time_s == 0.0 && before.is_some() {
            self.is_corrected = true;
            return;
        }
        if let Some(before) = before {
            self.odometry = moved(self.odometry, between(before, pose));
        }
        let latest = self.instants.last().map_or(f64::MIN, |it| it.time_s + LEAST_S);
        let time_s = time_s.max(latest);
        self.instants.push(Instant { time_s, odometry: self.odometry, ..Instant::default() });
    }
}

fn numbers<'a, const N: usize>(words: &mut impl Iterator<Item = &'a str>) -> Option<[f64; N]> {
    let mut numbers = [0.0; N];
    for number in &mut numbers {
        *number = words.next()?.parse().ok().filter(|it: &f64| it.abs() <= 1e12)?;
    }
    Some(numbers)
}

fn pose([x, y, heading]: [f64; 3]) -> Pose2 {
    Pose2 { position: DVec2::new(x, y), heading }
}
