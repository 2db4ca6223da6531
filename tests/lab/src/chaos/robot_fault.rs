//! THE table of robot faults: wrong data that a robot sends to its link, and the promise under each.

use std::fmt;

use clap::ValueEnum;
use common::{
    mission::{Mission, Protocol},
    samples::Cause,
};
use link::failsafe::stop_distance::Stop;
use serde::{Serialize, Serializer};

use super::fault_injector::LATE;

/// The time until some faults show, seconds: counts of 0 first look like a restart of the robot, swapped encoders show in turns, a robot
/// that believes in stuck ranges goes slowly, and slow frames leave pauses.
const SHOWS_AFTER_S: f64 = 2.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Promise {
    /// The robot is at rest as soon as its base can be, stays so, and touches nothing.
    RestsAtOnce,
    /// Likewise, with a reason and as soon as the failsafe's rule of the cause lets it.
    Rests(Cause),
    /// Likewise [`SHOWS_AFTER_S`] later.
    RestsLater(Cause),
    /// The robot touches nothing, and does not report its arrival in a wrong place: its data are poor, but not false.
    Unharmed,
    /// As [`Promise::Unharmed`], and the robot rests when its mission ends.
    EndsAtRest,
}

#[derive(Debug)]
pub struct Row {
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
    ($($fault:ident $name:literal $promise:ident $(($cause:ident))?: $x80:expr, $json:expr;)*) => {
        /// A fault of a robot's data. [`TABLE`] says what each does.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
        pub enum RobotFault { $($fault),* }

        pub static TABLE: &[Row] = &[$(Row {
            name: $name,
            promise: Promise::$promise $((Cause::$cause))?,
            x80: $x80,
            json: $json,
        }),*];
    };
}

#[rustfmt::skip]
faults! {
    Silence "silence" Rests(RobotLost): "nothing comes from the robot any more", LIKEWISE;
    MotorOnes "motor-ones" Rests(OdometryImplausible): "the data of every motor frame are 0xFF", NOTHING;
    MotorZeros "motor-zeros" RestsLater(OdometryImplausible): "the data of every motor frame are 0", "all angles and speeds of wheels are 0";
    MotorRepeated "motor-repeated" Rests(OdometryImplausible): "the same motor frame for ever", "the same line for ever";
    EncoderDead "encoder-dead" Rests(OdometryImplausible): "one encoder does not count", LIKEWISE;
    EncodersSwapped "encoders-swapped" RestsLater(OdometryImplausible): "the encoders of left and right are swapped", LIKEWISE;
    EncoderReversed "encoder-reversed" Rests(OdometryImplausible): "one encoder counts backwards", LIKEWISE;
    EncoderLow "encoder-low" Unharmed: "one encoder counts 5 % too little", LIKEWISE;
    EncoderLower "encoder-lower" Unharmed: "one encoder counts 20 % too little", LIKEWISE;
    EncoderRuns "encoder-runs" Unharmed: "one encoder counts 150 a second too many", LIKEWISE;
    CountsRandom "counts-random" Rests(OdometryImplausible): "random counts in each frame", "random angles and speeds in each line";
    CountsReset "counts-reset" Unharmed: "counts begin again from 0 without silence", LIKEWISE;
    RangeInvalid "range-invalid" Rests(RangeSilent): "every ultrasonic byte is 0, which is not valid", "every range and beam is -1, no reading";
    RangeMissing "range-missing" Rests(RangeSilent): "no standard frame comes", "no ranges and no scan come";
    RangeStuck "range-stuck" RestsLater(RangeImplausible): "every ultrasonic byte is 8 cm", "every range and beam is 0.3 m";
    FramesLate "frames-late" Rests(RobotLost): "all frames come 2 s late", "all lines come 2 s late";
    OldFrames "old-frames" Unharmed: "every 2 s a motor frame of 3 s ago comes again", "every 2 s a line of 3 s ago comes again";
    StreamsStop "streams-stop" Rests(FramesSilent): "no sensor frame comes, acknowledgements do", "only answers come";
    DoesNotStop "does-not-stop" Rests(RobotDoesNotStop): "after `firsthand stop`: given speed 0 the robot keeps its speed", LIKEWISE;
    FramesSlow "frames-slow" RestsLater(FramesSlow): "sensor frames come three times a second", "lines with wheels come three times a second";
    IgnoresZero "ignores-zero" EndsAtRest: "given speed 0 the robot keeps its speed, to the end of its mission", LIKEWISE;
    LinkKilled "link-killed" RestsAtOnce: "time limits are ignored; SIGKILL of the link under a frozen supervisor", LIKEWISE;
    SupervisorKilled "supervisor-killed" RestsAtOnce: "time limits are ignored; SIGKILL of the supervisor", LIKEWISE;
    AllKilled "all-killed" RestsAtOnce: "time limits are ignored; SIGKILL of all processes, then `firsthand stop`", LIKEWISE;
    RangeSilent "range-silent" Unharmed: "every ultrasonic byte is 255, nothing in range", "every range and beam is null, nothing in reach";
    RangeFrozen "range-frozen" RestsLater(RangeImplausible): "the last ultrasonic bytes that are distances repeat for ever", "the last ranges that are distances, and the last scan, repeat for ever";
    LateFromBoot "late-from-boot" Unharmed: "from its start on, all frames come 0.5 s late", "all lines come 0.5 s late";
    HeldWheels "held-wheels" EndsAtRest: "the wheels stand, and their motors draw the current of held ones", "the wheels stand and are said to be held";
    RangeLate "range-late" Unharmed: "ultrasonic and infrared readings come 1 s late", "ranges and scans come 1 s late";
    RangeNear "range-near" Unharmed: "the last ultrasonic bytes that are distances repeat within 3 cm", "the last ranges repeat within 3 cm, the last scan within 0.5 %";
    RangeRandom "range-random" Unharmed: "random ultrasonic bytes", "random ranges and beams";
    RangeDeaf "range-deaf" Unharmed: "every ultrasonic byte is 255 while a wheel turns", "every range and beam is null while a wheel turns";
    LateMidway "late-midway" Unharmed: "all frames come 0.5 s late", "all lines come 0.5 s late";
    Garbage "garbage" Rests(RobotLost): NOTHING, "half of each line is missing, so none is JSON";
}

