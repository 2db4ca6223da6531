//! Logs of real robots, as runs that somebody else drives.
//!
//! A log becomes what its robot sends: the messages of a ROS 2 robot, or the lines of a JSON robot.
//! The link, dead reckoning and the mapper take them as on a robot, in one thread. The commands are
//! the speeds that the log goes on with, so that a healthy robot obeys. Poses that the log itself
//! corrected are the reference.

mod bag;
mod carmen;
mod drive;
mod judge;
mod table;
mod text;

use std::{
    fs::File,
    io::{self, Read as _},
    path::{Path, PathBuf},
};

use common::{geometry::wrap_angle, kinematics::Pose2, mission::MissionError};
use glam::DVec2;
use recording::RecordingError;
use thiserror::Error;

pub use drive::{Drive, drive, mission};
pub use judge::{Judged, judge};

/// Log that cannot be tried.
#[derive(Debug, Error)]
pub enum LogError {
    #[error("{}: {cause}; give a log that can be read", file.display())]
    Unreadable { file: PathBuf, cause: io::Error },
    #[error("{}: {problem}", file.display())]
    Form { file: PathBuf, problem: String },
    #[error("{} is a bag of ROS 1; convert it with `rosbags-convert`", file.display())]
    Ros1 { file: PathBuf },
    #[error("{}: no laser scans with odometry; give a log with both", file.display())]
    Empty { file: PathBuf },
    #[error(transparent)]
    Recording(#[from] RecordingError),
    #[error(transparent)]
    Robot(#[from] MissionError),
}

/// What the robot sends at one time.
#[derive(Clone, Debug)]
enum Said {
    /// Line of odometry, and perhaps ranges, counter-clockwise, metres.
    Line(Option<Vec<f32>>),
    /// Messages as the driver of ROS 2 robots takes them.
    Pieces(Vec<Vec<u8>>),
}

/// Odometry, and perhaps a scan, of one time.
#[derive(Clone, Debug)]
pub struct Instant {
    pub time_s: f64,
    /// Pose by the wheels since the start of the log.
    pub odometry: Pose2,
    /// Pose of the scan's laser according to the log.
    pub laser: Pose2,
    has_scan: bool,
    said: Said,
}

#[derive(Debug)]
pub struct Log {
    /// In the order of their times.
    pub instants: Vec<Instant>,
    /// Whether the laser's poses are corrected, and thus a reference.
    pub is_corrected: bool,
    /// Tables of a robot that gives such a log.
    robot: String,
}

impl Log {
    /// Reads the log of a robot with the tables `robot`, or of one that the log describes.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read, is no log, or holds no scans.
    pub fn read(file: &Path, robot: Option<&str>) -> Result<Self, LogError> {
        let unreadable = |cause| LogError::Unreadable { file: file.to_owned(), cause };
        let mut begins = Vec::new();
        let is_directory = file.is_dir();
        if !is_directory {
            let opened = File::open(file).map_err(unreadable)?;
            opened.take(16).read_to_end(&mut begins).map_err(unreadable)?;
        }
        let mut log = if begins.starts_with(b"#ROSBAG") {
            return Err(LogError::Ros1 { file: file.to_owned() });
        } else if is_directory
            || [&b"\x89MCAP"[..], b"SQLite format"].iter().any(|it| begins.starts_with(it))
        {
            bag::read(file, robot)?
        } else {
            text::read(file, begins.starts_with(&[0x1f, 0x8b]), robot)?
        };
        let first = log
            .instants
            .iter()
            .position(|it| it.has_scan)
            .ok_or_else(|| LogError::Empty { file: file.to_owned() })?;
        log.instants.drain(..first);
        Ok(log)
    }
}

/// Returns the rate of a robot's ticks whose reports come at these intervals, Hz.
fn rate_hz(periods_s: impl Iterator<Item = f64>) -> f64 {
    median(periods_s).unwrap_or(1.0).recip().clamp(1.0, 10.0)
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

    use ros2::{
        cdr::Cdr as _,
        messages::{odometry, scan},
        msg::{Header, Quaternion, TFMessage, Transform, TransformStamped, Vector3},
    };

    use super::*;

    fn log(text: &str) -> Result<Log, LogError> {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.log");
        fs::write(&file, text).unwrap();
        Log::read(&file, None)
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
    fn a_table_of_wheel_angles_or_poses_is_read_with_its_scans_and_a_row_without_numbers_is_named()
    {
        let poses = "time_s,x_m,y_m,heading_rad,range_0,range_1\n1,5,5,1,2.5,\n2,5,6,1,,\n";
        let Log { instants, .. } = log(poses).unwrap();
        assert!(matches!(&instants[0].said, Said::Line(Some(ranges)) if ranges[0] == 2.5));
        assert!(instants[0].has_scan && !instants[1].has_scan);
        let gone = instants[1].odometry.position;
        assert!(gone.distance(DVec2::from_angle(-1.0).rotate(DVec2::Y)) < 1e-9, "{gone}");
        let said = log(&format!("{poses}3,0,,0,1,1\n")).unwrap_err().to_string();
        assert!(said.contains("line 4"), "{said}");
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.csv");
        fs::write(&file, "time_s,left_rad,right_rad,range\n1,7,7,2\n2,9,11,2\n").unwrap();
        let read = |robot| Log::read(&file, robot);
        assert!(read(None).unwrap_err().to_string().contains("robot.wheel_radius_m"));
        let sizes = "robot.wheel_radius_m = 0.1\nrobot.track_m = 0.4\n";
        let turned = read(Some(sizes)).unwrap().instants[1].odometry;
        assert!((turned.heading - 0.5).abs() < 1e-9, "{turned:?}");
        assert!((turned.position.length() - 0.3).abs() < 0.01, "{turned:?}");
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
        assert!(last.has_scan && (last.odometry.position.x - 2.0).abs() < 1e-9);
        assert!(log.instants.windows(2).all(|it| it[0].time_s < it[1].time_s));
    }

    /// Returns times, true poses and odometry on a circle. The odometry turns a tenth too far.
    fn circle() -> impl Iterator<Item = (f64, Pose2, Pose2)> {
        (0..300).map(|step| {
            let angle = f64::from(step) * 0.02 * TAU / 4.0;
            let truth = Pose2 { position: DVec2::from_angle(angle - TAU / 4.0), heading: angle };
            let odometry = moved(
                Pose2 { position: DVec2::new(0.0, -1.0), heading: 0.0 },
                Pose2 {
                    position: (DVec2::from_angle(1.1 * angle - TAU / 4.0) + DVec2::Y) / 1.1,
                    heading: 1.1 * angle,
                },
            );
            (10.0 + f64::from(step) * 0.2, truth, odometry)
        })
    }

    /// Returns the range in a room of 8 by 6 m.
    fn range(from: DVec2, along: DVec2) -> f64 {
        ((DVec2::new(4.0, 3.0) * along.signum() - from) / along).min_element()
    }

    fn carmen() -> Log {
        let mut text = String::new();
        for (time_s, truth, Pose2 { position: at, heading }) in circle() {
            writeln!(text, "ODOM {} {} {heading} 0 0 0 {time_s} r {time_s}", at.x, at.y).unwrap();
            let ranges = (0..181).map(|beam| {
                let along = DVec2::from_angle(truth.heading + f64::from(beam - 90).to_radians());
                format!("{:.3} ", range(truth.position, along))
            });
            let ranges: String = ranges.collect();
            let Pose2 { position: DVec2 { x, y }, heading: angle } = truth;
            writeln!(
                text,
                "FLASER 181 {ranges}{x} {y} {angle} {} {} {heading} {time_s} r {time_s}",
                at.x, at.y
            )
            .unwrap();
        }
        Log { is_corrected: true, ..log(&text).unwrap() }
    }

    /// Returns the topics of a bag, their types and times, nanoseconds, and their messages. Its
    /// laser looks to 115 degrees, is upside down, and turns clockwise from there.
    fn bagged() -> Vec<([&'static str; 2], u64, Vec<u8>)> {
        const YAW: f64 = 2.0;
        let place = DVec2::new(0.1, 0.05);
        let (y, x) = (0.5 * YAW).sin_cos();
        let mounted = TransformStamped {
            header: Header::at(0, "base_link"),
            child_frame_id: "laser".to_owned(),
            transform: Transform {
                translation: Vector3 { x: place.x, y: place.y, z: 0.2 },
                rotation: Quaternion { x, y, z: 0.0, w: 0.0 },
            },
        };
        let static_ = TFMessage { transforms: vec![mounted] }.encode();
        let mut all = vec![(["/tf_static", "tf2_msgs/msg/TFMessage"], 0, static_)];
        for (time_s, truth, Pose2 { position: at, heading }) in circle() {
            let at_ns = (time_s * 1e9) as u64;
            let pose = ([at.x, at.y, heading], [0.0; 36]);
            let odometry =
                odometry(Header::at(at_ns, "odom"), "base_link", pose, ([0.0; 2], [0.0; 36]));
            all.push((["/wheels/odom", "nav_msgs/msg/Odometry"], at_ns, odometry));
            let from = moved(truth, Pose2 { position: place, heading: 0.0 }).position;
            let ranges = (0..360).map(|beam| {
                let along = truth.heading + YAW - f64::from(beam).to_radians();
                range(from, DVec2::from_angle(along)) as f32
            });
            let fan = [0.0, TAU / 360.0];
            let scan =
                scan(Header::at(at_ns, "laser"), fan, [0.1, 12.0], [0.0; 2], ranges.collect());
            all.push((["/scan", "sensor_msgs/msg/LaserScan"], at_ns, scan));
        }
        all
    }

    #[test]
    fn a_bag_of_either_storage_is_tracked_with_the_laser_where_its_transforms_place_it() {
        let folder = tempfile::tempdir().unwrap();
        let (mcap, sqlite) = (folder.path().join("mcap"), folder.path().join("a_0.db3"));
        let mut bag = recording::Bag::create(&mcap).unwrap();
        let base = rusqlite::Connection::open(&sqlite).unwrap();
        base.execute_batch(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT);
             CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB); BEGIN;",
        )
        .unwrap();
        let mut topics = Vec::new();
        for ([topic, kind], at_ns, data) in bagged() {
            if !topics.contains(&topic) {
                bag.add([topic, kind, ""], false).unwrap();
                let row = (topics.len() as i64, topic, kind);
                base.execute("INSERT INTO topics VALUES (?, ?, ?)", row).unwrap();
                topics.push(topic);
            }
            bag.message(topic, at_ns, &data).unwrap();
            let number = topics.iter().position(|it| *it == topic).unwrap();
            let row = (number as i64, at_ns as i64, data);
            let insert = "INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)";
            base.execute(insert, row).unwrap();
        }
        base.execute_batch("COMMIT;").unwrap();
        bag.finish().unwrap();
        let judged = [mcap, sqlite].map(|file| {
            let log = Log::read(&file, None).unwrap();
            let drive = drive(&log, &mission(&log).unwrap()).unwrap();
            assert!(drive.stands.is_empty(), "{:?}", drive.stands);
            judge(&drive)
        });
        for judged in &judged {
            assert!(judged.scans > 290 && judged.fixes > 0.95, "{judged:?}");
            assert!(judged.blur_ratio < 0.8, "{judged:?}");
        }
    }

    #[test]
    fn a_log_is_tracked_by_its_scans_where_its_odometry_is_wrong_and_no_stand_is_false() {
        let log = carmen();
        let mission = mission(&log).unwrap();
        let drive = drive(&log, &mission).unwrap();
        let judged = judge(&drive);
        assert!(judged.error_5_m.unwrap() < 0.05, "{judged:?}");
        assert!(judged.odometry_error_5_m.unwrap() > 0.3, "{judged:?}");
        assert!(judged.fixes > 0.95 && judged.blur_ratio < 0.8, "{judged:?}");
        assert!(drive.stands.is_empty(), "{:?}", drive.stands);
    }
}
