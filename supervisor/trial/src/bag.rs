//! Bags of ROS 2: an MCAP or SQLite file, or a directory of them.
//!
//! The link gets their messages as from a running robot. The robot's laser is placed by the bag's
//! transforms, or at the centre without them. Scans have the odometry of their stamps.

use std::{fs, path::Path};

use common::{geometry::wrap_angle, kinematics::Pose2, mission::Mission};
use ros2::{
    cdr::Cdr as _,
    frames::Frames,
    msg::{self, LaserScan},
};
use ros2_driver::{
    messages::{Odometry, Scan},
    topics::{Content, Topics},
};
use rusqlite::{Connection, OpenFlags};

use crate::{Instant, Log, LogError, Said, between, carmen::pose, moved, rate_hz};

const ODOMETRY: &str = "nav_msgs/msg/Odometry";
const SCAN: &str = "sensor_msgs/msg/LaserScan";
const IMU: &str = "sensor_msgs/msg/Imu";
const TRANSFORMS: &str = "tf2_msgs/msg/TFMessage";
/// Most bytes of the kept messages.
const MOST_BYTES: usize = 4 << 30;
/// Bounds of a laser's reach that a mission may state, metres, and of its view, degrees.
const REACHES_M: [f64; 2] = [0.5, 30.0];
const VIEWS_DEG: [f64; 2] = [10.0, 360.0];
/// Least top speed of a robot, its ratio to the fastest odometry, and the most of a mission, m/s.
const SPEEDS: [f64; 3] = [1.0, 1.2, 10.0];
/// Least time over which speeds are measured.
const SPEED_OVER_S: f64 = 0.2;

struct Message {
    topic: String,
    kind: String,
    at_ns: u64,
    data: Vec<u8>,
}

#[derive(Default)]
struct Bag {
    messages: Vec<Message>,
    bytes: usize,
    frames: Frames,
}

/// Reads the bag of the tables `robot`, or of a robot that its messages describe.
pub(crate) fn read(path: &Path, robot: Option<&str>) -> Result<Log, LogError> {
    let unusable = |problem| LogError::Form { file: path.to_owned(), problem };
    let mut bag = Bag::default();
    for file in &files(path).map_err(|error| unusable(error.to_string()))? {
        let is_wanted = |_: &str, kind: &str| [ODOMETRY, SCAN, IMU, TRANSFORMS].contains(&kind);
        if file.extension().is_some_and(|it| it == "db3") {
            let read = bag.read_sqlite(file);
            read.map_err(|error| unusable(format!("{error}; copy or record it again")))?;
        } else {
            for message in recording::messages(file, is_wanted)? {
                let recording::Message { topic, kind, log_ns: at_ns, data, .. } = message?;
                let (topic, kind) = (topic.to_string(), kind.to_string());
                bag.take(Message { topic, kind, at_ns, data }).map_err(unusable)?;
            }
        }
    }
    bag.messages.sort_by_key(|it| it.at_ns);
    let (robot, turned) = match robot {
        Some(robot) => (robot.to_owned(), None),
        None => bag.robot().map(|(robot, turned)| (robot, Some(turned))).map_err(unusable)?,
    };
    let mission = Mission::parse(&format!("target = [0, 0]\n{robot}"), "robot")?;
    let instants = bag.instants(&mission, turned).map_err(unusable)?;
    Ok(Log { instants, is_corrected: false, robot })
}

fn files(path: &Path) -> std::io::Result<Vec<std::path::PathBuf>> {
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let mut files = Vec::new();
    for entry in fs::read_dir(path)? {
        let file = entry?.path();
        if file.extension().is_some_and(|it| it == "db3" || it == "mcap") {
            files.push(file);
        }
    }
    // `_10` follows `_9`.
    files.sort_by_key(|file| (file.as_os_str().len(), file.clone()));
    Ok(files)
}

impl Bag {
    fn read_sqlite(&mut self, file: &Path) -> Result<(), Box<dyn std::error::Error>> {
        let base = Connection::open_with_flags(file, OpenFlags::SQLITE_OPEN_READ_ONLY)?;
        let mut rows = base.prepare(
            "SELECT topics.name, topics.type, messages.timestamp, messages.data FROM messages \
             JOIN topics ON topics.id = messages.topic_id WHERE topics.type IN (?, ?, ?, ?)",
        )?;
        let mut rows = rows.query([ODOMETRY, SCAN, IMU, TRANSFORMS])?;
        while let Some(row) = rows.next()? {
            let at_ns = row.get::<_, i64>(2)?.max(0).unsigned_abs();
            let (topic, kind, data) = (row.get(0)?, row.get(1)?, row.get(3)?);
            self.take(Message { topic, kind, at_ns, data })?;
        }
        Ok(())
    }

