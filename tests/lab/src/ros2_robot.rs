//! Simulated robot that speaks JSON lines, presented as a ROS 2 robot.
//!
//! A thread is the simulated robot's host, and publishes and subscribes for it, on this machine
//! only. Like a robot's own program, it computes odometry from wheel angles by the mission's stated
//! sizes, independent of the true ones. Without commands, the simulated robot stops after
//! [`WATCHDOG_S`].

use std::{
    collections::BTreeMap,
    io,
    net::{Ipv4Addr, SocketAddr, UdpSocket},
    os::fd::AsFd as _,
    path::PathBuf,
    time::{Duration, Instant},
};

use clap::Args;
use common::{
    clock::monotonic_ns,
    json_wire::{Lines, Order, Report, Scan, line, parse},
    kinematics::{DifferentialDrive, Pose2, Twist},
    mission::{Mission, Protocol, Ros2Topics},
    poll,
};
use console::{
    missions::{self, LookupError},
    output::print_text,
};
use mission_control::surroundings::SimulatedRobot as _;
use ros2::{
    cdr::{Cdr as _, Malformed},
    messages::{COVARIANCE, battery, odometry, scan},
    msg::{self, HazardDetection, HazardDetectionVector, Header},
    participant::{Participant, Quality, Reader, Writer},
};
use ros2_driver::topics::{Content, Topics};

use crate::{
    background::Turns,
    error::{OrCannot as _, Result},
    robot::simulated,
};

const WATCHDOG_S: f64 = 0.25;
/// Share of a delay, as a divisor, by which report times catch up.
const CATCHES_UP: u64 = 8;
const LOOK: Duration = Duration::from_millis(50);
const SILENT: Duration = Duration::from_secs(1);
const MOST_COMMANDS: usize = 16;
const RELIABLE: Quality = Quality { is_reliable: true, is_latched: false, depth: 10 };

/// Simulate a robot that speaks ROS 2 in a mission's world, until this ends. Prints its mission
/// keys as options of `firsthand run`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Mission of the simulated robot.
    mission: String,
    /// Set a key of the simulated robot, unknown to its program and mission.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Directory of the ground truth.
    #[arg(long, value_name = "DIR", default_value = "ros2-robot")]
    out: PathBuf,
}

pub fn main(arguments: &Arguments) -> Result {
    let Arguments { mission, set, out } = arguments;
    let mut own = missions::load(mission, set)?;
    // The mission may already describe the robot that this one is presented as.
    own.robot.protocol = Some(Protocol::Json);
    own.robot.address = None;
    own.robot.ros2 = Ros2Topics::default();
    let mut simulator = simulated(out, &own)?;
    let stated = |keys: &[String]| missions::load(mission, keys);
    let robot = Ros2Robot::start(simulator.address(), 0, 1.0, stated)?;
    print_text(robot.keys.iter().map(|key| format!("--set={key}\n")).collect::<String>())?;
    while simulator.poll()? {
        std::thread::sleep(LOOK);
    }
    Ok(())
}

pub struct Ros2Robot {
    pub keys: Vec<String>,
    _thread: Turns,
}

impl Ros2Robot {
    /// Speaks for the simulated robot at `robot`, the `number`th of this process, by the sizes of
    /// the mission `stated` with the robot's keys.
    ///
    /// Its odometry turns `turns` times as far as the wheels do.
    ///
    /// # Errors
    /// There is no such mission, or DDS does not start.
    pub fn start(
        robot: SocketAddr,
        number: u64,
        turns: f64,
        stated: impl Fn(&[String]) -> Result<Mission, LookupError>,
    ) -> Result<Self> {
        // Topics differ between robots, because others on this machine may share a domain. The
        // ports of higher domains overlap those of other sockets.
        let process = std::process::id();
        let domain = 1 + (u64::from(process) + number) % 99;
        let topics = ["odom", "scan", "cmd_vel", "battery", "hazards"];
        let topic = |name| format!("robot.ros2.{name}='/lab{process}_{number}/{name}'");
        let address = format!("robot.address='ros2:{domain}'");
        let mut keys = vec!["robot.protocol='ros2'".to_owned(), address];
        keys.extend(topics.map(topic));
        let node = Node::new(robot, &stated(&keys)?, domain as u16, turns);
        let mut node = node.or_cannot("start a node of ROS 2")?;
        Ok(Self { keys, _thread: Turns::start(|| move || node.turn()) })
    }
}

