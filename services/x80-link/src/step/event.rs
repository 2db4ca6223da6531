//! The events that the link takes, and the effects that it asks for.

use common::{
    clock::{MissionTime, Pace},
    samples::{
        CommandSample, HoldReason, InfraredSample, Order, PowerSample, RangeSample,
        SurroundingsSample, WheelSample,
    },
};

use serde::{Deserialize, Serialize};

use crate::failsafe::{Decision, battery::BatteryChange, stop_monitor::StopMethod};

/// The pace of mission time, given by the run, and the first tick, given by the supervisor, which follows the ticks; so
/// the link writes no checkpoint.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// [`Pace::Max`] is lockstep: the robot waits for each command. Any other is a wall clock, times a rate.
    pub pace: Pace,
    /// The number of the tick to come.
    pub next_tick: u64,
}

impl Default for State {
    fn default() -> Self {
        Self { pace: Pace::Max, next_tick: 0 }
    }
}

/// An event and its time by the machine's clock, which the deadlines of the wire use.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a> {
    /// The event.
    pub event: Event<'a>,
    /// Reading of the monotonic clock, nanoseconds.
    pub machine_ns: u64,
}

/// An event that the link takes.
#[derive(Clone, Copy, Debug)]
pub enum Event<'a> {
    /// Bytes of the robot.
    Datagram(&'a [u8]),
    /// Whether the wire is open now. It is taken for open at first; a wire of datagrams always is.
    Wire(bool),
    /// A command of the controller.
    Command(&'a CommandSample),
    /// The supervisor's directive: an order, and the reason for not driving.
    Order(Order, HoldReason),
    /// The supervisor's limit in lockstep: the last tick that may begin.
    TickLimit(u64),
    /// Nothing; time passed.
    Quiet,
}

/// An effect that the link asks for.
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
    /// The command of a tick is on its way.
    Answered {
        /// Reading of the monotonic clock at which the tick began, nanoseconds.
        began_ns: u64,
    },
    /// A tick begins beyond the supervisor's limit, which was waited for too long.
    Unlimited {
        /// Its number.
        tick: u64,
    },
    /// The failsafe decides otherwise than before. The stops that follow are effects of their own.
    Decided {
        /// The decision before.
        before: Decision,
        /// The decision now.
        now: Decision,
    },
    /// The robot answers again, or no longer.
    Connected(bool),
    /// The robot restarted its encoder counts.
    Restarted,
    /// The counts jumped farther than wheels turn, and go on from there.
    CountsElsewhere,
    /// The robot does not stop, and was told to by this method.
    StopBy(StopMethod),
    /// The robot was asked for its streams again.
    AskedForStreams,
    /// Publish the infrared rangers.
    Infrared(InfraredSample),
    /// Publish batteries and motor currents.
    Power(PowerSample),
    /// Publish the other sensors.
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
    /// Ticks repeated.
    pub repeated_ticks: u64,
}