    fn take(&mut self, message: Message) -> Result<(), String> {
        if message.kind == TRANSFORMS {
            return self.frames.take(&message.data, None);
        }
        self.bytes += message.data.len();
        if self.bytes > MOST_BYTES {
            return Err("its odometry and scans exceed 4 GiB; give a part of it".to_owned());
        }
        self.messages.push(message);
        Ok(())
    }

    /// Returns the topic of this kind: `usual`, or the only one.
    fn topic(&self, kind: &str, usual: &str) -> Result<String, String> {
        let of_kind = self.messages.iter().filter(|it| it.kind == kind);
        let mut topics: Vec<_> = of_kind.map(|it| it.topic.as_str()).collect();
        topics.sort_unstable();
        topics.dedup();
        match topics[..] {
            [only] => Ok(only.to_owned()),
            [] => Err(format!(
                "no messages of {kind}; record {usual}, or convert a recording of firsthand with `firsthand ros2 bag`"
            )),
            _ if topics.contains(&usual) => Ok(usual.to_owned()),
            _ => Err(format!(
                "{} are all of {kind}; name one in robot.ros2 of a file for --robot",
                topics.join(", ")
            )),
        }
    }

    fn of<'a>(&'a self, topic: &'a str) -> impl Iterator<Item = &'a Message> {
        self.messages.iter().filter(move |it| it.topic == topic)
    }

    /// Returns the tables of the robot, and the angle of its scans' middle beam.
    fn robot(&self) -> Result<(String, f64), String> {
        let [odom, scan] =
            [(ODOMETRY, "/odom"), (SCAN, "/scan")].map(|(kind, usual)| self.topic(kind, usual));
        let (odom, scan) = (odom?, scan?);
        let of_odom = |why: String| format!("{odom}: {why}");
        let mut poses = Vec::new();
        let mut base = String::new();
        for Message { data, .. } in self.of(&odom) {
            let Odometry { stamp_ns, pose: at, .. } = Odometry::read(data).map_err(of_odom)?;
            if poses.is_empty() {
                let odometry = msg::Odometry::decode(data).map_err(String::from);
                base = odometry.map_err(of_odom)?.child_frame_id;
            }
            poses.push((stamp_ns as f64 * 1e-9, pose(at)));
        }
        let gaps = poses.windows(2).map(|it| it[1].0 - it[0].0).filter(|gap| *gap > 0.0);
        let rate_hz = rate_hz(gaps);
        let speeds = poses.iter().enumerate().filter_map(|(index, (from_s, from))| {
            let (to_s, to) = poses[index..].iter().find(|it| it.0 - from_s >= SPEED_OVER_S)?;
            Some(between(*from, *to).position.length() / (to_s - from_s))
        });
        let [least, ratio, most] = SPEEDS;
        let top_m_s = (ratio * speeds.fold(0.0, f64::max)).clamp(least, most);
        let first = self.of(&scan).next().ok_or("no scans")?;
        let fan = LaserScan::decode(&first.data).map_err(|why| format!("{scan}: {why}"))?;
        let (middle, view_deg) = view(&fan);
        let place = self.frames.find(&fan.header.frame_id, &base, None).unwrap_or_default();
        let looks = place.matrix2.x_axis.to_angle();
        let is_upside_down = place.matrix2.determinant() < 0.0;
        let looks = if is_upside_down { looks - middle } else { looks + middle };
        let forward_m = place.translation.length();
        let bearing = if forward_m > 1e-6 { place.translation.to_angle() } else { 0.0 };
        let imu = self.topic(IMU, "/imu").map(|imu| format!(", imu = {imu:?}"));
        let robot = format!(
            "[robot]\nprotocol = 'ros2'\naddress = 'ros2:0'\nrate_hz = {rate_hz:.2}\n\
            command_limit_s = 5\ntop_speed_m_s = {top_m_s:.2}\n\
            ros2 = {{ odom = {odom:?}, scan = {scan:?}{} }}\n\
            [[robot.sensor]]\nname = 'laser'\nkind = 'scan'\nforward_m = {forward_m:.4}\n\
            bearing_deg = {:.3}\nturned_deg = {:.3}\nroll_deg = {}\nfield_of_view_deg = {:.4}\n\
            reach_m = {:.2}\nbeams = {}\n",
            imu.unwrap_or_default(),
            bearing.to_degrees(),
            wrap_angle(looks - bearing).to_degrees(),
            if is_upside_down { 180 } else { 0 },
            view_deg.clamp(VIEWS_DEG[0], VIEWS_DEG[1]),
            f64::from(fan.range_max).clamp(REACHES_M[0], REACHES_M[1]),
            fan.ranges.len().max(1),
        );
        Ok((robot, middle))
    }