struct Node {
    wire: UdpSocket,
    lines: Lines,
    heard: Option<Instant>,
    commands: Reader,
    writers: Vec<(Content, Writer)>,
    program: Program,
    participant: Participant,
}

impl Node {
    fn new(robot: SocketAddr, stated: &Mission, domain: u16, turns: f64) -> io::Result<Self> {
        let wire = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
        wire.set_nonblocking(true)?;
        wire.connect(robot)?;
        let participant = Participant::join(domain, Some(Ipv4Addr::LOCALHOST))?;
        let topics = Topics::of(stated);
        let said = topics.heard.iter().filter(|(content, _)| *content != Content::Command);
        let writers =
            said.map(|(content, topic)| Ok((*content, participant.writer(topic, RELIABLE)?)));
        Ok(Self {
            wire,
            lines: Lines::default(),
            heard: None,
            commands: participant.reader(&topics.command, RELIABLE)?,
            writers: writers.collect::<io::Result<_>>()?,
            program: Program::new(stated, turns),
            participant,
        })
    }

    fn turn(&mut self) -> io::Result<()> {
        if self.heard.is_none_or(|heard| heard.elapsed() > SILENT) {
            self.heard = Some(Instant::now());
            self.wire.send(&line(&Order::Hello { rate_hz: self.program.stated.robot.rate_hz }))?;
        }
        poll::readable(&[self.wire.as_fd(), self.participant.as_fd()], Some(LOOK))?;
        self.participant.unring();
        for message in self.commands.messages().take(MOST_COMMANDS) {
            if let Ok(order) = self.program.order(&message.payload) {
                self.wire.send(&line(&order))?;
            }
        }
        let mut buffer = [0; 65_536];
        while let Ok(length) = self.wire.recv(&mut buffer) {
            self.heard = Some(Instant::now());
            for report in self.lines.push(&buffer[..length]) {
                let Ok(report) = parse(&report) else { continue };
                self.program.take_wheels(&report);
                let taken_ns = self.program.taken_ns(&report, monotonic_ns());
                for (content, writer) in &self.writers {
                    let message = self.program.message(*content, &report, taken_ns);
                    message.into_iter().for_each(|message| _ = writer.write(message));
                }
            }
        }
        Ok(())
    }
}

/// Robot's own program. Pure: times and lines in, messages out.
struct Program {
    stated: Mission,
    drive: DifferentialDrive,
    turns: f64,
    pose: Pose2,
    wheels: Option<[f64; 2]>,
    taken_ns: Option<u64>,
}

impl Program {
    fn new(stated: &Mission, turns: f64) -> Self {
        Self {
            stated: stated.clone(),
            drive: stated.body().unlimited(),
            turns,
            pose: Pose2::default(),
            wheels: None,
            taken_ns: None,
        }
    }

    fn order(&self, payload: &[u8]) -> Result<Order, Malformed> {
        let twist = msg::Twist::decode(payload)?;
        let [v, omega] = [twist.linear.x, twist.angular.z];
        let wheels = self.drive.wheels(Twist { v, omega });
        Ok(Order::Drive { wheels, twist: [v, omega], for_s: WATCHDOG_S })
    }

    fn take_wheels(&mut self, report: &Report) {
        if let Some(now) = report.wheels {
            let before = self.wheels.replace(now).unwrap_or(now);
            let turned = [0, 1].map(|wheel| now[wheel] - before[wheel]);
            let Twist { v: arc, omega: turn } = self.drive.twist(turned);
            self.pose = self.pose.along_arc(arc, self.turns * turn);
        }
    }

