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

/// A fault of a robot's data. [`TABLE`] says what each does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum RobotFault {
    Silence,
    MotorOnes,
    MotorZeros,
    MotorRepeated,
    EncoderDead,
    EncodersSwapped,
    EncoderReversed,
    CountsRandom,
    CountsReset,
    RangeInvalid,
    RangeMissing,
    RangeStuck,
    FramesLate,
    OldFrames,
    StreamsStop,
    DoesNotStop,
    FramesSlow,
    IgnoresZero,
    LinkKilled,
    SupervisorKilled,
    AllKilled,
    RangeSilent,
    RangeFrozen,
    LateFromBoot,
    HeldWheels,
    Garbage,
}

#[derive(Debug)]
pub struct Row {
    pub fault: RobotFault,
    /// Name on the command line and in reports.
    pub name: &'static str,
    /// The effect on an X80; [`NOTHING`] if the fault has no meaning there.
    pub x80: &'static str,
    /// The effect on a robot that speaks lines of JSON; [`LIKEWISE`] if that is the same.
    pub json: &'static str,
    pub promise: Promise,
}

/// The fault has no meaning for this protocol.
const NOTHING: &str = "-";
/// The fault does the same to both.
const LIKEWISE: &str = "likewise";

const fn row(
    fault: RobotFault,
    name: &'static str,
    promise: Promise,
    x80: &'static str,
    json: &'static str,
) -> Row {
    Row { fault, name, x80, json, promise }
}

#[rustfmt::skip]
pub static TABLE: &[Row] = &[
    row(RobotFault::Silence, "silence", Promise::Rests, "nothing comes from the robot any more", LIKEWISE),
    row(RobotFault::MotorOnes, "motor-ones", Promise::Rests, "the data of every motor frame are 0xFF", NOTHING),
    row(RobotFault::MotorZeros, "motor-zeros", Promise::RestsLater, "the data of every motor frame are 0", "all angles and speeds of wheels are 0"),
    row(RobotFault::MotorRepeated, "motor-repeated", Promise::Rests, "the same motor frame for ever", "the same line for ever"),
    row(RobotFault::EncoderDead, "encoder-dead", Promise::Rests, "one encoder does not count", LIKEWISE),
    row(RobotFault::EncodersSwapped, "encoders-swapped", Promise::RestsLater, "the encoders of left and right are swapped", LIKEWISE),
    row(RobotFault::EncoderReversed, "encoder-reversed", Promise::Rests, "one encoder counts backwards", LIKEWISE),
    row(RobotFault::CountsRandom, "counts-random", Promise::Rests, "random counts in each frame", "random angles and speeds in each line"),
    row(RobotFault::CountsReset, "counts-reset", Promise::Unharmed, "counts begin again from 0 without silence", LIKEWISE),
    row(RobotFault::RangeInvalid, "range-invalid", Promise::Rests, "every ultrasonic byte is 0, which is not valid", "every range and beam is -1, no reading"),
    row(RobotFault::RangeMissing, "range-missing", Promise::Rests, "no standard frame comes", "no ranges and no scan come"),
    row(RobotFault::RangeStuck, "range-stuck", Promise::RestsLater, "every ultrasonic byte is 8 cm", "every range and beam is 0.3 m"),
    row(RobotFault::FramesLate, "frames-late", Promise::Rests, "all frames come 2 s late", "all lines come 2 s late"),
    row(RobotFault::OldFrames, "old-frames", Promise::Unharmed, "every 2 s a motor frame of 3 s ago comes again", "every 2 s a line of 3 s ago comes again"),
    row(RobotFault::StreamsStop, "streams-stop", Promise::Rests, "no sensor frame comes, acknowledgements do", "only answers come"),
    row(RobotFault::DoesNotStop, "does-not-stop", Promise::Rests, "after `firsthand stop`: given speed 0 the robot keeps its speed", LIKEWISE),
    row(RobotFault::FramesSlow, "frames-slow", Promise::RestsLater, "sensor frames come three times a second", "lines with wheels come three times a second"),
    row(RobotFault::IgnoresZero, "ignores-zero", Promise::EndsAtRest, "given speed 0 the robot keeps its speed, to the end of its mission", LIKEWISE),
    row(RobotFault::LinkKilled, "link-killed", Promise::RestsAtOnce, "time limits are ignored; SIGKILL of the link under a frozen supervisor", LIKEWISE),
    row(RobotFault::SupervisorKilled, "supervisor-killed", Promise::RestsAtOnce, "time limits are ignored; SIGKILL of the supervisor", LIKEWISE),
    row(RobotFault::AllKilled, "all-killed", Promise::RestsAtOnce, "time limits are ignored; SIGKILL of all processes, then `firsthand stop`", LIKEWISE),
    row(RobotFault::RangeSilent, "range-silent", Promise::Unharmed, "every ultrasonic byte is 255, nothing in range", "every range and beam is null, nothing in reach"),
    row(RobotFault::RangeFrozen, "range-frozen", Promise::RestsLater, "the last ultrasonic bytes that are distances repeat for ever", "the last ranges and scan repeat for ever"),
    row(RobotFault::LateFromBoot, "late-from-boot", Promise::Unharmed, "from its start on, all frames come 0.5 s late", "all lines come 0.5 s late"),
    row(RobotFault::HeldWheels, "held-wheels", Promise::EndsAtRest, "the wheels stand, and their motors draw the current of held ones", "the wheels stand and are said to be held"),
    row(RobotFault::Garbage, "garbage", Promise::Rests, NOTHING, "half of each line is missing, so none is JSON"),
];

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
        // A test ensures that every fault has a row.
        TABLE.iter().find(|row| row.fault == self).unwrap_or(&TABLE[0])
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
    pub const fn from_boot(self) -> bool {
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
    fn every_fault_has_one_row_and_a_name_that_finds_it() {
        for (index, row) in TABLE.iter().enumerate() {
            assert_eq!(row.fault as usize, index, "{}", row.name);
            assert_eq!(RobotFault::named(row.name), Some(row.fault));
            assert_eq!(row.fault.row().name, row.name);
        }
        assert_eq!(RobotFault::Garbage as usize + 1, TABLE.len());
        assert_eq!(RobotFault::named("none"), None);
    }

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