    /// Returns the messages that the mission's link hears. Scans are turned back by `turned`,
    /// radians.
    fn instants(self, mission: &Mission, turned: Option<f64>) -> Result<Vec<Instant>, String> {
        let topics = Topics::of(mission).heard;
        let row = |topic: &str| {
            let topic = topic.trim_start_matches('/');
            topics.iter().position(|(_, it)| it.name.trim_start_matches('/') == topic)
        };
        let mut heard = Vec::new();
        let mut poses: Vec<(i64, Pose2)> = Vec::new();
        for Message { topic, at_ns, data, .. } in self.messages {
            let Some(row) = row(&topic) else { continue };
            let content = topics[row].0;
            if content == Content::Odometry {
                let odometry = Odometry::read(&data).map_err(|why| format!("{topic}: {why}"))?;
                poses.push((odometry.stamp_ns, pose(odometry.pose)));
            }
            heard.push((row as u8, content, at_ns, data));
        }
        poses.sort_by_key(|it| it.0);
        let Some((_, start)) = poses.first().copied() else {
            let topic = &topics[0].1.name;
            return Err(format!("no odometry on {topic}; set robot.ros2.odom to its topic"));
        };
        let mut instants = Vec::new();
        let mut pieces = Vec::new();
        for (row, content, at_ns, mut data) in heard {
            let stamp_ns = match content {
                Content::Odometry => Odometry::read(&data)?.stamp_ns,
                Content::Scan(_) => {
                    if let Some(turned) = turned {
                        data = turned_back(&data, turned)?;
                    }
                    Scan::read(&data)?.stamp_ns
                }
                _ => 0,
            };
            pieces.push([&[row][..], &data].concat());
            if matches!(content, Content::Odometry | Content::Scan(_)) {
                let stamp_ns = if stamp_ns == 0 { at_ns as i64 } else { stamp_ns };
                instants.push(Instant {
                    time_s: at_ns as f64 * 1e-9,
                    odometry: between(start, interpolated(&poses, stamp_ns)),
                    laser: Pose2::default(),
                    has_scan: matches!(content, Content::Scan(_)),
                    said: Said::Pieces(std::mem::take(&mut pieces)),
                });
            }
        }
        Ok(instants)
    }
}

fn interpolated(poses: &[(i64, Pose2)], at_ns: i64) -> Pose2 {
    let after = poses.partition_point(|it| it.0 < at_ns).clamp(1, poses.len().max(2) - 1);
    let (Some((from_ns, from)), Some((to_ns, to))) = (poses.get(after - 1), poses.get(after))
    else {
        return poses.first().map_or_else(Pose2::default, |it| it.1);
    };
    let share = (at_ns - from_ns) as f64 / (to_ns - from_ns).max(1) as f64;
    let share = share.clamp(0.0, 1.0);
    let Pose2 { position, heading } = between(*from, *to);
    moved(*from, Pose2 { position: share * position, heading: share * heading })
}

/// Returns the angle of a scan's middle beam, radians, and the view of its laser, degrees.
fn view(scan: &LaserScan) -> (f64, f64) {
    let (count, step) = (scan.ranges.len() as f64, f64::from(scan.angle_increment));
    let is_circle = (count * step.abs()).to_degrees() >= 360.0 - 1.5 * step.abs().to_degrees();
    let steps = if is_circle { count } else { count - 1.0 };
    let first = f64::from(scan.angle_min);
    let first = if step < 0.0 { first + step * (count - 1.0) } else { first };
    let middle = first + 0.5 * steps * step.abs();
    (middle, if is_circle { 360.0 } else { (steps * step.abs()).to_degrees() })
}

/// Returns a scan whose beams run counter-clockwise about the middle beam.
fn turned_back(data: &[u8], middle: f64) -> Result<Vec<u8>, String> {
    let mut scan = LaserScan::decode(data)?;
    if scan.angle_increment < 0.0 {
        scan.ranges.reverse();
        let last = scan.angle_increment * scan.ranges.len().saturating_sub(1) as f32;
        scan.angle_min += last;
        scan.angle_increment = -scan.angle_increment;
        scan.time_increment = 0.0;
    }
    scan.angle_min -= middle as f32;
    scan.intensities.clear();
    Ok(scan.encode())
}
