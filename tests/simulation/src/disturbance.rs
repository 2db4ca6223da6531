//! What a simulation does to a run, each at its time.

use std::{fmt, time::Duration};

use common::{
    bus::{Bus, BusError},
    clock::{MissionTime, monotonic_ns},
    samples::{MOST_TARGETS, RequestKind, RequestSample, TargetPoint},
    topics,
};

use crate::{
    load::Load,
    robot_fault::RobotFault,
    wire::{Quality, Way},
};

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
    Load(Load),
    Ask(Request),
    /// The robot becomes faulty, or is healthy again.
    Fault(Option<RobotFault>),
    /// Ends the simulation.
    End,
}

/// Operator's request.
#[derive(Clone, Copy, Debug)]
pub enum Request {
    Stop,
    Resume,
    Goto([f64; 2]),
    Append([f64; 2]),
    Restart(&'static str),
}

impl Request {
    pub(crate) fn publish(self, bus: &Bus) -> Result<(), BusError> {
        let target = |[x, y]: [f64; 2]| {
            let mut points = [TargetPoint::default(); MOST_TARGETS];
            points[0] = TargetPoint::at(glam::DVec2::new(x, y));
            points
        };
        let (kind, points, count) = match self {
            Self::Stop => (RequestKind::Stop, None, 0),
            Self::Resume => (RequestKind::Resume, None, 0),
            Self::Goto(at) => (RequestKind::Goto, Some(target(at)), 1),
            Self::Append(at) => (RequestKind::Append, Some(target(at)), 1),
            Self::Restart(_) => (RequestKind::Restart, None, 0),
        };
        let stage = match self {
            Self::Restart(stage) => common::samples::name(stage),
            _ => Default::default(),
        };
        let sample = RequestSample {
            id: monotonic_ns() | 1,
            asked_ns: monotonic_ns(),
            kind: kind.into(),
            stage,
            targets: points.unwrap_or_default(),
            target_count: count,
            ..RequestSample::default()
        };
        bus.writer(&topics::REQUESTS, 1)?.publish(0, MissionTime::default(), sample)
    }
}

impl fmt::Display for Disturbance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.6} s: {:?}", self.at.as_secs_f64(), self.what)
    }
}
