//! THE table of topics: what the processes say to each other.
//!
//! Services are created from it, the README's table is printed from it (`firsthand topics`), and the
//! stages' table is checked against it. A topic is declared once, below, and named nowhere else.

use std::time::Duration;

use crate::samples::{
    CommandSample, DeathSample, DirectiveSample, FaultSample, FieldCell, FieldHeader, GridHeader,
    GuidanceSample, HealthSample, InfraredSample, LinkSample, PoseSample, PowerSample, RangeSample,
    RequestSample, RosterEntry, RosterHeader, StallSample, SurroundingsSample, WheelSample,
};

pub use crate::bus::{AnyTopic, SliceTopic, Topic};

/// How often a topic speaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rate {
    /// Once a tick.
    EachTick,
    /// Whenever the robot sends the frame it is read from, driving or not: about once a tick.
    EachFrame,
    /// At every change, and at least this often.
    OnChange(Duration),
    /// When something happened, once.
    WhenItHappens,
}

/// What the table says of a topic.
#[derive(Debug)]
pub struct Spec {
    /// Its name, and the name of its two services.
    pub name: &'static str,
    /// Who writes it: a stage, `supervisor`, or `every stage`.
    pub writer: &'static str,
    /// How often.
    pub rate: Rate,
    /// Mission time after which a reader must not act on it any more; none where age does not matter.
    pub max_age: Option<Duration>,
    /// Depth of history and buffers, number of readers.
    pub limits: Limits,
    /// What it means.
    pub meaning: &'static str,
}

/// How much a topic holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Samples a reader that falls behind still gets; then the oldest give way.
    pub buffer: usize,
    /// Samples a reader may hold at once.
    pub borrowed: usize,
    /// Readers at once, dashboards and loggers among them.
    pub readers: usize,
}

impl Limits {
    /// For topics of one small struct.
    pub const SMALL: Self = Self {
        buffer: 128,
        borrowed: 2,
        readers: 16,
    };
    /// For slices of a whole map.
    pub const MAP: Self = Self {
        buffer: 4,
        borrowed: 2,
        readers: 12,
    };
    /// Writers at once. One is meant; a kill while starting can leak a place for good.
    pub(crate) const WRITERS: usize = 16;
    /// Processes at once on one topic.
    pub(crate) const NODES: usize = 64;
}

/// A tick is late after this: one and three quarters of a period at 7 Hz.
const TICK_AGE: Option<Duration> = Some(Duration::from_millis(250));
/// How often state that changes seldom is said again for late joiners.
pub const RESTATE: Duration = Duration::from_millis(200);

/// The writer named by topics that all stages write.
pub const EVERY_STAGE: &str = "every stage";
/// The writers that are no stage: whoever uses the command line, one process each time.
pub const OPERATOR: &str = "operator";
/// The writer that is no stage.
pub const SUPERVISOR: &str = "supervisor";

