//! Table of robot faults, and the promise under each.

use std::{f64::consts::TAU, sync::LazyLock};

use clap::ValueEnum;
use common::mission::{Mission, Protocol, Shove};
use glam::DVec2;
use link::failsafe::stop_distance::from_faults;
use serde::{Deserialize, Serialize};

use self::Promise::*;
use crate::random::Random;

/// Time until some faults show. Counts of 0 first look like a restart of the robot, and swapped
/// encoders show in turns. A robot that believes stuck ranges drives slowly, and slow frames leave
/// pauses.
const SHOWS_AFTER_S: f64 = 2.0;

#[derive(PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Promise {
    /// The robot rests with a reason as soon as the failsafe's rule for the cause allows, stays at
    /// rest, and touches nothing.
    Rests,
    /// As [`Promise::Rests`], but [`SHOWS_AFTER_S`] later.
    RestsLater,
    /// The robot touches nothing and never reports arrival in a wrong place: its data are poor, but
    /// true.
    Unharmed,
    /// As [`Promise::Unharmed`], and the robot rests when its mission ends.
    EndsAtRest,
}

#[derive(Deserialize)]
pub struct Row {
    pub name: String,
    pub promise: Promise,
    cause: Option<String>,
    /// Effect on an X80; [`NOTHING`] if the fault has no meaning there.
    x80: String,
    json: String,
}

const NOTHING: &str = "-";

/// Fault of a robot's data, described by [`TABLE`] in the same order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum RobotFault {
    Silence,
    MotorOnes,
    MotorZeros,
    MotorRepeated,
    EncoderDead,
    EncodersSwapped,
    EncoderReversed,
    EncoderLow,
    EncoderLower,
    EncoderRuns,
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
    RangeSilent,
    RangeFrozen,
    LateFromBoot,
    HeldWheels,
    RangeLate,
    RangeNear,
    RangeRandom,
    RangeDeaf,
    LateMidway,
    Garbage,
    CountsJump,
    GyroStops,
    GyroDrifts,
    GyroSaturates,
    SonarsDeaf,
    Ice,
    Pushed,
    Carried,
    FrontStuck,
    FrontWide,
    Drawn,
}

static TABLE: LazyLock<Vec<Row>> = LazyLock::new(|| {
    let rows = csv::Reader::from_reader(include_str!("robot_faults.csv").as_bytes());
    rows.into_deserialize().collect::<csv::Result<_>>().unwrap_or_default()
});

impl Row {
    /// Returns the maximum seconds from the fault to rest, including one frame; none if the robot
    /// may go on.
    pub fn rest_within_s(&self, mission: &Mission) -> Option<f64> {
        let by_cause = || {
            let mut causes = from_faults(mission).into_iter();
            Some(causes.find(|(cause, _)| self.cause.as_deref() == Some(cause.name()))?.1.rest_s)
        };
        let rest_s = match self.promise {
            Rests => by_cause()?,
            RestsLater => by_cause()? + SHOWS_AFTER_S,
            Unharmed | EndsAtRest => return None,
        };
        Some(rest_s + 1.0 / mission.robot.rate_hz)
    }
}

impl RobotFault {
    pub fn row(self) -> &'static Row {
        &TABLE[self as usize]
    }

    /// Returns whether a robot of this kind can have the fault, and tell motion that its wheels do
    /// not measure. Cars and Arduinos have none.
    pub fn has_meaning(self, mission: &Mission) -> bool {
        let row = self.row();
        let effect = match mission.robot.protocol() {
            Protocol::X80 => &row.x80,
            Protocol::Json => &row.json,
            Protocol::Arduino | Protocol::Ros2 => NOTHING,
        };
        let can_tell = match self {
            Self::GyroStops | Self::GyroDrifts | Self::GyroSaturates => mission.robot.gyro(),
            Self::Ice | Self::Pushed | Self::Carried => mission.laser().is_some(),
            _ => true,
        };
        effect != NOTHING && can_tell && mission.body().steering.is_none()
    }

    /// Returns what happens to the robot itself from `from_s` on.
    pub(crate) fn shove(
        self,
        from_s: f64,
        until_s: Option<f64>,
        random: &mut Random,
    ) -> Option<Shove> {
        let slips =
            Shove { from_s, until_s, slip: 0.0, velocity_m_s: DVec2::ZERO, turn_deg_s: 0.0 };
        let mut moves = |for_s: f64, [least_m, most_m]: [f64; 2]| {
            let way = DVec2::from_angle(TAU * random.share()) * random.within(least_m, most_m);
            Shove { until_s: Some(from_s + for_s), velocity_m_s: way / for_s, ..slips }
        };
        Some(match self {
            Self::Ice => Shove { slip: random.within(0.1, 0.3), ..slips },
            Self::Pushed => moves(0.6, [0.3, 0.8]),
            Self::Carried => {
                let carried = moves(3.0, [0.5, 2.0]);
                Shove { slip: 1.0, turn_deg_s: random.within(-45.0, 45.0), ..carried }
            }
            _ => return None,
        })
    }

    /// Returns whether the robot says what is not so, and not only late, seldom or not at all.
    pub(crate) const fn lies(self) -> bool {
        use RobotFault::*;
        !matches!(
            self,
            Silence
                | StreamsStop
                | FramesLate
                | FramesSlow
                | LateFromBoot
                | LateMidway
                | Garbage
                | HeldWheels
                | DoesNotStop
                | IgnoresZero
        )
    }

    /// Returns whether the robot keeps its speed when it is told to stand.
    pub(crate) const fn keeps_speed(self) -> bool {
        matches!(self, Self::DoesNotStop | Self::IgnoresZero)
    }
}

#[cfg(test)]
mod tests {

    use super::*;

    #[test]
    fn every_fault_from_which_the_robot_must_rest_has_a_time_which_grows_with_a_slower_base() {
        let mission = |text: &str| {
            let text = format!("target = [3, 0]\n{text}");
            Mission::parse(&text, "m.toml").unwrap()
        };
        let light = mission("");
        let heavy = mission("robot.response = { delay_s = 0.3, acceleration_m_s2 = 0.6 }");
        for row in &*TABLE {
            let name = &row.name;
            let times = [&light, &heavy].map(|mission| row.rest_within_s(mission));
            match row.promise {
                Unharmed | EndsAtRest => assert_eq!(times, [None; 2], "{name}"),
                _ => assert!(times[0].unwrap() + 0.3 < times[1].unwrap(), "{name}: {times:?}"),
            }
        }
    }

    #[test]
    fn every_fault_has_its_row_in_the_guides_table_too() {
        let guide = include_str!("../../../supervisor/guide/tables.md");
        assert_eq!(TABLE.len(), RobotFault::value_variants().len());
        for fault in RobotFault::value_variants() {
            let Row { name, promise, cause, x80, json } = fault.row();
            assert_eq!(fault.to_possible_value().unwrap().get_name(), name);
            let promise = match promise {
                Rests => "rests",
                RestsLater => "rests later",
                Unharmed => "unharmed",
                EndsAtRest => "ends at rest",
            };
            let cause = cause.as_ref().map(|cause| format!(": {cause}")).unwrap_or_default();
            let promise = format!("{promise}{cause}");
            let line = format!("| `{name}` | {x80} | {json} | {promise} |\n");
            assert!(guide.contains(&line), "missing in tables.md: {line}");
        }
    }
}
