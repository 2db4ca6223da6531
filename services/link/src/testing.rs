//! Set-ups of the tests.

use std::path::Path;

use common::mission::Mission;

/// Returns a mission with a target and these lines.
pub(crate) fn mission(text: &str) -> Mission {
    Mission::parse(&format!("target = [3, 0]\n{text}"), Path::new("test.toml")).unwrap()
}

pub(crate) const ARDUINO: &str = "robot.protocol = 'arduino'\nrobot.counts_per_turn = 1200\nrobot.rate_hz = 10\nrobot.arduino.sonars = { front = 4 }\n[[robot.sensor]]\nname = 'front'\nkind = 'cone'\nchannel = 1\nforward_m = 0.1\nbearing_deg = 0\n";

#[track_caller]
pub(crate) fn near(got: f64, want: f64, within: f64) {
    assert!((got - want).abs() <= within, "{got} instead of {want}, within {within}");
}
