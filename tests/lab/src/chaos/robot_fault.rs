//! THE table of robot faults: wrong data that a robot sends to its link, and the promise under each.

use common::mission::Protocol;
use serde::{Serialize, Serializer};

/// Longest time from the fault to the last moving command and to wheels at rest, seconds: 1.5 s of motion until command and
/// report are known to disagree, half a second to come to rest.
pub const REST_WITHIN_S: f64 = 2.0;
/// Longest time for faults that show later, seconds: counts of 0 first look like a restart of the robot; swapped encoders
/// show in turns; a rate needs nine slow frames. Each command lasts for 0.25 s meanwhile.
pub const REST_LATER_S: f64 = 4.0;

/// Longest time from a kill to wheels at rest, seconds: the stop guard speaks within milliseconds, the rest is the lag of the
/// wheels.
pub const REST_AT_ONCE_S: f64 = 0.5;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Promise {
    /// The robot is at rest within [`REST_AT_ONCE_S`] and stays so, and touches nothing.
    RestsAtOnce,
    /// The robot is at rest within [`REST_WITHIN_S`] and stays so, with a reason, and touches nothing.
    Rests,
    /// The robot is at rest within [`REST_LATER_S`] and stays so, with a reason, and touches nothing.
    RestsLater,
    /// The robot touches nothing, and does not report its arrival in a wrong place: its data are poor, but not false.
    Unharmed,
    /// As [`Promise::Unharmed`], and the robot rests when its mission ends.
    EndsAtRest,
}

#[derive(Debug)]
pub struct Row {
    pub fault: RobotFault,
    pub name: &'static str,
    /// The effect on an X80; [`NOTHING`] if the fault has no meaning there.
    pub x80: &'static str,
    /// The effect on a robot that speaks lines of JSON; [`LIKEWISE`] if that is the same.
    pub json: &'static str,
    pub promise: Promise,
}

const NOTHING: &str = "-";
const LIKEWISE: &str = "likewise";

macro_rules! faults {
    ($($fault:ident $name:literal $promise:ident: $x80:expr, $json:expr;)*) => {
        /// A fault of a robot's data. [`TABLE`] says what each does.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        pub enum RobotFault { $($fault),* }

        pub static TABLE: &[Row] = &[$(Row {
            fault: RobotFault::$fault,
            name: $name,
            promise: Promise::$promise,
            x80: $x80,
            json: $json,
        }),*];
    };
}

