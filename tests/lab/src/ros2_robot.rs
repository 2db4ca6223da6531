//! A simulated robot that speaks lines of JSON, as a robot of ROS 2: a thread is the simulated robot's host and publishes and subscribes
//! for it. Its traffic stays on this machine.
//!
//! It computes odometry as a robot's own program does: from the wheels' angles, by the sizes that the mission states, whatever those of
//! the simulated robot are. A robot that is told nothing stands after [`WATCHDOG_S`], which the simulated robot sees to.

use std::{
    io,
    net::{Ipv4Addr, SocketAddr, UdpSocket},
    os::fd::AsFd as _,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering::Relaxed},
    },
    thread::JoinHandle,
    time::{Duration, Instant},
};

use common::{
    clock::monotonic_ns,
    driver::odometry::drive,
    json_wire::{Lines, Order, Report, Scan, line, parse},
    kinematics::{DifferentialDrive, Pose2, Twist, WheelSpeeds},
    mission::Mission,
    poll,
};
use ros2::{
    cdr,
    messages::{Header, battery, odometry, scan},
    participant::{Participant, Quality, Reader, Writer},
};
use ros2_driver::topics::{Content, Topics};

use crate::error::{OrCannot as _, Result};

const WATCHDOG_S: f64 = 0.25;
/// Longest wait until the thread sees that it ends.
const LOOK: Duration = Duration::from_millis(50);
/// A simulated robot that said nothing for so long is greeted, again if need be.
const SILENT: Duration = Duration::from_secs(1);
const MOST_COMMANDS: usize = 16;
const RELIABLE: Quality = Quality { is_reliable: true, is_latched: false, depth: 10 };
/// The type of a bumper's and a cliff sensor's hazard.
const HAZARDS: [u8; 2] = [1, 2];

/// What a mission of the robot states beside its other keys.
pub fn keys(domain: u16) -> [String; 3] {
    let address = format!("robot.address='ros2:{domain}'");
    ["robot.protocol='ros2'".to_owned(), address, "robot.ros2.hazards='/hazards'".to_owned()]
}

/// The domain of robot `number` of this process: ports of greater ones are those of other sockets, too.
pub fn domain(number: u64) -> u16 {
    1 + ((u64::from(std::process::id()) + number) % 99) as u16
}

