//! The events that the link takes, and the effects that it asks for.

use common::{
    clock::{MissionTime, Pace},
    inputs,
    samples::{
        CommandSample, ContactSample, HoldReason, InfraredSample, Order, PowerSample, RangeReading,
        SurroundingsSample, TurnSample, WheelSample,
    },
    stop_socket::Request,
};
use serde::{Deserialize, Serialize};

use crate::failsafe::{Decision, battery::BatteryChange};

/// The state from which a generation starts: the pace of mission time and the number of its first tick. The supervisor gives the number,
/// because it follows the ticks. The link's checkpoint has only its driver's state of the robot's odometry.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// The pace of mission time. [`Pace::Max`] is lockstep, in which the robot waits for each command. At any other pace mission time is
    /// wall-clock time multiplied by a rate.
    pub pace: Pace,
    /// The number of the next tick.
    pub next_tick: u64,
}

impl Default for State {
    fn default() -> Self {
        Self { pace: Pace::Max, next_tick: 0 }
    }
}

/// An event that the link takes. Recordings hold it in this encoding.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub enum Event<'a> {
    /// Bytes from the robot.
    Datagram(#[serde(with = "serde_bytes")] &'a [u8]),
    /// Whether the wire is open now. A wire counts as open until the first such event. A wire of datagrams is always open.
    Wire(bool),
    /// A command from the controller.
    Command(#[serde(with = "inputs::sample")] CommandSample),
    /// The supervisor's directive: an order, and the reason for not driving.
    Order(Order, HoldReason),
    /// The supervisor's limit in lockstep: the last tick that may begin, and the number of the current target.
    TickLimit { last_tick: u64, target_number: u64 },
    /// Time passed without input.
    Quiet,
    /// An operator's request at the link.
    Operator(Request),
}

/// An effect that the link asks for.
#[derive(Clone, Debug, PartialEq)]
pub enum Effect {
    /// Send these bytes to the robot.
    Send(Vec<u8>),
    /// Publish the tick: `ranges` first, since `wheels` wakes the pipeline.
    Tick {
        /// The number of the tick.
        tick: u64,
        /// Mission time of the tick.
        time: MissionTime,
        /// The newest reading of each sensor.
        ranges: Vec<RangeReading>,
        /// The beams of the laser; none if none came.
        scan: Vec<f32>,
        /// The turn of the robot since the tick before, by its own gyro.
        turn: Option<TurnSample>,
        /// The encoders.
        wheels: WheelSample,
        /// The contact that these encoders show.
        contact: Option<ContactSample>,
    },
    /// The command of a tick was sent.
    Answered {
        /// Reading of the monotonic clock at which the tick began, nanoseconds.
        began_ns: u64,
    },
    /// A tick begins beyond the supervisor's limit, because the limit did not rise in time.
    Unlimited {
        /// The number of the tick.
        tick: u64,
    },
    /// The failsafe's decision changed. The stops that follow are separate effects.
    Decided {
        /// The decision before.
        before: Decision,
        /// The decision now.
        now: Decision,
    },
    /// The robot answers now, or no longer.
    Connected(bool),
    /// The robot restarted its encoder counts.
    Restarted,
    /// The counts jumped farther than wheels turn, and continue from there.
    CountsElsewhere,
    /// The robot does not stop, so the next method was used, which has this name.
    StopBy(&'static str),
    /// A message of the robot is none of the protocol, for this reason.
    Refused(String),
    /// The ratio of the speed of the robot's clock to that of mission time.
    ClockRate(f64),
    /// The robot was asked for its streams again.
    AskedForStreams,
    /// Publish the infrared rangers.
    Infrared(InfraredSample),
    /// Publish batteries and motor currents.
    Power(PowerSample),
    /// Publish the other sensors.
    Surroundings(SurroundingsSample),
    /// The charge of a battery changed.
    Battery(BatteryChange),
}

/// The counts of the `link` topic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// The velocity commands that were sent.
    pub commands: u64,
    /// The velocity commands that were sent again.
    pub repeated_commands: u64,
    /// The ticks that were repeated.
    pub repeated_ticks: u64,
}
