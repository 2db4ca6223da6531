//! Logs in CARMEN's format: one message a line, `ODOM` and `FLASER`.
//!
//! Messages count in the order of the file, because some logs hold times that go back. GMapping
//! writes corrected poses as laser poses, and continues the odometry from each of them with an
//! `ODOM` of time 0. Odometry is then what the messages between them say.

use common::kinematics::Pose2;
use glam::DVec2;

use crate::{Instant, Said, between, moved};

const MOST_BEAMS: usize = 16_384;
/// Least time between instants, seconds.
const LEAST_S: f64 = 1e-3;

#[derive(Default)]
pub(crate) struct Reading {
    pub(crate) instants: Vec<Instant>,
    /// Newest odometry pose of the file, and the one without corrections.
    pub(crate) last: Option<Pose2>,
    odometry: Pose2,
    pub(crate) is_corrected: bool,
}

impl Reading {
    /// Returns `None` for a line that is too long, or lacks numbers of its message.
    pub(crate) fn take(&mut self, line: &str) -> Option<()> {
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("ODOM") => {
                let [x, y, heading, _, _, _, time_s] = numbers(&mut words)?;
                if time_s == 0.0 && self.last.is_some() {
                    self.last = Some(pose([x, y, heading]));
                    self.is_corrected = true;
                } else {
                    self.odometry(pose([x, y, heading]), time_s);
                }
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
                self.scan(beams, pose([x, y, heading]))?;
            }
            _ => {}
        }
        Some(())
    }

    pub(crate) fn odometry(&mut self, pose: Pose2, time_s: f64) {
        if let Some(before) = self.last.replace(pose) {
            self.odometry = moved(self.odometry, between(before, pose));
        }
        let latest = self.instants.last().map_or(f64::MIN, |it| it.time_s + LEAST_S);
        let time_s = time_s.max(latest);
        self.instants.push(Instant {
            time_s,
            odometry: self.odometry,
            laser: Pose2::default(),
            has_scan: false,
            said: Said::Line(None),
        });
    }

    /// Takes a scan of the newest odometry's time. Returns `None` without odometry.
    pub(crate) fn scan(&mut self, ranges: Vec<f32>, laser: Pose2) -> Option<()> {
        let instant = self.instants.last_mut()?;
        let scanned = Instant { laser, has_scan: true, said: Said::Line(Some(ranges)), ..*instant };
        if instant.has_scan {
            let time_s = instant.time_s + LEAST_S;
            self.instants.push(Instant { time_s, ..scanned });
        } else {
            *instant = scanned;
        }
        Some(())
    }
}

fn numbers<'a, const N: usize>(words: &mut impl Iterator<Item = &'a str>) -> Option<[f64; N]> {
    let mut numbers = [0.0; N];
    for number in &mut numbers {
        *number = words.next()?.parse().ok().filter(|it: &f64| it.abs() <= 1e12)?;
    }
    Some(numbers)
}

pub(crate) fn pose([x, y, heading]: [f64; 3]) -> Pose2 {
    Pose2 { position: DVec2::new(x, y), heading }
}