#[derive(Debug)]
pub struct Ros2Robot {
    ends: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Ros2Robot {
    /// Speak for the simulated robot at `robot` in `domain`, by the topics and the sizes of `stated`. Its odometry turns `turns` times as
    /// far as the wheels do.
    pub fn start(robot: SocketAddr, stated: &Mission, domain: u16, turns: f64) -> Result<Self> {
        let mut node =
            Node::new(robot, stated, domain, turns).or_cannot("start a node of ROS 2")?;
        let ends = Arc::new(AtomicBool::new(false));
        let is_over = ends.clone();
        let thread = std::thread::spawn(move || {
            while !is_over.load(Relaxed) {
                // A datagram that cannot be sent is lost, as on a serial line.
                let _ = node.turn();
            }
        });
        Ok(Self { ends, thread: Some(thread) })
    }
}

impl Drop for Ros2Robot {
    fn drop(&mut self) {
        self.ends.store(true, Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

struct Node {
    wire: UdpSocket,
    lines: Lines,
    heard: Option<Instant>,
    commands: Reader,
    writers: Vec<(Content, Writer)>,
    stated: Mission,
    drive: DifferentialDrive,
    turns: f64,
    pose: Pose2,
    /// The newest angles of the wheels.
    wheels: Option<WheelSpeeds>,
    participant: Participant,
}

impl Node {
    fn new(robot: SocketAddr, stated: &Mission, domain: u16, turns: f64) -> io::Result<Self> {
        let wire = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
        wire.connect(robot)?;
        wire.set_nonblocking(true)?;
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
            stated: stated.clone(),
            drive: drive(&stated.body()),
            turns,
            pose: Pose2::default(),
            wheels: None,
            participant,
        })
    }

    fn turn(&mut self) -> io::Result<()> {
        if self.heard.is_none_or(|heard| heard.elapsed() > SILENT) {
            self.heard = Some(Instant::now());
            self.wire.send(&line(&Order::Hello { rate_hz: self.stated.robot.rate_hz }))?;
        }
        poll::readable(&[self.wire.as_fd(), self.participant.as_fd()], Some(LOOK))?;
        self.participant.unring();
        for message in self.commands.messages().take(MOST_COMMANDS) {
            let twist = cdr::Reader::new(&message.payload).and_then(|mut it| it.f64s::<6>());
            if let Ok([v, .., omega]) = twist {
                let WheelSpeeds { right, left } = self.drive.wheels(Twist { v, omega });
                let (wheels, twist) = ([left, right], [v, omega]);
                self.wire.send(&line(&Order::Drive { wheels, twist, for_s: WATCHDOG_S }))?;
            }
        }
        let mut buffer = [0; 65_536];
        while let Ok(length) = self.wire.recv(&mut buffer) {
            self.heard = Some(Instant::now());
            for report in self.lines.push(&buffer[..length]) {
                parse(&report).into_iter().for_each(|report| self.publish(&report));
            }
        }
        Ok(())
    }

    /// Publish what the robot said just now.
    fn publish(&mut self, report: &Report) {
        let now_ns = monotonic_ns();
        let speeds = self.moved(report);
        let Pose2 { position, heading } = self.pose;
        let pose = [position.x, position.y, heading];
        for (content, writer) in &self.writers {
            let message = match content {
                Content::Odometry => speeds
                    .map(|speeds| odometry(Header(now_ns, "odom"), "base_footprint", pose, speeds)),
                Content::Scan(row) => self.scan(*row, report, now_ns),
                Content::Battery => {
                    report.battery_v.map(|volts| battery(Header(now_ns, ""), volts))
                }
                Content::Hazards => self.hazards(report, now_ns),
                _ => None,
            };
            message.into_iter().for_each(|message| _ = writer.write(message));
        }
    }

    /// Take the wheels' angles into the pose. Returns the speeds, m/s and rad/s; none without wheels.
    fn moved(&mut self, report: &Report) -> Option<[f64; 2]> {
        let both = |[left, right]: [f64; 2]| WheelSpeeds { right, left };
        let (now, speeds) = (both(report.wheels?), both(report.speeds?));
        let before = self.wheels.replace(now).unwrap_or(now);
        let turned = both([now.left - before.left, now.right - before.right]);
        let Twist { v: arc, omega: turn } = self.drive.twist(turned);
        self.pose = self.pose.along_arc(arc, self.turns * turn);
        let Twist { v, omega } = self.drive.twist(speeds);
        Some([v, self.turns * omega])
    }

    fn scan(&self, row: usize, report: &Report, now_ns: u64) -> Option<Vec<u8>> {
        let sensor = self.stated.sensor_table().into_iter().nth(row)?;
        let only = report.scan.clone().map(|ranges| Scan {
            ranges,
            age_s: report.scan_age_s,
            time_s: report.scan_time_s,
        });
        let Scan { ranges, age_s, time_s } =
            only.or_else(|| report.scans.get(&sensor.name).cloned())?;
        let range = |range: &Option<f32>| match *range {
            None => f32::INFINITY,
            Some(range) if range < 0.0 => f32::NAN,
            Some(range) => range,
        };
        let taken_ns = now_ns - (age_s.unwrap_or_default() * 1e9) as u64;
        let beam_s = time_s.unwrap_or_default() / ranges.len() as f64;
        let period_s = sensor.every_ticks as f64 / self.stated.robot.rate_hz;
        let limits = [sensor.model.least_m(), sensor.reach_m];
        let ranges: Vec<_> = ranges.iter().map(range).collect();
        Some(scan(
            Header(taken_ns, &sensor.name),
            sensor.fan().into(),
            limits,
            [beam_s, period_s],
            &ranges,
        ))
    }

    /// An `irobot_create_msgs/HazardDetectionVector` of what bumpers and cliff sensors feel.
    fn hazards(&self, report: &Report, now_ns: u64) -> Option<Vec<u8>> {
        let feels = report.touched.iter().filter(|(_, feels)| **feels);
        let feels: Vec<_> = feels.map(|(name, _)| name.replace('-', "_")).collect();
        let mut message = cdr::Writer::default();
        message.header(now_ns, "").list(feels, |message, frame| {
            message.header(now_ns, &frame).u8(HAZARDS[usize::from(frame.starts_with("cliff"))]);
        });
        (!report.touched.is_empty()).then(|| message.take())
    }
}