#[rustfmt::skip]
faults! {
    Silence "silence" Rests: "nothing comes from the robot any more", LIKEWISE;
    MotorOnes "motor-ones" Rests: "the data of every motor frame are 0xFF", NOTHING;
    MotorZeros "motor-zeros" RestsLater: "the data of every motor frame are 0", "all angles and speeds of wheels are 0";
    MotorRepeated "motor-repeated" Rests: "the same motor frame for ever", "the same line for ever";
    EncoderDead "encoder-dead" Rests: "one encoder does not count", LIKEWISE;
    EncodersSwapped "encoders-swapped" RestsLater: "the encoders of left and right are swapped", LIKEWISE;
    EncoderReversed "encoder-reversed" Rests: "one encoder counts backwards", LIKEWISE;
    EncoderLow "encoder-low" Unharmed: "one encoder counts 5 % too little", LIKEWISE;
    EncoderLower "encoder-lower" Unharmed: "one encoder counts 20 % too little", LIKEWISE;
    EncoderRuns "encoder-runs" Unharmed: "one encoder counts 150 a second too many", LIKEWISE;
    CountsRandom "counts-random" Rests: "random counts in each frame", "random angles and speeds in each line";
    CountsReset "counts-reset" Unharmed: "counts begin again from 0 without silence", LIKEWISE;
    RangeInvalid "range-invalid" Rests: "every ultrasonic byte is 0, which is not valid", "every range and beam is -1, no reading";
    RangeMissing "range-missing" Rests: "no standard frame comes", "no ranges and no scan come";
    RangeStuck "range-stuck" RestsLater: "every ultrasonic byte is 8 cm", "every range and beam is 0.3 m";
    FramesLate "frames-late" Rests: "all frames come 2 s late", "all lines come 2 s late";
    OldFrames "old-frames" Unharmed: "every 2 s a motor frame of 3 s ago comes again", "every 2 s a line of 3 s ago comes again";
    StreamsStop "streams-stop" Rests: "no sensor frame comes, acknowledgements do", "only answers come";
    DoesNotStop "does-not-stop" Rests: "after `firsthand stop`: given speed 0 the robot keeps its speed", LIKEWISE;
    FramesSlow "frames-slow" RestsLater: "sensor frames come three times a second", "lines with wheels come three times a second";
    IgnoresZero "ignores-zero" EndsAtRest: "given speed 0 the robot keeps its speed, to the end of its mission", LIKEWISE;
    LinkKilled "link-killed" RestsAtOnce: "time limits are ignored; SIGKILL of the link under a frozen supervisor", LIKEWISE;
    SupervisorKilled "supervisor-killed" RestsAtOnce: "time limits are ignored; SIGKILL of the supervisor", LIKEWISE;
    AllKilled "all-killed" RestsAtOnce: "time limits are ignored; SIGKILL of all processes, then `firsthand stop`", LIKEWISE;
    RangeSilent "range-silent" Unharmed: "every ultrasonic byte is 255, nothing in range", "every range and beam is null, nothing in reach";
    RangeFrozen "range-frozen" RestsLater: "the last ultrasonic bytes that are distances repeat for ever", "the last ranges and scan repeat for ever";
    LateFromBoot "late-from-boot" Unharmed: "from its start on, all frames come 0.5 s late", "all lines come 0.5 s late";
    HeldWheels "held-wheels" EndsAtRest: "the wheels stand, and their motors draw the current of held ones", "the wheels stand and are said to be held";
    RangeLate "range-late" Unharmed: "ultrasonic and infrared readings come 1 s late", "ranges and scans come 1 s late";
    RangeNear "range-near" Unharmed: "the last ultrasonic bytes that are distances repeat within 3 cm", "the last ranges repeat within 3 cm, the last scan within 0.5 %";
    RangeRandom "range-random" Unharmed: "random ultrasonic bytes", "random ranges and beams";
    RangeDeaf "range-deaf" Unharmed: "every ultrasonic byte is 255 while a wheel turns", "every range and beam is null while a wheel turns";
    LateMidway "late-midway" Unharmed: "all frames come 0.5 s late", "all lines come 0.5 s late";
    Garbage "garbage" Rests: NOTHING, "half of each line is missing, so none is JSON";
}

impl Promise {
    /// Time from the fault to rest, seconds; none if the robot may go on.
    pub const fn rest_within_s(self) -> Option<f64> {
        match self {
            Self::RestsAtOnce => Some(REST_AT_ONCE_S),
            Self::Rests => Some(REST_WITHIN_S),
            Self::RestsLater => Some(REST_LATER_S),
            Self::Unharmed | Self::EndsAtRest => None,
        }
    }
}

impl RobotFault {
    /// Whether processes are killed, while a robot that ignores time limits is under way.
    pub const fn is_kill(self) -> bool {
        matches!(self, Self::LinkKilled | Self::SupervisorKilled | Self::AllKilled)
    }

    pub fn row(self) -> &'static Row {
        &TABLE[self as usize]
    }

    /// Whether a robot that speaks `protocol` can have the fault.
    pub fn has_meaning(self, protocol: Protocol) -> bool {
        let row = self.row();
        let does = match protocol {
            Protocol::X80 => row.x80,
            Protocol::Json => row.json,
            Protocol::Arduino | Protocol::Ros2 => NOTHING,
        };
        does != NOTHING
    }

    /// Whether the robot has the fault from its start on.
    pub const fn begins_at_boot(self) -> bool {
        matches!(self, Self::LateFromBoot)
    }

    pub fn named(name: &str) -> Option<Self> {
        let row = TABLE.iter().find(|row| row.name == name)?;
        Some(row.fault)
    }
}

impl Serialize for RobotFault {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(self.row().name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_guides_table_is_this_one() {
        let guide = include_str!("../../../../supervisor/guide/break-it.md");
        for row in TABLE {
            let promise = match (row.promise.rest_within_s(), row.promise) {
                (Some(within_s), _) => format!("rests within {within_s} s"),
                (None, Promise::EndsAtRest) => "ends at rest".to_owned(),
                (None, _) => "unharmed".to_owned(),
            };
            let line = format!("| `{}` | {} | {} | {promise} |\n", row.name, row.x80, row.json);
            assert!(guide.contains(&line), "missing in break-it.md: {line}");
        }
    }
}
