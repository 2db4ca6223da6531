//! Events and effects of the link.

use common::{
    clock::{MissionClock, MissionTime, Pace},
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

/// Start of a generation. The supervisor gives the first tick's number, because it follows the
/// ticks. The link's checkpoint holds only its driver's odometry state.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// [`Pace::Max`] is lockstep: the robot waits for each command. Otherwise mission time is
    /// wall-clock time multiplied by a rate.
    pub pace: Pace,
    pub next_tick: u64,
}

impl State {
    pub(crate) const fn new(clock: MissionClock, next_tick: u64) -> Self {
        let pace = match clock {
            MissionClock::Ticks { .. } => Pace::Max,
            MissionClock::Wall { rate, .. } => Pace::Rate(rate),
        };
        Self { pace, next_tick }
    }
}

impl Default for State {
    fn default() -> Self {
        Self { pace: Pace::Max, next_tick: 0 }
    }
}

/// Event with its times, as recorded.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Entry<'a> {
    #[serde(borrow)]
    pub event: Event<'a>,
    /// Machine's monotonic clock, for the deadlines of wires.
    pub machine_ns: u64,
    pub now: MissionTime,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub enum Event<'a> {
    Datagram(#[serde(with = "serde_bytes")] &'a [u8]),
    /// Whether the wire is open, as it is until the first such event. Datagram wires always are.
    Wire(bool),
    /// Bytes from a sensor, by its number in [`crate::drivers::sensors`].
    Sensor(u8, #[serde(with = "serde_bytes")] &'a [u8]),
    SensorWire(u8, bool),
    Command(#[serde(with = "inputs::sample")] CommandSample),
    Order(Order, HoldReason),
    /// Supervisor's limit in lockstep: last tick allowed, and current target.
    TickLimit {
        last_tick: u64,
        target_number: u64,
    },
    /// Time passed without input.
    Quiet,
    Operator(Request),
    /// Driver state of the previous link.
    Remember(Memory),
    Telemetry,
    End,
}

#[derive(Clone, Debug, PartialEq)]
pub enum Effect {
    Send(Vec<u8>),
    SendSensor(u8, Vec<u8>),
    /// Start of a tick. `ranges` come first, since `wheels` wakes the pipeline.
    Tick {
        tick: u64,
        time: MissionTime,
        ranges: Vec<RangeReading>,
        scans: Vec<LaserScan>,
        turn: Option<TurnSample>,
        wheels: WheelSample,
        /// Unwrapped counts of a robot without a counter.
        endless: Option<CountsSample>,
        contact: Option<Box<ContactSample>>,
        response: Option<Box<BaseResponseSample>>,
    },
    Answered {
        /// Start on the monotonic clock, nanoseconds.
        began_ns: u64,
    },
    /// Tick begun beyond the supervisor's limit, which did not rise in time.
    Unlimited {
        tick: u64,
    },
    Decided {
        before: Decision,
        now: Decision,
    },
    Connected(bool),
    Restarted,
    /// Counts that continue after an impossible jump.
    CountsElsewhere,
    StopBy(&'static str),
    FoundResponse(String),
    Refused(Refusal),
    /// Robot clock relative to mission time.
    ClockRate(f64),
    AskedForStreams,
    Infrared(InfraredSample),
    Power(PowerSample),
    Surroundings(SurroundingsSample),
    Battery(BatteryChange),
}