macro_rules! topics {
    ($($(#[doc = $meaning:literal])+ $id:ident: $kind:ident<$($payload:ty),+> {
        name: $name:literal, writer: $writer:expr, rate: $rate:expr, max_age: $age:expr, limits: $limits:expr $(,)?
    })*) => {
        $(
            $(#[doc = $meaning])+
            pub static $id: $kind<$($payload),+> = $kind::new(&Spec {
                name: $name,
                writer: $writer,
                rate: $rate,
                max_age: $age,
                limits: $limits,
                meaning: concat!($($meaning),+),
            });
        )*
        /// Every topic, in the order of the pipeline.
        pub static TABLE: &[&dyn AnyTopic] = &[$(&$id),*];
    };
}

topics! {
    /// Front sonar: distance to the nearest thing ahead.
    RANGE: Topic<RangeSample> {
        name: "range", writer: "x80-link", rate: Rate::EachTick, max_age: TICK_AGE, limits: Limits::SMALL,
    }
    /// Encoder counts and wheel speeds.
    WHEELS: Topic<WheelSample> {
        name: "wheels", writer: "x80-link", rate: Rate::EachTick, max_age: TICK_AGE, limits: Limits::SMALL,
    }
    /// Where the robot believes it is.
    POSE: Topic<PoseSample> {
        name: "pose", writer: "dead-reckoning", rate: Rate::EachTick, max_age: TICK_AGE, limits: Limits::SMALL,
    }
    /// The safety map: keyframes and changed windows.
    GRID: SliceTopic<GridHeader, u8> {
        name: "grid", writer: "mapper", rate: Rate::EachTick, max_age: TICK_AGE, limits: Limits::MAP,
    }
    /// The reference direction at the robot's pose.
    GUIDANCE: Topic<GuidanceSample> {
        name: "guidance", writer: "planner", rate: Rate::EachTick, max_age: TICK_AGE, limits: Limits::SMALL,
    }
    /// The whole-domain policy, for consumers.
    FIELD: SliceTopic<FieldHeader, FieldCell> {
        name: "field", writer: "planner", rate: Rate::OnChange(Duration::from_secs(1)), max_age: None, limits: Limits::MAP,
    }
    /// Wheel speeds for the robot.
    COMMAND: Topic<CommandSample> {
        name: "command", writer: "controller", rate: Rate::EachTick, max_age: TICK_AGE, limits: Limits::SMALL,
    }
    /// Heartbeats.
    HEALTH: Topic<HealthSample> {
        name: "health", writer: EVERY_STAGE, rate: Rate::OnChange(Duration::from_millis(50)), max_age: None, limits: Limits::SMALL,
    }
    /// The wire to the robot: connection, counts, tick latency.
    LINK: Topic<LinkSample> {
        name: "link", writer: "x80-link", rate: Rate::EachTick, max_age: None, limits: Limits::SMALL,
    }
    /// The seven infrared rangers, metres.
    INFRARED: Topic<InfraredSample> {
        name: "infrared", writer: "x80-link", rate: Rate::EachFrame, max_age: None, limits: Limits::SMALL,
    }
    /// Battery volts and whether they are low, motor currents, heat of the drivers.
    POWER: Topic<PowerSample> {
        name: "power", writer: "x80-link", rate: Rate::EachFrame, max_age: None, limits: Limits::SMALL,
    }
    /// Human sensors, tilt, temperature.
    SURROUNDINGS: Topic<SurroundingsSample> {
        name: "surroundings", writer: "x80-link", rate: Rate::EachFrame, max_age: None, limits: Limits::SMALL,
    }
    /// The supervisor's order to all stages.
    DIRECTIVE: Topic<DirectiveSample> {
        name: "directive", writer: SUPERVISOR, rate: Rate::OnChange(RESTATE), max_age: None, limits: Limits::SMALL,
    }
    /// What runs, as the supervisor sees it.
    ROSTER: SliceTopic<RosterHeader, RosterEntry> {
        name: "roster", writer: SUPERVISOR, rate: Rate::OnChange(RESTATE), max_age: None, limits: Limits::MAP,
    }
    /// A stage died: cause, ages, last words, what follows.
    DEATHS: Topic<DeathSample> {
        name: "deaths", writer: SUPERVISOR, rate: Rate::WhenItHappens, max_age: None, limits: Limits::SMALL,
    }
    /// The robot should get on and does not: how, and what is tried.
    STALLS: Topic<StallSample> {
        name: "stalls", writer: SUPERVISOR, rate: Rate::WhenItHappens, max_age: None, limits: Limits::SMALL,
    }
    /// What an operator asks: restart, stop, resume.
    REQUESTS: Topic<RequestSample> {
        name: "requests", writer: OPERATOR, rate: Rate::WhenItHappens, max_age: None, limits: Limits::SMALL,
    }
    /// What an operator breaks in a stage on purpose; every stage listens.
    FAULTS: Topic<FaultSample> {
        name: "faults", writer: OPERATOR, rate: Rate::WhenItHappens, max_age: None, limits: Limits::SMALL,
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
