//! Monitors, their observations, and when a cause applies and clears.

use std::{fmt, time::Duration};

use common::{
    clock::{MissionTime, Pace},
    driver::{Commander, LaserScan, counts::WheelCounts},
    mission::{Mission, Response},
    samples::{Cause, CommandSample, DoubtsSample, HoldReason, Order, RangeReading},
};

#[derive(Clone, Copy, Debug, Default)]
pub struct Moment {
    pub time: MissionTime,
    pub machine_ns: u64,
    /// Whether the link paused before: what it reads now came at an unknown time of the pause.
    pub is_after_pause: bool,
}

#[derive(Clone, Copy, Debug)]
pub enum Observation<'a> {
    Pace(Pace),
    Time,
    Directive(Order, HoldReason),
    /// Operator's resume: faults count as repaired.
    Resumed,
    Command(&'a CommandSample),
    /// Speeds sent to the wheels, counts/s, forward positive.
    Commanded([i16; 2]),
    /// Messages sent, and the further acknowledgements owed.
    Sent(usize),
    Acknowledged,
    /// Motor currents for the next motor frame, AD counts.
    Currents([u16; 2]),
    /// Motor frame with counts that grow forward.
    Motor(WheelCounts, Counts),
    /// Board, motor and servo voltages; 0 if not fitted.
    Batteries([f64; 3]),
    Readings(&'a [RangeReading]),
    /// Scan, and the stated time of its middle beam, mission seconds.
    Scan(&'a LaserScan, f64),
    Touched(&'a [(usize, bool)]),
    /// Found response that differs from the stated one.
    Responds(Response),
    /// Command from a sender other than the link.
    Commander(Commander),
    TwoPublishers(&'a str),
    Found {
        /// Whether it had answered before.
        again: bool,
    },
    Lost,
}

/// Relation of a frame's counts to earlier ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Counts {
    /// The wheels turned by the difference.
    Follow,
    /// The robot restarted; the difference is not motion.
    Restarted {
        /// The robot was silent until now.
        was_away: bool,
    },
    /// An impossible step from which later frames continue; not motion.
    Elsewhere,
    /// An impossible step.
    Implausible,
}

/// Ordered by how recently it held.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Condition {
    Holds,
    /// Time since it held; `Duration::MAX` if unmeasured.
    OverFor(Duration),
}

impl From<bool> for Condition {
    fn from(holds: bool) -> Self {
        if holds { Self::Holds } else { Self::OverFor(Duration::MAX) }
    }
}

#[derive(Clone, Copy, Debug)]
pub enum Clears {
    WithCondition,
    After(Duration),
    /// Clears at an operator's resume after a stop.
    OnResume {
        /// Clears also after the condition was over for this time.
        or_after: Option<Duration>,
    },
    /// Clears with the next mission, in a new process.
    OnNewMission,
}

impl Clears {
    /// Returns whether a cause applies now, if it did so `before`.
    pub fn applies(self, before: bool, condition: Condition) -> bool {
        let Condition::OverFor(over) = condition else {
            return true;
        };
        before
            && match self {
                Self::WithCondition => false,
                Self::After(span) => over < span,
                Self::OnResume { or_after } => or_after.is_none_or(|span| over < span),
                Self::OnNewMission => true,
            }
    }
}

impl fmt::Display for Clears {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::WithCondition => f.write_str("that is over"),
            Self::After(span) => write!(f, "that has been over for {} s", span.as_secs_f64()),
            Self::OnResume { or_after } => {
                f.write_str("`firsthand stop` and `resume`")?;
                or_after.map_or(Ok(()), |span| write!(f, ", or {}", Self::After(span)))
            }
            Self::OnNewMission => f.write_str("the next mission"),
        }
    }
}

pub trait Monitor {
    fn new(mission: &Mission) -> Self
    where
        Self: Sized;

    fn observe(&mut self, what: &Observation<'_>, now: Moment);

    /// Returns whether the condition of `cause`, one of its own, holds.
    fn condition(&self, cause: Cause, now: Moment) -> Condition;

    /// Adds its evidence.
    fn doubt(&self, _doubts: &mut DoubtsSample) {}

    fn explain(&self, _cause: Cause, _now: Moment) -> Option<String> {
        None
    }

    /// Returns whether it judges what the robot's frames say, or when they come. It is then skipped
    /// in lockstep, where a simulated robot is as stated, and while the robot is silent.
    fn judges_frames(&self) -> bool {
        true
    }
}
