//! What a simulation does to a run, each at its time.

use std::{fmt, time::Duration};

use common::{
    bus::{Bus, BusError},
    clock::{MissionTime, monotonic_ns},
    kinematics::Pose2,
    samples::{
        BeaconSample, FaultKind, FaultSample, RequestKind, RequestSample, TargetPoint, name,
    },
    topics,
};

use crate::{
    robot_fault::RobotFault,
    wire::{Quality, Way},
};

/// Half the side of a zone, metres.
const ZONE_M: f64 = 0.2;
/// Stated deviations of a placed robot, metres and radians.
const PLACED: [f64; 2] = [0.05; 2];

#[derive(Clone, Debug)]
pub struct Disturbance {
    /// Time since the machine's start.
    pub at: Duration,
    pub what: What,
}

#[derive(Clone, Debug)]
pub enum What {
    /// Kills a stage between two turns.
    Kill(&'static str),
    /// Kills a stage after so many publications, readings and writes.
    KillAfter(&'static str, u32),
    /// Kills the supervisor after so many.
    KillSupervisor(u32),
    /// Stops a stage's process, until [`What::Thaw`].
    Freeze(&'static str),
    Thaw(&'static str),
    /// A stage computes without end.
    Hang(&'static str),
    Wire(Way, Quality),
    Ask(Request),
    /// Injects a fault into a stage.
    Break(&'static str, FaultKind),
    /// The followed beacon says its place.
    Beacon([f64; 2]),
    /// The robot becomes faulty, or is healthy again.
    Fault(Option<RobotFault>),
    /// Ends the simulation.
    End,
}

/// Operator's request.
#[derive(Clone, Copy, Debug)]
pub enum Request {
    Stop,
    /// A stop asked before all else, of which the supervisor hears only now.
    LateStop,
    Resume,
    Goto([f64; 2]),
    Append([f64; 2]),
    Restart(&'static str),
    /// Pushes the joystick ahead and to the left.
    Hand([f64; 2]),
    Follow,
    EndFollow,
    /// Says that the robot is where it is.
    Place,
    /// Adds a square zone around this place.
    AddZone([f64; 2]),
    RemoveZone([f64; 2]),
}

impl Request {
    pub(crate) fn publish(self, bus: &Bus, here: Pose2) -> Result<(), BusError> {
        let target = |at: [f64; 2]| vec![TargetPoint::at(at.into())];
        let (id, asked_ns) = (monotonic_ns() | 1, monotonic_ns());
        let mut sample = RequestSample { id, asked_ns, ..RequestSample::default() };
        let mut points = Vec::new();
        let kind = match self {
            Self::Stop => RequestKind::Stop,
            Self::LateStop => {
                sample.asked_ns = 1;
                RequestKind::Stop
            }
            Self::Resume => RequestKind::Resume,
            Self::Goto(at) => {
                points = target(at);
                RequestKind::Goto
            }
            Self::Append(at) => {
                points = target(at);
                RequestKind::Append
            }
            Self::Restart(stage) => {
                sample.stage = name(stage);
                RequestKind::Restart
            }
            Self::Hand(stick) => {
                points = target(stick);
                RequestKind::Hand
            }
            Self::Follow => RequestKind::Follow,
            Self::EndFollow => RequestKind::EndFollow,
            Self::Place => {
                sample.deviations = PLACED;
                points = target(here.position.into());
                points[0].heading_rad = here.heading;
                RequestKind::Place
            }
            Self::AddZone([x, y]) => {
                let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
                let at = |(right, up)| [x + ZONE_M * right, y + ZONE_M * up];
                points = corners.map(at).into_iter().flat_map(target).collect();
                RequestKind::AddZone
            }
            Self::RemoveZone(at) => {
                points = target(at);
                RequestKind::RemoveZone
            }
        };
        sample.kind = kind.into();
        sample.target_count = points.len() as u8;
        sample.targets[..points.len()].copy_from_slice(&points);
        bus.writer(&topics::REQUESTS, 1)?.publish(0, MissionTime::default(), sample)
    }
}

/// Breaks a stage of any robot.
pub fn inject(bus: &Bus, stage: &str, kind: FaultKind) -> Result<(), BusError> {
    let (id, stage, kind) = (monotonic_ns() | 1, name(stage), kind.into());
    let sample = FaultSample { id, stage, kind, although_real: 1, ..FaultSample::default() };
    bus.writer(&topics::FAULTS, 1)?.publish(0, MissionTime::default(), sample)
}

pub fn say_beacon(bus: &Bus, [x_m, y_m]: [f64; 2]) -> Result<(), BusError> {
    let pose = bus.reader(&topics::POSE)?.newest()?.unwrap_or_default();
    let (capture_ns, source, deviation_m) = (pose.stamp.stamp_ns, name("walker"), 0.02);
    let sample = BeaconSample { capture_ns, source, x_m, y_m, deviation_m, ..Default::default() };
    bus.writer(&topics::BEACON, 1)?.publish(pose.stamp.tick, pose.stamp.time(), sample)
}

impl fmt::Display for Disturbance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.6} s: {:?}", self.at.as_secs_f64(), self.what)
    }
}
