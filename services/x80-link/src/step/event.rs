//! What goes into the link and what comes out.

use common::{
    clock::MissionTime,
    samples::{
        CommandSample, HoldReason, InfraredSample, Order, PowerSample, RangeSample,
        SurroundingsSample, WheelSample,
    },
};

use crate::{failsafe::Decision, telemetry::BatteryChange};

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
    /// The supervisor's word, and why it is not drive.
    Order(Order, HoldReason),
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
