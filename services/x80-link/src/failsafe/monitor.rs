//! Monitors: the observations they take, and when a cause applies and clears.

use std::{fmt, time::Duration};

use common::{
    clock::{MissionTime, Pace},
    mission::Mission,
    samples::{Cause, CommandSample, HoldReason, Order},
    wire::StandardSensors,
};

/// The two clocks at one moment.
#[derive(Clone, Copy, Debug, Default)]
pub struct Moment {
    /// Mission time.
    pub time: MissionTime,
    /// Reading of the machine's monotonic clock, nanoseconds.
    pub machine_ns: u64,
}

/// Something that happened on the link.
#[derive(Clone, Copy, Debug)]
pub enum Observation<'a> {
    /// Mission time passes at this pace from now on.
    Pace(Pace),
    /// Time has passed.
    Time,
    /// The supervisor published a directive.
    Directive(Order, HoldReason),
    /// An operator lets the robot go on: what was wrong counts as repaired.
    Resumed,
    /// The controller published a newer command.
    Command(&'a CommandSample),
    /// The wheels were sent these counts/s, forward positive.
    Commanded([i16; 2]),
    /// Something was sent to the robot.
    Sent,
    /// The robot acknowledged something.
    Acknowledged,
    /// A motor frame came, with these counts of the wheels, growing forward.
    Motor([u16; 2], Counts),
    /// A standard frame came.
    Standard(&'a StandardSensors),
    /// The robot answers, and was asked for its streams.
    Found {
        /// It had been lost before.
        again: bool,
    },
    /// The robot does not answer.
    Lost,
}

/// How the counts of a frame relate to those before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Counts {
    /// The wheels turned by the difference since the frame before.
    Follow,
    /// The robot restarted: the difference is no motion.
    Restarted {
        /// It did not answer until now.
        was_away: bool,
    },
    /// Wheels cannot have turned so far, but later frames follow these counts: the difference is no motion.
    Elsewhere,
    /// Wheels cannot have turned so far.
    Implausible,
}

/// Whether the condition of a cause holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Condition {
    /// It holds.
    Holds,
    /// It has not held for so long; `Duration::MAX` if that is not measured.
    OverFor(Duration),
}

impl From<bool> for Condition {
    fn from(holds: bool) -> Self {
        if holds { Self::Holds } else { Self::OverFor(Duration::MAX) }
    }
}

/// When a cause that applied applies no longer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clears {
    /// When its condition is over.
    WithCondition,
    /// When its condition has been over for so long.
    After(Duration),
    /// When an operator resumes after a stop, or when its condition has been over for so long, if a time is given.
    OnResume {
        /// How long it must have been over.
        or_after: Option<Duration>,
    },
    /// With the next mission, in a new process.
    OnNewMission,
}

impl Clears {
    /// Whether a cause applies now that did or did not apply before.
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

/// Watches for the conditions of one cause or several.
pub trait Monitor {
    /// A monitor of the robot of `mission`, of which nothing is known.
    fn new(mission: &Mission) -> Self
    where
        Self: Sized;

    /// Take note of what happened.
    fn observe(&mut self, what: &Observation<'_>, now: Moment);

    /// Whether the condition of `cause`, one of its own, holds.
    fn condition(&self, cause: Cause, now: Moment) -> Condition;

    /// An explanation with what was seen, and a remedy.
    fn explain(&self, cause: Cause, now: Moment) -> Option<String> {
        let _ = (cause, now);
        None
    }

    /// Whether it judges the robot's frames by their time. It is then not asked while the robot does not answer, nor in
    /// lockstep.
    fn judges_frames(&self) -> bool {
        true
    }
}
