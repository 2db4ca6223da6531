//! Set-ups of the tests.

use common::{
    clock::MissionTime,
    mission::Mission,
    samples::{CommandSample, RangeReading, RangeStatus},
    wire::COUNT_CYCLE,
};

pub(crate) const MS: u64 = 1_000_000;
/// Frame period of an X80, seconds.
pub(crate) const PERIOD_S: f64 = 1.0 / 7.0;

/// Returns a mission with a target and these lines.
pub(crate) fn mission(text: &str) -> Mission {
    Mission::parse(&format!("target = [3, 0]\n{text}"), "test.toml").unwrap()
}

pub(crate) const ARDUINO: &str = "robot.protocol = 'arduino'\nrobot.counts_per_turn = 1200\nrobot.rate_hz = 10\nrobot.arduino.sonars = { front = 4 }\n[[robot.sensor]]\nname = 'front'\nkind = 'cone'\nchannel = 1\nforward_m = 0.1\nbearing_deg = 0\n";

pub(crate) fn at(seconds: f64) -> MissionTime {
    MissionTime::from_seconds(seconds)
}

/// Returns the counts on the wire of an encoder that rolled so far.
pub(crate) fn on_wire(rolled: f64) -> u16 {
    rolled.rem_euclid(COUNT_CYCLE.into()) as u16
}

/// Returns a reading; None is nothing in range.
pub(crate) fn reading(sensor: u8, range_m: Option<f64>) -> RangeReading {
    let status = if range_m.is_some() { RangeStatus::Measured } else { RangeStatus::Nothing };
    let range_m = range_m.unwrap_or_default();
    RangeReading { sensor, range_m, status: status.into(), ..RangeReading::default() }
}

pub(crate) fn turning(left_rad_s: f64, right_rad_s: f64) -> CommandSample {
    CommandSample { left_rad_s, right_rad_s, ..CommandSample::default() }
}

#[track_caller]
pub(crate) fn near(got: f64, want: f64, within: f64) {
    assert!((got - want).abs() <= within, "{got} instead of {want}, within {within}");
}