    /// Returns when a report that came at `now_ns` was made.
    ///
    /// Reports queue on a busy machine, so times follow one period after another and catch up
    /// slowly.
    fn taken_ns(&mut self, report: &Report, now_ns: u64) -> u64 {
        if report.wheels.is_none() {
            return now_ns;
        }
        let period_ns = (1e9 / self.stated.robot.rate_hz) as u64;
        let due_ns = self.taken_ns.map_or(now_ns, |before| before + period_ns);
        let taken_ns = now_ns.min(due_ns + now_ns.saturating_sub(due_ns) / CATCHES_UP);
        *self.taken_ns.insert(taken_ns)
    }

    fn message(&self, content: Content, report: &Report, now_ns: u64) -> Option<Vec<u8>> {
        match content {
            Content::Odometry => {
                let Twist { v, omega } = self.drive.twist(report.speeds?);
                let Pose2 { position, heading } = self.pose;
                let pose = [position.x, position.y, heading];
                let header = Header::at(now_ns, "odom");
                report.wheels?;
                let unknown = [0.0; COVARIANCE];
                Some(odometry(
                    header,
                    "base_footprint",
                    (pose, unknown),
                    ([v, self.turns * omega], unknown),
                ))
            }
            Content::Scan(row) => self.scan(row, report, now_ns),
            Content::Battery => {
                report.battery_v.map(|volts| battery(Header::at(now_ns, ""), volts))
            }
            Content::Hazards if !report.touched.is_empty() => {
                Some(hazards(&report.touched, now_ns))
            }
            _ => None,
        }
    }

    fn scan(&self, row: usize, report: &Report, now_ns: u64) -> Option<Vec<u8>> {
        let sensor = self.stated.sensor_table().into_iter().nth(row)?;
        let Scan { ranges, age_s, time_s } = match report.scan.clone() {
            Some(ranges) => Scan { ranges, age_s: report.scan_age_s, time_s: report.scan_time_s },
            None => report.scans.get(&sensor.name)?.clone(),
        };
        let range = |range: Option<f32>| match range {
            None => f32::INFINITY,
            Some(range) if range < 0.0 => f32::NAN,
            Some(range) => range,
        };
        let taken_ns = now_ns - (age_s.unwrap_or_default() * 1e9) as u64;
        let beam_s = time_s.unwrap_or_default() / ranges.len() as f64;
        let period_s = sensor.every_ticks as f64 / self.stated.robot.rate_hz;
        let limits = [sensor.model.product().least_m, sensor.reach_m];
        let ranges = ranges.into_iter().map(range).collect();
        let header = Header::at(taken_ns, &sensor.name);
        Some(scan(header, sensor.fan().into(), limits, [beam_s, period_s], ranges))
    }
}

/// Encodes active bumpers and cliff sensors, by row names.
fn hazards(touched: &BTreeMap<String, bool>, now_ns: u64) -> Vec<u8> {
    let hazard = |(name, _): (&String, _)| HazardDetection {
        header: Header::at(now_ns, &name.replace('-', "_")),
        r#type: match name.starts_with("cliff") {
            true => HazardDetection::CLIFF,
            false => HazardDetection::BUMP,
        },
    };
    let detections = touched.iter().filter(|(_, feels)| **feels).map(hazard).collect();
    HazardDetectionVector { header: Header::at(now_ns, ""), detections }.encode()
}

#[cfg(test)]
mod tests {

    use common::driver::{Base as _, Driver as _};
    use ros2_driver::Ros2;

    use super::*;

