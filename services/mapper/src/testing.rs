use common::mission::Mission;
use glam::DVec2;

pub(crate) fn mission(text: &str) -> Mission {
    Mission::parse(text, "test.toml").unwrap()
}

/// The room is around the origin.
pub(crate) fn range_in_room(half_m: DVec2, from: DVec2, along: DVec2) -> f64 {
    ((half_m * along.signum() - from) / along).min_element()
}