impl Promise {
    /// The greatest time from the fault to rest, seconds; none if the robot may go on. A fault begins between two frames.
    pub fn rest_within_s(self, mission: &Mission) -> Option<f64> {
        let (stop, shows_after_s) = match self {
            Self::RestsAtOnce => (Some(Stop::known_after(0.0, mission)), 0.0),
            Self::Rests(cause) => (Stop::by(cause, mission), 0.0),
            Self::RestsLater(cause) => (Stop::by(cause, mission), SHOWS_AFTER_S),
            Self::Unharmed | Self::EndsAtRest => (None, 0.0),
        };
        Some(stop?.rest_s + shows_after_s + 1.0 / mission.robot.rate_hz)
    }
}

impl fmt::Display for Promise {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::RestsAtOnce => to.write_str("rests at once"),
            Self::Rests(cause) => write!(to, "rests: {}", cause.name()),
            Self::RestsLater(cause) => write!(to, "rests later: {}", cause.name()),
            Self::Unharmed => to.write_str("unharmed"),
            Self::EndsAtRest => to.write_str("ends at rest"),
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
            // ROS 2 has no other word than speed 0 that stops a robot.
            Protocol::Ros2 if matches!(self, Self::DoesNotStop | Self::IgnoresZero) => NOTHING,
            Protocol::Json | Protocol::Ros2 => row.json,
            Protocol::Arduino => NOTHING,
        };
        does != NOTHING
    }

    /// The greatest time from the fault to rest for good of a robot that speaks `protocol`, seconds; none if the robot may go on.
    pub fn rest_within_s(self, mission: &Mission, protocol: Protocol) -> Option<f64> {
        let promised_s = self.row().promise.rest_within_s(mission)?;
        if (self, protocol) != (Self::FramesLate, Protocol::Ros2) {
            return Some(promised_s);
        }
        // What comes late has fresh stamps there: the robot rests while nothing comes and goes on when frames come. They show that it
        // came to rest, and then that its wheels do not follow its commands.
        let follows_not_s = Promise::Rests(Cause::OdometryImplausible).rest_within_s(mission)?;
        Some(promised_s + LATE.as_secs_f64() + follows_not_s)
    }

    /// Whether the robot has the fault from its start on.
    pub const fn begins_at_boot(self) -> bool {
        matches!(self, Self::LateFromBoot)
    }
}

impl Serialize for RobotFault {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(self.row().name)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn every_fault_from_which_the_robot_must_rest_has_a_time_which_grows_with_a_slower_base() {
        let mission = |text: &str| {
            let text = format!("target = [3, 0]\n{text}");
            Mission::parse(&text, Path::new("m.toml")).unwrap()
        };
        let light = mission("");
        let heavy = mission("robot.response = { delay_s = 0.3, acceleration_m_s2 = 0.6 }");
        for Row { name, promise, .. } in TABLE {
            let times = [&light, &heavy].map(|mission| promise.rest_within_s(mission));
            match promise {
                Promise::Unharmed | Promise::EndsAtRest => assert_eq!(times, [None; 2], "{name}"),
                _ => assert!(times[0].unwrap() + 0.3 < times[1].unwrap(), "{name}: {times:?}"),
            }
        }
    }

    #[test]
    fn a_robot_whose_late_frames_have_fresh_stamps_is_given_the_time_in_which_they_come_and_are_found_out()
     {
        let mission = Mission::parse("target = [3, 0]", Path::new("m.toml")).unwrap();
        let within_s = |fault: RobotFault, protocol| fault.rest_within_s(&mission, protocol);
        let [json, ros2] = [Protocol::Json, Protocol::Ros2]
            .map(|protocol| within_s(RobotFault::FramesLate, protocol).unwrap());
        assert!((json + 3.0..json + 4.0).contains(&ros2), "{json} {ros2}");
        let silence = within_s(RobotFault::Silence, Protocol::Ros2);
        assert_eq!(silence, within_s(RobotFault::Silence, Protocol::Json));
        assert_eq!(within_s(RobotFault::RangeLate, Protocol::Ros2), None);
    }

    #[test]
    fn the_guides_table_is_this_one() {
        let guide = include_str!("../../../../supervisor/guide/break-it.md");
        for row in TABLE {
            let Row { name, x80, json, promise, .. } = row;
            let line = format!("| `{name}` | {x80} | {json} | {promise} |\n");
            assert!(guide.contains(&line), "missing in break-it.md: {line}");
        }
    }
}
