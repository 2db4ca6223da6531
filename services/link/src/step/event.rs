//! The link's events and effects.

use common::{
    clock::{MissionTime, Pace},
    driver::{LaserScan, Memory, Refusal},
    inputs,
    samples::{
        BaseResponseSample, CommandSample, ContactSample, CountsSample, HoldReason, InfraredSample,
        Order, PowerSample, RangeReading, SurroundingsSample, TurnSample, WheelSample,
    },
    stop_socket::Request,
};
use serde::{Deserialize, Serialize};

use crate::failsafe::{Decision, battery::BatteryChange};

/// A generation starts from it: the pace of mission time, and its first tick's number, which the supervisor gives because it follows the
/// ticks. The link's checkpoint has only its driver's state of the robot's odometry.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// [`Pace::Max`] is lockstep: the robot waits for each command. At other paces mission time is wall-clock time multiplied by a rate.
    pub pace: Pace,
    pub next_tick: u64,
}

impl Default for State {
    fn default() -> Self {
        Self { pace: Pace::Max, next_tick: 0 }
    }
}

/// What the link takes at once, and when. Recordings hold it in this encoding.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Entry<'a> {
    #[serde(borrow)]
    pub event: Event<'a>,
    /// Reading of the machine's monotonic clock, nanoseconds, which the deadlines of wires use.
    pub machine_ns: u64,
    pub now: MissionTime,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub enum Event<'a> {
    /// Bytes from the robot.
    Datagram(#[serde(with = "serde_bytes")] &'a [u8]),
    /// Whether the wire is open now. A wire counts as open until the first such event. A wire of datagrams is always open.
    Wire(bool),
    /// Bytes on the wire of a sensor, by its number in [`crate::drivers::sensors`].
    Sensor(u8, #[serde(with = "serde_bytes")] &'a [u8]),
    /// Whether the wire of a sensor is open now.
    SensorWire(u8, bool),
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
    /// The driver's state of the link before.
    Remember(Memory),
    /// The process has time to publish the newest telemetry.
    Telemetry,
    /// The process ends.
    End,
}

#[derive(Clone, Debug, PartialEq)]
pub enum Effect {
    Send(Vec<u8>),
    /// To the sensor of this number.
    SendSensor(u8, Vec<u8>),
    /// `ranges` come first, since `wheels` wakes the pipeline.
    Tick {
        tick: u64,
        time: MissionTime,
        ranges: Vec<RangeReading>,
        scans: Vec<LaserScan>,
        /// The turn since the tick before, by the robot's own gyro.
        turn: Option<TurnSample>,
        wheels: WheelSample,
        /// The counts of `wheels` without their cycle, of a robot that has no counter.
        endless: Option<CountsSample>,
        contact: Option<ContactSample>,
        response: Option<Box<BaseResponseSample>>,
    },
    Answered {
        /// The tick's beginning on the monotonic clock, nanoseconds.
        began_ns: u64,
    },
    /// A tick begins beyond the supervisor's limit, which did not rise in time.
    Unlimited {
        tick: u64,
    },
    /// The stops that follow are separate effects.
    Decided {
        before: Decision,
        now: Decision,
    },
    Connected(bool),
    Restarted,
    /// Counts jumped farther than wheels turn, and continue from there.
    CountsElsewhere,
    /// The robot did not stop, so this next method was used.
    StopBy(&'static str),
    /// The base answers otherwise than stated, in these words.
    FoundResponse(String),
    /// A message is none of the protocol, for this reason.
    Refused(Refusal),
    /// The speed of the robot's clock over mission time's.
    ClockRate(f64),
    AskedForStreams,
    Infrared(InfraredSample),
    Power(PowerSample),
    Surroundings(SurroundingsSample),
    Battery(BatteryChange),
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    pub commands: u64,
    pub repeated_commands: u64,
    pub repeated_ticks: u64,
}
