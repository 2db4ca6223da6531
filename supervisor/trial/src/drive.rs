//! Drives a log through the link, dead reckoning and the mapper.

use common::{
    clock::{MissionTime, Pace},
    json_wire::{Report, line},
    kinematics::{Pose2, Twist},
    mission::{Mission, MissionError, Sensor},
    samples::{Action, Cause, CommandSample, CommandState, HoldReason, Order, PoseSample},
    stage::Answering as _,
    stop_socket::Request,
};
use dead_reckoning::{DeadReckoning, Sources};
use glam::DVec2;
use link::step::{Effect, Entry, Event, Link, State};
use mapper::step::{Input, Mapper, Scan, Tick};

use crate::{Instant, Log, Said, between, moved};

/// Mission time of the log's first instant.
const BEGINS_NS: u64 = 1_000_000_000;
/// Longest log, seconds. A hostile one states any time.
const LONGEST_S: f64 = 1e9;
/// Interval of the link's turns without input.
const LOOKS_NS: u64 = 20_000_000;
/// Longest pause of a log in which the link takes its turns.
const MOST_LOOKS: u64 = 500;
/// Space around the odometry, metres.
const AROUND_M: f64 = 15.0;

/// Causes that a log's pause has, and then a log that goes on although the link stops it.
const PAUSES: [Cause; 5] = [
    Cause::RobotLost,
    Cause::CommandStale,
    Cause::FramesSilent,
    Cause::RangeSilent,
    Cause::RobotDoesNotStop,
];

/// Result of a driven log. Lists have one element for each scan that the mapper took.
#[derive(Debug)]
pub struct Drive {
    /// Where the robot believes to be, once the scan is matched.
    pub poses: Vec<PoseSample>,
    pub odometry: Vec<Pose2>,
    /// Ranges counter-clockwise, metres.
    pub scans: Vec<Vec<f32>>,
    /// True poses; none without corrected poses.
    pub references: Option<Vec<Pose2>>,
    pub fixes: usize,
    /// Stands of the link's failsafe, except in pauses of the log: seconds since its start, and why.
    pub stands: Vec<(f64, String)>,
    pub laser: Sensor,
    /// Map at the end.
    pub mapper: Mapper,
}

/// Returns the mission of a log's robot, around the places of its odometry.
///
/// # Errors
/// Returns an error if the robot's tables are no valid mission.
pub fn mission(log: &Log) -> Result<Mission, MissionError> {
    let places = || log.instants.iter().map(|it| it.odometry.position);
    let [least, most] = [DVec2::min, DVec2::max].map(|of| places().fold(DVec2::ZERO, of));
    let (centre, size) = ((least + most) / 2.0, most - least);
    let width_m = size.max_element() + 2.0 * AROUND_M;
    let [x, y] = centre.to_array();
    let text = format!(
        "target = [0, 0]\nperimeter.width_m = {width_m:.1}\nperimeter.centre = [{x:.1}, {y:.1}]\n{}",
        log.robot
    );
    Mission::parse(&text, "log.toml")
}

/// Returns what the robot sends at an instant.
fn said(instant: &Instant, speeds: [f64; 2], heard: u64) -> Vec<Vec<u8>> {
    let scan = match &instant.said {
        Said::Pieces(pieces) => return pieces.clone(),
        Said::Line(scan) => scan.as_ref(),
    };
    let Pose2 { position, heading } = instant.odometry;
    let ranges = |scan: &Vec<f32>| scan.iter().map(|range| Some(*range)).collect();
    vec![line(&Report {
        heard: Some(heard),
        odometry: Some([position.x, position.y, heading]),
        speeds: Some(speeds),
        scan: scan.map(ranges),
        ..Report::default()
    })]
}

struct Driver<'a> {
    mission: &'a Mission,
    link: Link,
    reckoning: DeadReckoning,
    mapper: Mapper,
    sources: Sources,
    heard: u64,
    tick: u64,
    now_ns: u64,
    stands: Vec<(f64, String)>,
    /// Newest instant with a scan, the believed poses of those that the mapper took, and their
    /// beams.
    scanned: usize,
    poses: Vec<(usize, PoseSample)>,
    scans: Vec<Vec<f32>>,
    fixes: usize,
}

/// Drives a log by a mission's robot.
pub fn drive(log: &Log, mission: &Mission) -> Option<Drive> {
    let (_, laser) = mission.laser()?;
    let mut link = Link::new(mission);
    link.restore(State { pace: Pace::Rate(1.0), next_tick: 0 });
    let mut driver = Driver {
        mission,
        link,
        reckoning: DeadReckoning::new(mission),
        mapper: Mapper::new(mission),
        sources: Sources::default(),
        heard: 0,
        tick: 0,
        now_ns: BEGINS_NS,
        stands: Vec::new(),
        scanned: 0,
        poses: Vec::new(),
        scans: Vec::new(),
        fixes: 0,
    };
    let first = log.instants.first()?;
    let period_s = 0.5 * mission.robot.rate_hz.recip();
    for (index, instant) in log.instants.iter().enumerate() {
        let since_s = (instant.time_s - first.time_s).min(LONGEST_S);
        driver.wait_until(BEGINS_NS + (since_s * 1e9) as u64);
        if instant.has_scan {
            driver.scanned = index;
        }
        let is_later = |it: &&Instant| it.time_s - instant.time_s >= period_s;
        let next = log.instants.get(index + 1).unwrap_or(instant);
        let later = log.instants[index..].iter().find(is_later).unwrap_or(instant);
        driver.take(instant, next, later);
    }
    let start = first.laser;
    let arm = Pose2 {
        position: laser.mount.forward_m * DVec2::from_angle(laser.mount.bearing_rad),
        heading: 0.0,
    };
    let back = between(arm, Pose2::default());
    let body = |pose: Pose2| moved(arm, moved(between(start, pose), back));
    let Driver { mapper, stands, poses, scans, fixes, .. } = driver;
    let (indices, poses): (Vec<_>, Vec<_>) = poses.into_iter().unzip();
    let instants = || indices.iter().map(|index| &log.instants[*index]);
    let odometry = instants().map(|it| it.odometry).collect();
    let references = log.is_corrected.then(|| instants().map(|it| body(it.laser)).collect());
    Some(Drive { poses, odometry, scans, references, fixes, stands, laser, mapper })
}

