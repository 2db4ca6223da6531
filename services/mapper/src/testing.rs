//! Set-ups of the tests.

use common::mission::Mission;
use glam::DVec2;

pub(crate) fn mission(text: &str) -> Mission {
    Mission::parse(text, "test.toml").unwrap()
}

/// Returns the range of a beam to the walls of a room around the origin.
pub(crate) fn range_in_room(half_m: DVec2, from: DVec2, along: DVec2) -> f64 {
    ((half_m * along.signum() - from) / along).min_element()
}
