//! What goes into the link and what comes out.

use common::{
    clock::{MissionTime, Pace},
    samples::{
        CommandSample, HoldReason, InfraredSample, Order, PowerSample, RangeSample,
        SurroundingsSample, WheelSample,
    },
};

use serde::{Deserialize, Serialize};

use crate::failsafe::{Decision, battery::BatteryChange, stop_monitor::StopMethod};

/// How mission time passes, and where the ticks of this link begin. The run says the one, and the supervisor the other:
/// it hears the ticks, so the link writes no checkpoint.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// [`Pace::Max`] is lockstep: the robot waits for each command. Any other is a wall clock, times a rate.
    pub pace: Pace,
    /// The number of the tick to come.
    pub next_tick: u64,
}

impl Default for State {
    fn default() -> Self {
        Self {
            pace: Pace::Max,
            next_tick: 0,
        }
    }
}

/// What happened, and when by the machine's clock, which the deadlines of the wire go by.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a> {
    /// What.
    pub event: Event<'a>,
    /// Reading of the monotonic clock, nanoseconds.
    pub machine_ns: u64,
}

/// What happened.
#[derive(Clone, Copy, Debug)]
pub enum Event<'a> {
    /// Bytes of the robot.
    Datagram(&'a [u8]),
    /// Whether the wire is open now. One of datagrams always is, and it is taken for open until this says
    /// otherwise.
    Wire(bool),
    /// A command of the controller.
    Command(&'a CommandSample),
    /// The supervisor's directive: what it orders, and why that is not drive.
    Order(Order, HoldReason),
    /// The last tick that may begin, by the supervisor's word; in lockstep.
    TickLimit(u64),
    /// Nothing; time passed.
    Quiet,
}

/// What to do about it.
#[derive(Clone, Debug, PartialEq)]
pub enum Effect {
    /// Send these bytes to the robot.
    Send(Vec<u8>),
    /// Publish the tick: `range` first, since `wheels` wakes the pipeline.
    Tick {
        /// Its number.
        tick: u64,
        /// Its mission time.
        time: MissionTime,
        /// The newest sonar reading.
        range: RangeSample,
        /// The encoders.
        wheels: WheelSample,
    },
    /// The command of the tick that began at this reading of the monotonic clock is on its way.
    Answered {
        /// Nanoseconds.
        began_ns: u64,
    },
    /// A tick begins without the supervisor's word, which was waited for too long.
    Unlimited {
        /// Its number.
        tick: u64,
    },
    /// The failsafe decides otherwise than before; what follows from that comes as effects of its own.
    Decided {
        /// What it decided before.
        before: Decision,
        /// What it decides now.
        now: Decision,
    },
    /// The robot answers again, or no longer.
    Connected(bool),
    /// The robot restarted its encoder counts.
    Restarted,
    /// The counts jumped farther than wheels turn, and now follow each other where they are.
    CountsElsewhere,
    /// The robot does not stand, and was told to by these means.
    StopBy(StopMethod),
    /// The robot was asked for its streams again.
    AskedForStreams,
    /// Publish what an infrared frame said.
    Infrared(InfraredSample),
    /// Publish what the batteries and motors said.
    Power(PowerSample),
    /// Publish what the other sensors said.
    Surroundings(SurroundingsSample),
    /// A battery became low or empty, or is no longer.
    Battery(BatteryChange),
}

/// Counts for the `link` topic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Velocity commands sent.
    pub commands: u64,
    /// Velocity commands sent again.
    pub repeated_commands: u64,
    /// Ticks given again.
    pub repeated_ticks: u64,
}