impl Driver<'_> {
    fn wait_until(&mut self, until_ns: u64) {
        let looks = (until_ns.saturating_sub(self.now_ns) / LOOKS_NS).min(MOST_LOOKS);
        for look in (0..looks).rev() {
            self.now_ns = until_ns - (look + 1) * LOOKS_NS;
            self.order();
        }
        self.now_ns = until_ns;
    }

    /// Takes an instant, whose robot reports its speeds until `next` and was told those until
    /// `later`.
    fn take(&mut self, instant: &Instant, next: &Instant, later: &Instant) {
        let body = self.mission.body();
        let twist = |to: &Instant| {
            let Pose2 { position, heading } = between(instant.odometry, to.odometry);
            let seconds = (to.time_s - instant.time_s).max(LOOKS_NS as f64 * 1e-9);
            let v = position.length().copysign(position.x) / seconds;
            debug_assert!(v.is_finite());
            Twist { v, omega: heading / seconds }
        };
        self.order();
        let speeds = body.unlimited().wheels(twist(next));
        for piece in said(instant, speeds, self.heard) {
            self.give(Event::Datagram(&piece));
        }
        let told = twist(later);
        let [left_rad_s, right_rad_s] = body.unlimited().wheels(told);
        let mut command = CommandSample {
            left_rad_s,
            right_rad_s,
            v_m_s: told.v,
            omega_rad_s: told.omega,
            pose_ns: self.now_ns,
            guidance_ns: self.now_ns,
            state: CommandState::Driving.into(),
            ..CommandSample::default()
        };
        (command.stamp.tick, command.stamp.stamp_ns) = (self.tick, self.now_ns);
        self.give(Event::Command(command));
        self.give(Event::Quiet);
    }

    /// Lets the link take a turn of a robot that is ordered to drive.
    fn order(&mut self) {
        self.give(Event::Order(Order::Drive, HoldReason::None));
        self.give(Event::Quiet);
    }

    fn give(&mut self, event: Event<'_>) {
        let now = MissionTime(self.now_ns);
        for effect in self.link.step(Entry { event, machine_ns: self.now_ns, now }) {
            match effect {
                Effect::Send(bytes) => {
                    self.heard += bytes.iter().filter(|byte| **byte == b'\n').count() as u64;
                }
                Effect::Tick {
                    tick, ranges, scans, turn, mut wheels, endless, contact, ..
                } => {
                    self.tick = tick;
                    (wheels.stamp.tick, wheels.stamp.stamp_ns) = (tick, now.0);
                    self.sources.turns = turn.into_iter().collect();
                    self.sources.counts = endless.into_iter().collect();
                    self.sources.counts.iter_mut().for_each(|it| it.stamp = wheels.stamp);
                    let mut pose = self.reckoning.answer(&wheels, &self.sources, now).sample;
                    pose.stamp = wheels.stamp;
                    let beams = scans.first().map(|it| it.beams.clone());
                    let scan = |it: common::driver::LaserScan| Scan {
                        row: it.row,
                        beams: it.beams,
                        sweep: it.sweep,
                    };
                    let scans = scans.into_iter().map(scan).collect();
                    let contact = contact.map(|it| *it);
                    let tick = Tick { pose, ranges, scans, contact, ..Tick::default() };
                    self.mapper.step(Input::Tick(tick), now);
                    self.sources.fixes = self.mapper.take_fix().into_iter().collect();
                    if let Some(fix) = self.sources.fixes.last() {
                        self.fixes += 1;
                        (pose.x_m, pose.y_m, pose.heading_rad) =
                            (fix.x_m, fix.y_m, fix.heading_rad);
                        pose.covariance = fix.covariance;
                    }
                    if let Some(beams) = beams {
                        self.poses.push((self.scanned, pose));
                        self.scans.push(beams);
                    }
                }
                Effect::Decided { before, now: decision } => {
                    let stands =
                        decision.action >= Action::Stop && !PAUSES.contains(&decision.cause);
                    if stands && decision.cause != before.cause {
                        let why = self
                            .link
                            .explain(decision.cause, self.now_ns)
                            .unwrap_or_else(|| decision.cause.name().to_owned());
                        let time_s = (self.now_ns - BEGINS_NS) as f64 * 1e-9;
                        self.stands.push((time_s, why));
                        self.resume();
                    }
                }
                _ => {}
            }
        }
    }

    /// Resumes, as an operator does who finds nothing wrong.
    fn resume(&mut self) {
        for request in [Request::Stop, Request::Resume] {
            let now = MissionTime(self.now_ns);
            self.link.step(Entry { event: Event::Operator(request), machine_ns: self.now_ns, now });
        }
    }
}
