//! Logs of real robots, as runs that somebody else drives.
//!
//! A log becomes the lines of a JSON robot. The link, dead reckoning and the mapper take them as on
//! a robot, in one thread. The commands are the speeds that the log goes on with, so that a healthy
//! robot obeys. Poses that the log itself corrected are the reference.

mod carmen;
mod drive;
mod judge;

use std::{
    io,
    path::{Path, PathBuf},
};

use common::{geometry::wrap_angle, kinematics::Pose2};
use glam::DVec2;
use thiserror::Error;

pub use drive::{Drive, drive, mission};
pub use judge::{Judged, judge};

/// Log that cannot be tried.
#[derive(Debug, Error)]
pub enum LogError {
    #[error("{}: {cause}; give a log that can be read", file.display())]
    Unreadable { file: PathBuf, cause: io::Error },
    #[error("{}: line {number} is no message of CARMEN; give a log with ODOM and FLASER lines", file.display())]
    Line { file: PathBuf, number: u64 },
    #[error("{}: no laser scans with odometry; give a CARMEN log with ODOM and FLASER lines", file.display())]
    Empty { file: PathBuf },
}

/// Odometry, and perhaps a scan, of one time.
#[derive(Clone, Debug, Default)]
pub struct Instant {
    pub time_s: f64,
    /// Pose by the wheels since the start of the log.
    pub odometry: Pose2,
    /// Ranges counter-clockwise, metres.
    pub scan: Option<Vec<f32>>,
    /// Pose of the scan's laser according to the log.
    pub laser: Pose2,
}

#[derive(Debug)]
pub struct Log {
    /// In the order of their times.
    pub instants: Vec<Instant>,
    /// Whether the laser's poses are corrected, and thus a reference.
    pub is_corrected: bool,
}

impl Log {
    /// Reads a log.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read, is no log, or holds no scans.
    pub fn read(file: &Path) -> Result<Self, LogError> {
        let mut log = carmen::read(file)?;
        let first = log
            .instants
            .iter()
            .position(|it| it.scan.is_some())
            .ok_or_else(|| LogError::Empty { file: file.to_owned() })?;
        log.instants.drain(..first);
        Ok(log)
    }

    /// Returns the number of beams of its first scan.
    pub fn beams(&self) -> usize {
        self.scanned().find_map(|it| Some(it.scan.as_ref()?.len())).unwrap_or_default()
    }

    fn scanned(&self) -> impl Iterator<Item = &Instant> {
        self.instants.iter().filter(|it| it.scan.is_some())
    }
}

/// Returns the upper median, if there are any values.
fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// Returns the motion from one pose to another, in the frame of the first.
fn between(from: Pose2, to: Pose2) -> Pose2 {
    let way = DVec2::from_angle(-from.heading).rotate(to.position - from.position);
    Pose2 { position: way, heading: wrap_angle(to.heading - from.heading) }
}

fn moved(from: Pose2, by: Pose2) -> Pose2 {
    let way = DVec2::from_angle(from.heading).rotate(by.position);
    Pose2 { position: from.position + way, heading: from.heading + by.heading }
}

#[cfg(test)]
mod tests {
    use std::{f64::consts::TAU, fmt::Write as _, fs};

    use super::*;

    fn log(text: &str) -> Result<Log, LogError> {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.log");
        fs::write(&file, text).unwrap();
        Log::read(&file)
    }

    #[test]
    fn a_line_that_is_no_message_is_named_and_a_log_without_scans_is_refused() {
        let odometry = "ODOM 1 2 0.5 0 0 0 10 robot 10\n";
        for line in ["ODOM 1 2", "ODOM 1 2 nan 0 0 0 1 r 1", "FLASER 99999999999 1", "FLASER 2 1 1"]
        {
            let said = log(&format!("# a comment\n{odometry}{line}\n")).unwrap_err().to_string();
            assert!(said.contains("line 3 is no message"), "{line}: {said}");
        }
        assert!(matches!(log(odometry), Err(LogError::Empty { .. })));
        assert!(matches!(log(""), Err(LogError::Empty { .. })));
    }

    #[test]
    fn odometry_goes_on_from_corrected_poses_and_times_that_go_back_follow_the_file() {
        let log = log("ODOM 0 0 0 0 0 0 5 r 5\n\
            FLASER 1 2.0 0 0 0 0 0 0 5 r 5\n\
            ODOM 1 0 0 0 0 0 6 r 6\n\
            ODOM 3 3 0 0 0 0 0 r 0\n\
            ODOM 4 3 0 0 0 0 4 r 4\n\
            FLASER 1 2.0 3 3 0 0 0 0 4 r 4\n")
        .unwrap();
        assert!(log.is_corrected);
        let last = log.instants.last().unwrap();
        assert!(last.scan.is_some() && (last.odometry.position.x - 2.0).abs() < 1e-9);
        assert!(log.instants.windows(2).all(|it| it[0].time_s < it[1].time_s));
    }

    /// Returns a log of a circle in a room of 8 by 6 m, whose odometry turns a tenth too far.
    fn circle() -> Log {
        let mut text = String::new();
        for step in 0..300 {
            let angle = f64::from(step) * 0.02 * TAU / 4.0;
            let truth = Pose2 { position: DVec2::from_angle(angle - TAU / 4.0), heading: angle };
            let odometry = moved(
                Pose2 { position: DVec2::new(0.0, -1.0), heading: 0.0 },
                Pose2 {
                    position: (DVec2::from_angle(1.1 * angle - TAU / 4.0) + DVec2::Y) / 1.1,
                    heading: 1.1 * angle,
                },
            );
            let Pose2 { position: at, heading } = odometry;
            let time_s = 10.0 + f64::from(step) * 0.2;
            writeln!(text, "ODOM {} {} {heading} 0 0 0 {time_s} r {time_s}", at.x, at.y).unwrap();
            let ranges = (0..181).map(|beam| {
                let along = DVec2::from_angle(angle + f64::from(beam - 90).to_radians());
                let range = (DVec2::new(4.0, 3.0) * along.signum() - truth.position) / along;
                format!("{:.3} ", range.min_element())
            });
            let ranges: String = ranges.collect();
            let DVec2 { x, y } = truth.position;
            writeln!(
                text,
                "FLASER 181 {ranges}{x} {y} {angle} {} {} {heading} {time_s} r {time_s}",
                at.x, at.y
            )
            .unwrap();
        }
        Log { is_corrected: true, ..log(&text).unwrap() }
    }

    #[test]
    fn a_log_is_tracked_by_its_scans_where_its_odometry_is_wrong_and_no_stand_is_false() {
        let log = circle();
        let mission = mission(&log, None).unwrap();
        let drive = drive(&log, &mission).unwrap();
        let judged = judge(&log, &drive);
        assert!(judged.error_5_m.unwrap() < 0.05, "{judged:?}");
        assert!(judged.odometry_error_5_m.unwrap() > 0.3, "{judged:?}");
        assert!(judged.fixes > 0.95 && judged.blur_ratio < 0.8, "{judged:?}");
        assert!(drive.stands.is_empty(), "{:?}", drive.stands);
    }
}
