//! THE table of topics: what the processes publish for each other.
//!
//! Services are created from it, the guide's list is printed from it (`firsthand topic list`), the stages' table is
//! checked against it, and writers take from it how often they publish again. A topic is declared once, below, and
//! named nowhere else.

use std::time::Duration;

use crate::{
    mission::{MOST_BEAMS, MOST_CORNERS, MOST_SENSORS, MOST_ZONES},
    samples::*,
};

pub use crate::bus::{
    AnyTopic, EVERY_STAGE, Limits, Logged, OPERATOR, Rate, SUPERVISOR, Spec, Topic,
};

/// How often the supervisor publishes its order and the roster again, for consumers that joined later.
pub const RESTATE: Duration = Duration::from_millis(200);
/// Heartbeats are farther apart than ticks at 7 Hz, so a stage that answers ticks beats with them and need not wake for a
/// beat alone. Five of them fit in the tightest deadline of a heartbeat.
const BEAT: Duration = Duration::from_millis(150);
/// The link is published so often while no ticks come, so that `firsthand status` is up to date.
const LINK_AGAIN: Duration = Duration::from_millis(100);

/// The field is for displays and recorders; no stage waits for it. In mission time.
const FIELD_RATE: Rate = Rate::OnChange {
    at_most_every: Duration::from_millis(250),
    again_after: Duration::from_secs(1),
};

/// A recorder that was not scheduled for long still learns of each generation from the rosters that wait for it.
const ROSTERS: Limits = Limits { buffer: Limits::MAP.recorder_buffer, ..Limits::MAP };

/// The memory for the most beams is that of 1,024 small scans: a recorder that is not scheduled for 1.6 s loses none of one laser at
/// 40 Hz.
const SCANS: Limits = Limits { buffer: 16, recorder_buffer: 64, ..Limits::slices(MOST_BEAMS) };

/// The most bytes of a `wire` sample; longer data take several.
pub const WIRE_PIECE: usize = 2048;
const WIRE_PIECES: Limits = Limits { longest: WIRE_PIECE, ..Limits::DEEP };

/// At every change at once, and again after `again_after`.
const fn on_change(again_after: Duration) -> Rate {
    Rate::OnChange { at_most_every: Duration::ZERO, again_after }
}