    fn mission() -> Mission {
        let text = "target = [3, 0]\nrobot.model = 'kobuki'\nrobot.rate_hz = 10\nrobot.protocol = 'ros2'\nrobot.address = 'ros2:7'\nrobot.ros2.hazards = '/hazards'\n[[robot.sensor]]\nname = 'laser'\nkind = 'scan'\nforward_m = 0\nbearing_deg = 0\nfield_of_view_deg = 180\nbeams = 3\nreach_m = 4.0";
        Mission::parse(text, "m.toml").unwrap()
    }

    #[test]
    fn reports_that_come_together_were_made_one_after_the_other() {
        let mut program = Program::new(&mission(), 1.0);
        let report = Report { wheels: Some([0.0; 2]), ..Report::default() };
        let mut taken_ms =
            |came_ms: u64| program.taken_ns(&report, came_ms * 1_000_000) / 1_000_000;
        assert_eq!([5000, 5100, 5400, 5400, 5400].map(&mut taken_ms)[..2], [5000, 5100]);
        let apart = [6000, 6000, 6000].map(&mut taken_ms);
        assert!(apart.windows(2).all(|two| (99..170).contains(&(two[1] - two[0]))), "{apart:?}");
        let late = (0..60).map(|tick| 7000 + 100 * tick - taken_ms(7000 + 100 * tick)).last();
        assert!(late.is_some_and(|late| late < 5), "{late:?}");
    }

    #[test]
    fn what_a_simulated_robot_says_in_json_is_heard_over_ros_2_and_a_command_turns_its_wheels() {
        let mission = mission();
        let (mut program, mut driver) = (Program::new(&mission, 1.0), Ros2::new(&mission));
        let topics = Topics::of(&mission).heard;
        let mut say = |report: &Report, now_ns| {
            program.take_wheels(report);
            let said = topics.iter().enumerate().filter_map(|(row, (content, _))| {
                let message = program.message(*content, report, now_ns)?;
                Some(driver.hear(&[&[row as u8][..], &message].concat()))
            });
            said.collect::<Vec<_>>()
        };
        let turned =
            |wheels| Report { wheels: Some(wheels), speeds: Some([1.0, 2.0]), ..Report::default() };
        say(&turned([5.0, 5.0]), 10_000_000_000);
        let report = Report {
            scan: Some(vec![Some(1.5), None, Some(-1.0)]),
            scan_age_s: Some(0.2),
            scan_time_s: Some(0.060_000_1),
            touched: [("bumper-left", true), ("cliff-left", false)]
                .map(|(name, feels)| (name.to_owned(), feels))
                .into(),
            battery_v: Some(14.5),
            ..turned([6.0, 4.5])
        };
        let heard = say(&report, 10_100_000_000);
        let motion = heard.iter().find_map(|it| it.motion).unwrap().wheels;
        let counts = |angle: f64| (angle * 3600.0 / std::f64::consts::TAU).round() as i32;
        assert_eq!(i32::from(motion.left_counts), counts(1.0));
        assert_eq!(i32::from(motion.right_counts) - 32_768, counts(-0.5));
        assert_eq!([motion.left_counts_per_s, motion.right_counts_per_s], [1.0, 2.0].map(counts));
        let scan = heard.iter().find_map(|it| it.scans.first()).unwrap();
        assert_eq!((scan.stamp_ns, scan.sweep.beam_ns / 1000), (Some(9_900_000_000), 20_000));
        assert!(scan.beams[..2] == [1.5, f32::INFINITY] && scan.beams[2].is_nan(), "{scan:?}");
        assert!(
            heard
                .iter()
                .any(|it| it.touched.contains(&(0, true)) && it.touched.contains(&(3, false)))
        );
        assert!(heard.iter().any(|it| it.power.is_some_and(|power| power.motor_v == 14.5)));
        let order = program.order(&driver.velocity([-573, 1146], Duration::ZERO)).unwrap();
        let Order::Drive { wheels, for_s, .. } = order else { panic!("{order:?}") };
        assert!((wheels[0] + 1.0).abs() < 1e-3 && (wheels[1] - 2.0).abs() < 1e-3 && for_s == 0.25);
    }
}
