//! Table of topics: all that the processes publish for each other.
//!
//! It defines the services, `firsthand topic list`, the check of the stages' table, and the
//! writers' republishing intervals. Each topic is declared and named only here.

use std::time::Duration;

use crate::{
    mission::{MOST_BEAMS, MOST_CORNERS, MOST_SENSORS, MOST_ZONES},
    samples::*,
};

pub use crate::bus::{
    AnyTopic, EVERY_STAGE, Limits, Logged, OPERATOR, Rate, SUPERVISOR, Spec, Topic,
};

/// Republishing interval of the supervisor's order and roster, for consumers that joined later.
pub const RESTATE: Duration = Duration::from_millis(200);
/// Interval of heartbeats and the link's state. It exceeds a tick at 7 Hz, so a stage that answers
/// ticks sends them without extra wakeups. Five fit in the tightest heartbeat deadline.
const BEAT: Duration = Duration::from_millis(150);

/// Rate of the field, in mission time. The field is for displays and recorders; no stage waits for
/// it.
const FIELD_RATE: Rate = Rate::OnChange {
    at_most_every: Duration::from_millis(250),
    again_after: Duration::from_secs(1),
};

/// Limits that let a long unscheduled recorder learn each generation from buffered rosters.
const ROSTERS: Limits = Limits { buffer: Limits::MAP.recorder_buffer, ..Limits::MAP };

/// Limits of scans; the largest take the memory of 1,024 small ones. With one laser at 40 Hz, a
/// recorder that is not scheduled for 1.6 s loses none.
const SCANS: Limits = Limits { buffer: 16, recorder_buffer: 64, ..Limits::slices(MOST_BEAMS) };

/// Most bytes of a `wire` sample; longer data are split.
pub const WIRE_PIECE: usize = 2048;
const WIRE_PIECES: Limits = Limits { longest: WIRE_PIECE, ..Limits::DEEP };

/// Publishes at every change at once, and again after `again_after`.
const fn on_change(again_after: Duration) -> Rate {
    Rate::OnChange { at_most_every: Duration::ZERO, again_after }
}

/// Declares topics: name, header and elements of samples, writer and rate. By default samples are
/// small, and all recordings contain the topic.
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
        /// All topics, in the order of the pipeline.
        pub static TABLE: &[&dyn AnyTopic] = &[$(&$id),*];
    };
}