/// A topic without `limits` has small samples, and all recordings contain one without `logged`.
macro_rules! topics {
    (@ $written:expr, $default:expr) => { $written };
    (@ $default:expr) => { $default };
    ($($(#[doc = $meaning:literal])+ $id:ident: Topic<$($payload:ty),+> {
        name: $name:literal, writer: $writer:expr, rate: $rate:expr $(, limits: $limits:expr)? $(, logged: $logged:ident)? $(,)?
    })*) => {
        $(
            $(#[doc = $meaning])+
            pub static $id: Topic<$($payload),+> = Topic::new(&Spec {
                name: $name,
                writer: $writer,
                rate: $rate,
                limits: topics!(@ $($limits,)? Limits::SMALL),
                logged: topics!(@ $(Logged::$logged,)? Logged::Yes),
                meaning: concat!($($meaning),+),
            });
        )*
        /// Every topic, in the order of the pipeline.
        pub static TABLE: &[&dyn AnyTopic] = &[$(&$id),*];
    };
}

topics! {
    /// Where the robot is sent: the current target, and those after it.
    TARGET: Topic<TargetSample> {
        name: "target", writer: SUPERVISOR, rate: on_change(RESTATE),
    }
    /// The keep-out zones, if operators changed those of the mission.
    ZONES: Topic<ZonesHeader, ZoneCorner> {
        name: "zones", writer: SUPERVISOR, rate: on_change(RESTATE), limits: Limits::slices(MOST_ZONES * MOST_CORNERS),
    }
    /// Readings of the sonars and infrared rangers, one for each row of the mission's sensors.
    RANGES: Topic<RangesHeader, RangeReading> {
        name: "ranges", writer: "link", rate: Rate::EachTick, limits: Limits::slices(MOST_SENSORS),
    }
    /// The beams of a laser, a sample for each laser that measured.
    SCAN: Topic<ScanHeader, f32> {
        name: "scan", writer: "link", rate: Rate::WhenItHappens, limits: SCANS,
    }
    /// Encoder counts and wheel speeds.
    WHEELS: Topic<WheelSample> {
        name: "wheels", writer: "link", rate: Rate::EachTick,
    }
    /// The counts of `wheels` without their cycle, in each tick of a robot that says angles of its wheels or its odometry.
    COUNTS: Topic<CountsSample> {
        name: "counts", writer: "link", rate: Rate::WhenItHappens,
    }
    /// How the base was found to answer, in each tick, if it stops later than the mission states.
    BASE_RESPONSE: Topic<BaseResponseSample> {
        name: "base_response", writer: "link", rate: Rate::WhenItHappens,
    }
    /// Wheels are held although they were told to turn, or a bumper or a cliff sensor feels something: where.
    CONTACT: Topic<ContactSample> {
        name: "contact", writer: "link", rate: Rate::WhenItHappens,
    }
    /// Where a source outside saw the robot: a camera, a satellite receiver. Any consumer may publish it.
    FIX: Topic<FixSample> {
        name: "fix", writer: OPERATOR, rate: Rate::WhenItHappens,
    }
    /// Where the robot is by the scans of its laser.
    SCAN_FIX: Topic<FixSample> {
        name: "scan_fix", writer: "mapper", rate: Rate::WhenItHappens,
    }
    /// Where an operator says that the standing robot is.
    PLACE: Topic<PlaceSample> {
        name: "place", writer: SUPERVISOR, rate: on_change(RESTATE),
    }
    /// How far a gyro turned. Any consumer may publish it, one at a time.
    TURN: Topic<TurnSample> {
        name: "turn", writer: OPERATOR, rate: Rate::WhenItHappens,
    }
    /// How far the robot turned by its own gyro, in each tick.
    IMU_TURN: Topic<TurnSample> {
        name: "imu_turn", writer: "link", rate: Rate::WhenItHappens,
    }
    /// Where the robot believes it is.
    POSE: Topic<PoseSample> {
        name: "pose", writer: "dead-reckoning", rate: Rate::EachTick,
    }
    /// The safety map: keyframes and changed windows.
    GRID: Topic<GridHeader, u8> {
        name: "grid", writer: "mapper", rate: Rate::EachTick, limits: Limits::MAP,
    }
    /// The reference direction at the robot's pose.
    GUIDANCE: Topic<GuidanceSample> {
        name: "guidance", writer: "planner", rate: Rate::EachTick,
    }
    /// The whole-domain policy, for consumers.
    FIELD: Topic<FieldHeader, FieldCell> {
        name: "field", writer: "planner", rate: FIELD_RATE, limits: Limits::WHOLE_MAP, logged: WithFields,
    }
    /// Wheel speeds for the robot.
    COMMAND: Topic<CommandSample> {
        name: "command", writer: "controller", rate: Rate::EachTick,
    }
    /// Heartbeats, from inside the work loop.
    HEALTH: Topic<HealthSample> {
        name: "health", writer: EVERY_STAGE, rate: on_change(BEAT),
    }
    /// The connection to the robot: its state, counts, tick latency.
    LINK: Topic<LinkSample> {
        name: "link", writer: "link", rate: on_change(LINK_AGAIN),
    }
    /// The seven infrared rangers, metres.
    INFRARED: Topic<InfraredSample> {
        name: "infrared", writer: "link", rate: Rate::EachFrame,
    }
    /// Battery volts and whether they are low, motor currents, temperatures of the drivers.
    POWER: Topic<PowerSample> {
        name: "power", writer: "link", rate: Rate::EachFrame,
    }
    /// Human sensors, tilt, temperature.
    SURROUNDINGS: Topic<SurroundingsSample> {
        name: "surroundings", writer: "link", rate: Rate::EachFrame,
    }
    /// The supervisor's order to all stages.
    DIRECTIVE: Topic<DirectiveSample> {
        name: "directive", writer: SUPERVISOR, rate: on_change(RESTATE),
    }
    /// How far the robot may go in lockstep, and since which tick the newest recovery step holds.
    TICK_LIMIT: Topic<TickLimitSample> {
        name: "tick_limit", writer: SUPERVISOR, rate: on_change(RESTATE),
    }
    /// The stages' processes, as the supervisor sees them.
    ROSTER: Topic<RosterHeader, RosterEntry> {
        name: "roster", writer: SUPERVISOR, rate: on_change(RESTATE), limits: ROSTERS,
    }
    /// A stage's process ended: cause, ages, the end of its log, what follows.
    DEATHS: Topic<DeathSample> {
        name: "deaths", writer: SUPERVISOR, rate: Rate::WhenItHappens,
    }
    /// The robot should make progress and does not: how, and what is tried.
    STALLS: Topic<StallSample> {
        name: "stalls", writer: SUPERVISOR, rate: Rate::WhenItHappens,
    }
    /// Requests of an operator: restart, stop, resume, targets, the place, zones.
    REQUESTS: Topic<RequestSample> {
        name: "requests", writer: OPERATOR, rate: Rate::WhenItHappens, logged: No,
    }
    /// Each request with its answer. The process of an operator may end before others have read its request.
    ORDERS: Topic<RequestSample> {
        name: "orders", writer: SUPERVISOR, rate: Rate::WhenItHappens,
    }
    /// Requests of an operator to inject a fault into a stage; every stage reads it.
    FAULTS: Topic<FaultSample> {
        name: "faults", writer: OPERATOR, rate: Rate::WhenItHappens,
    }
    /// The bytes that the link received from the robot and sent to it. Wakes nobody: a reader waits for `link`.
    WIRE: Topic<WireHeader, u8> {
        name: "wire", writer: "link", rate: Rate::WhenItHappens, limits: WIRE_PIECES,
    }
    /// The inputs of every stage's step, and the checkpoint each generation started from, for a replay.
    /// Wakes nobody: a reader waits for `link`.
    INPUTS: Topic<InputsHeader, u8> {
        name: "inputs", writer: EVERY_STAGE, rate: Rate::WhenItHappens, limits: Limits::DEEP,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn no_two_topics_share_a_name() {
        let names: HashSet<_> = TABLE.iter().map(|topic| topic.spec().name).collect();
        assert_eq!(names.len(), TABLE.len());
    }
}
