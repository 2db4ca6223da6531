use common::mission::{Mission, Realism};

/// Returns a mission with a target aside and these lines.
pub fn mission(text: &str) -> Mission {
    Mission::parse(&format!("target = [0, -5]\n{text}"), "test.toml").unwrap()
}

/// Returns a mission with ideal sensors and wheels, unless `text` names a realism.
pub fn ideal(text: &str) -> Mission {
    let mut mission = mission(text);
    if !text.contains("realism") {
        mission.simulation.realism = Realism::Laboratory;
    }
    mission
}

#[track_caller]
pub fn near(got: f64, want: f64, within: f64) {
    assert!((got - want).abs() <= within, "{got} instead of {want}, within {within}");
}