topics! {
    /// Current target and those after it.
    TARGET "target": TargetSample, SUPERVISOR, on_change(RESTATE);
    /// Position of the followed thing. Any consumer may publish it.
    BEACON "beacon": BeaconSample, OPERATOR, Rate::WhenItHappens;
    /// State of following the beacon, from the first request on.
    FOLLOWING "following": FollowingSample, SUPERVISOR, on_change(RESTATE);
    /// Keep-out zones, once operators changed those of the mission.
    ZONES "zones": ZonesHeader ZoneCorner, SUPERVISOR, on_change(RESTATE), limits: Limits::slices(MOST_ZONES * MOST_CORNERS);
    /// Readings of the sonars and infrared rangers, one per row of the mission's sensors.
    RANGES "ranges": RangesHeader RangeReading, "link", Rate::EachTick, limits: Limits::slices(MOST_SENSORS);
    /// Beams of a laser, one sample per laser that measured.
    SCAN "scan": ScanHeader f32, "link", Rate::WhenItHappens, limits: SCANS;
    /// Encoder counts and wheel speeds.
    WHEELS "wheels": WheelSample, "link", Rate::EachTick;
    /// Counts of `wheels` without wraparound, in each tick of a robot that reports wheel angles or
    /// odometry.
    COUNTS "counts": CountsSample, "link", Rate::WhenItHappens;
    /// Identified response of the base, in each tick, if it stops later than the mission states.
    BASE_RESPONSE "base_response": BaseResponseSample, "link", Rate::WhenItHappens;
    /// Evidence of the link against a healthy robot, in each tick that changes it.
    DOUBTS "doubts": DoubtsSample, "link", Rate::WhenItHappens;
    /// Location of a contact: wheels are blocked despite a command, or a bumper or cliff sensor is
    /// active.
    CONTACT "contact": ContactSample, "link", Rate::WhenItHappens;
    /// Robot position from an external source: a camera, a satellite receiver. Any consumer may
    /// publish it.
    FIX "fix": FixSample, OPERATOR, Rate::WhenItHappens;
    /// Robot position from laser scans.
    SCAN_FIX "scan_fix": FixSample, "mapper", Rate::WhenItHappens;
    /// Pose of the standing robot, stated by an operator.
    PLACE "place": PlaceSample, SUPERVISOR, on_change(RESTATE);
    /// Turn measured by a gyro. Any consumer may publish it, one at a time.
    TURN "turn": TurnSample, OPERATOR, Rate::WhenItHappens;
    /// Turn measured by the robot's own gyro, in each tick.
    IMU_TURN "imu_turn": TurnSample, "link", Rate::WhenItHappens;
    /// Estimated pose of the robot.
    POSE "pose": PoseSample, "dead-reckoning", Rate::EachTick;
    /// Safety map: keyframes and changed windows.
    GRID "grid": GridHeader u8, "mapper", Rate::EachTick, limits: Limits::MAP;
    /// Reference direction at the robot's pose.
    GUIDANCE "guidance": GuidanceSample, "planner", Rate::EachTick;
    /// Whole-domain policy, for consumers.
    FIELD "field": FieldHeader FieldCell, "planner", FIELD_RATE, limits: Limits::WHOLE_MAP, logged: WithFields;
    /// Wheel speeds for the robot.
    COMMAND "command": CommandSample, "controller", Rate::EachTick;
    /// Heartbeats, from inside the work loop.
    HEALTH "health": HealthSample, EVERY_STAGE, on_change(BEAT);
    /// Connection to the robot: its state, counts, tick latency.
    LINK "link": LinkSample, "link", on_change(BEAT);
    /// Trouble of a stage, with the input and the remedy, again and again while it lasts.
    COMPLAINTS "complaints": ComplaintSample, EVERY_STAGE, Rate::WhenItHappens;
    /// The seven infrared rangers, metres.
    INFRARED "infrared": InfraredSample, "link", Rate::EachFrame;
    /// Battery voltages and low flags, motor currents, driver temperatures.
    POWER "power": PowerSample, "link", Rate::EachFrame;
    /// Human sensors, tilt, temperature.
    SURROUNDINGS "surroundings": SurroundingsSample, "link", Rate::EachFrame;
    /// Supervisor's order to all stages.
    DIRECTIVE "directive": DirectiveSample, SUPERVISOR, on_change(RESTATE);
    /// Last permitted tick in lockstep, and the first tick of the newest recovery step.
    TICK_LIMIT "tick_limit": TickLimitSample, SUPERVISOR, on_change(RESTATE);
    /// Processes of the stages, as the supervisor sees them.
    ROSTER "roster": RosterHeader RosterEntry, SUPERVISOR, on_change(RESTATE), limits: ROSTERS;
    /// Age of the samples of a mirror on another machine. The robot's own bus has no such sample.
    MIRROR "mirror": MirrorSample, SUPERVISOR, on_change(RESTATE);
    /// End of a stage's process: cause, ages, the end of its log, the next step.
    DEATHS "deaths": DeathSample, SUPERVISOR, Rate::WhenItHappens;
    /// Stall of the robot: kind and recovery.
    STALLS "stalls": StallSample, SUPERVISOR, Rate::WhenItHappens;
    /// Requests of an operator: restart, stop, resume, targets, the place, zones.
    REQUESTS "requests": RequestSample, OPERATOR, Rate::WhenItHappens, logged: No;
    /// Requests with their answers. An operator's process may end before others have read its
    /// request.
    ORDERS "orders": RequestSample, SUPERVISOR, Rate::WhenItHappens;
    /// Requests of an operator to inject a fault into a stage; every stage reads them.
    FAULTS "faults": FaultSample, OPERATOR, Rate::WhenItHappens;
    /// Bytes that the link received from the robot and sent to it. It wakes no reader: wait for
    /// `link`.
    WIRE "wire": WireHeader u8, "link", Rate::WhenItHappens, limits: WIRE_PIECES;
    /// Inputs of every stage's step, and the initial checkpoint of each generation, for a replay.
    /// It wakes no reader: wait for `link`.
    INPUTS "inputs": InputsHeader u8, EVERY_STAGE, Rate::WhenItHappens, limits: Limits::DEEP;
}

pub fn find(name: &str) -> Option<&'static dyn AnyTopic> {
    TABLE.iter().copied().find(|topic| topic.spec().name == name)
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
