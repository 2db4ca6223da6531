//! Monitors: the observations they take, and when a cause applies and clears.

use std::{fmt, time::Duration};

use common::{
    clock::{MissionTime, Pace},
    driver::{Commander, LaserScan, counts::WheelCounts},
    mission::{Mission, Response},
    samples::{Cause, CommandSample, HoldReason, Order, RangeReading},
};

#[derive(Clone, Copy, Debug, Default)]
pub struct Moment {
    pub time: MissionTime,
    /// Reading of the machine's monotonic clock, nanoseconds.
    pub machine_ns: u64,
}

#[derive(Clone, Copy, Debug)]
pub enum Observation<'a> {
    Pace(Pace),
    Time,
    Directive(Order, HoldReason),
    /// An operator resumed the robot, so faults count as repaired.
    Resumed,
    Command(&'a CommandSample),
    /// A command with these speeds was sent to the wheels, counts/s, forward positive.
    Commanded([i16; 2]),
    Sent,
    /// The robot owes so many acknowledgements for what was sent.
    Owed(usize),
    Acknowledged,
    /// The motor currents of the wheels in the motor frame that follows, AD counts.
    Currents([u16; 2]),
    /// A motor frame came, with these counts of the wheels, growing forward.
    Motor(WheelCounts, Counts),
    /// The voltages of the batteries of the boards, the motors and the servos came; 0 for a battery that is not fitted.
    Batteries([f64; 3]),
    Readings(&'a [RangeReading]),
    /// A scan came that says it was measured at this mission time, seconds, in the middle of its beams.
    Scan(&'a LaserScan, f64),
    /// Rows of bumpers and cliff sensors, and whether they feel something.
    Touched(&'a [(usize, bool)]),
    /// The base responds so, and not as it is stated to.
    Responds(Response),
    /// A sender other than the link told the robot something.
    Commander(Commander),
    TwoPublishers(&'a str),
    /// The robot answers again or for the first time, and was asked for its streams.
    Found {
        /// Whether it had answered before.
        again: bool,
    },
    Lost,
}

/// The relation of a frame's counts to the counts before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Counts {
    /// The wheels turned by the difference since the frame before.
    Follow,
    /// The robot restarted: the difference is no motion.
    Restarted {
        /// Whether the robot did not answer until this frame.
        was_away: bool,
    },
    /// The wheels cannot have turned so far, but later frames continue from these counts: the difference is no motion.
    Elsewhere,
    /// The wheels cannot have turned so far.
    Implausible,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Condition {
    Holds,
    /// The condition has not held for so long; `Duration::MAX` if that is not measured.
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
    /// The cause clears when an operator resumes the robot after a stop; if a time is given, also when its condition has been over for
    /// so long.
    OnResume {
        /// The time for which the condition must have been over.
        or_after: Option<Duration>,
    },
    /// The cause clears with the next mission, in a new process.
    OnNewMission,
}

impl Clears {
    /// Whether a cause applies now; `before` says whether it applied until now.
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

/// Observes the link and says whether the conditions of its causes hold.
pub trait Monitor {
    /// A monitor of the robot of `mission` that has observed nothing yet.
    fn new(mission: &Mission) -> Self
    where
        Self: Sized;

    fn observe(&mut self, what: &Observation<'_>, now: Moment);

    /// Whether the condition of `cause` holds, which must be one of its causes.
    fn condition(&self, cause: Cause, now: Moment) -> Condition;

    /// An explanation with the observed values, and a remedy.
    fn explain(&self, cause: Cause, now: Moment) -> Option<String> {
        let _ = (cause, now);
        None
    }

    /// Whether the monitor judges the robot's frames by their time. Such a monitor is not asked in lockstep, nor while the robot does
    /// not answer.
    fn judges_frames(&self) -> bool {
        true
    }
}
