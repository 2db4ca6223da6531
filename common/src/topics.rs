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
/// Heartbeats, and the link's state, are farther apart than ticks at 7 Hz, so a stage that answers ticks publishes them with those and
/// need not wake for them alone. Five of them fit in the tightest deadline of a heartbeat.
const BEAT: Duration = Duration::from_millis(150);

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

/// A row has its name, the header and the elements of its samples, its writer and its rate. A topic without `limits` has small samples, and
/// all recordings contain one without `logged`.
macro_rules! topics {
    (@ $written:expr, $default:expr) => { $written };
    (@ $default:expr) => { $default };
    ($($(#[doc = $meaning:literal])+ $id:ident $name:literal: $($payload:ident)+, $writer:expr, $rate:expr
        $(, limits: $limits:expr)? $(, logged: $logged:ident)?;)*) => {
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
    TARGET "target": TargetSample, SUPERVISOR, on_change(RESTATE);
    /// Where the thing is that the robot follows. Any consumer may publish it.
    BEACON "beacon": BeaconSample, OPERATOR, Rate::WhenItHappens;
    /// How the robot follows the beacon, from the first request to do so on.
    FOLLOWING "following": FollowingSample, SUPERVISOR, on_change(RESTATE);
    /// The keep-out zones, if operators changed those of the mission.
    ZONES "zones": ZonesHeader ZoneCorner, SUPERVISOR, on_change(RESTATE), limits: Limits::slices(MOST_ZONES * MOST_CORNERS);
    /// Readings of the sonars and infrared rangers, one for each row of the mission's sensors.
    RANGES "ranges": RangesHeader RangeReading, "link", Rate::EachTick, limits: Limits::slices(MOST_SENSORS);
    /// The beams of a laser, a sample for each laser that measured.
    SCAN "scan": ScanHeader f32, "link", Rate::WhenItHappens, limits: SCANS;
    /// Encoder counts and wheel speeds.
    WHEELS "wheels": WheelSample, "link", Rate::EachTick;
    /// The counts of `wheels` without their cycle, in each tick of a robot that says angles of its wheels or its odometry.
    COUNTS "counts": CountsSample, "link", Rate::WhenItHappens;
    /// How the base was found to answer, in each tick, if it stops later than the mission states.
    BASE_RESPONSE "base_response": BaseResponseSample, "link", Rate::WhenItHappens;
    /// Wheels are held although they were told to turn, or a bumper or a cliff sensor feels something: where.
    CONTACT "contact": ContactSample, "link", Rate::WhenItHappens;
    /// Where a source outside saw the robot: a camera, a satellite receiver. Any consumer may publish it.
    FIX "fix": FixSample, OPERATOR, Rate::WhenItHappens;
    /// Where the robot is by the scans of its laser.
    SCAN_FIX "scan_fix": FixSample, "mapper", Rate::WhenItHappens;
    /// Where an operator says that the standing robot is.
    PLACE "place": PlaceSample, SUPERVISOR, on_change(RESTATE);
    /// How far a gyro turned. Any consumer may publish it, one at a time.
    TURN "turn": TurnSample, OPERATOR, Rate::WhenItHappens;
    /// How far the robot turned by its own gyro, in each tick.
    IMU_TURN "imu_turn": TurnSample, "link", Rate::WhenItHappens;
    /// Where the robot believes it is.
    POSE "pose": PoseSample, "dead-reckoning", Rate::EachTick;
    /// The safety map: keyframes and changed windows.
    GRID "grid": GridHeader u8, "mapper", Rate::EachTick, limits: Limits::MAP;
    /// The reference direction at the robot's pose.
    GUIDANCE "guidance": GuidanceSample, "planner", Rate::EachTick;
    /// The whole-domain policy, for consumers.
    FIELD "field": FieldHeader FieldCell, "planner", FIELD_RATE, limits: Limits::WHOLE_MAP, logged: WithFields;
    /// Wheel speeds for the robot.
    COMMAND "command": CommandSample, "controller", Rate::EachTick;
    /// Heartbeats, from inside the work loop.
    HEALTH "health": HealthSample, EVERY_STAGE, on_change(BEAT);
    /// The connection to the robot: its state, counts, tick latency.
    LINK "link": LinkSample, "link", on_change(BEAT);
    /// Trouble of a stage, with the input and the remedy, again and again while it lasts.
    COMPLAINTS "complaints": ComplaintSample, EVERY_STAGE, Rate::WhenItHappens;
    /// The seven infrared rangers, metres.
    INFRARED "infrared": InfraredSample, "link", Rate::EachFrame;
    /// Battery volts and whether they are low, motor currents, temperatures of the drivers.
    POWER "power": PowerSample, "link", Rate::EachFrame;
    /// Human sensors, tilt, temperature.
    SURROUNDINGS "surroundings": SurroundingsSample, "link", Rate::EachFrame;
    /// The supervisor's order to all stages.
    DIRECTIVE "directive": DirectiveSample, SUPERVISOR, on_change(RESTATE);
    /// How far the robot may go in lockstep, and since which tick the newest recovery step holds.
    TICK_LIMIT "tick_limit": TickLimitSample, SUPERVISOR, on_change(RESTATE);
    /// The stages' processes, as the supervisor sees them.
    ROSTER "roster": RosterHeader RosterEntry, SUPERVISOR, on_change(RESTATE), limits: ROSTERS;
    /// How old the samples of a mirror on another machine are. The bus of the robot itself has no such sample.
    MIRROR "mirror": MirrorSample, SUPERVISOR, on_change(RESTATE);
    /// A stage's process ended: cause, ages, the end of its log, what follows.
    DEATHS "deaths": DeathSample, SUPERVISOR, Rate::WhenItHappens;
    /// The robot should make progress and does not: how, and what is tried.
    STALLS "stalls": StallSample, SUPERVISOR, Rate::WhenItHappens;
    /// Requests of an operator: restart, stop, resume, targets, the place, zones.
    REQUESTS "requests": RequestSample, OPERATOR, Rate::WhenItHappens, logged: No;
    /// Each request with its answer. The process of an operator may end before others have read its request.
    ORDERS "orders": RequestSample, SUPERVISOR, Rate::WhenItHappens;
    /// Requests of an operator to inject a fault into a stage; every stage reads it.
    FAULTS "faults": FaultSample, OPERATOR, Rate::WhenItHappens;
    /// The bytes that the link received from the robot and sent to it. Wakes nobody: a reader waits for `link`.
    WIRE "wire": WireHeader u8, "link", Rate::WhenItHappens, limits: WIRE_PIECES;
    /// The inputs of every stage's step, and the checkpoint each generation started from, for a replay.
    /// Wakes nobody: a reader waits for `link`.
    INPUTS "inputs": InputsHeader u8, EVERY_STAGE, Rate::WhenItHappens, limits: Limits::DEEP;
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
