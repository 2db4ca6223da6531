use crate::{Mission, MissionError};

/// Parses `text` as m.toml, after a line with a target unless it has one or begins with a
/// description.
pub(crate) fn parse(text: &str) -> Result<Mission, MissionError> {
    let is_whole =
        text.starts_with("description") || text.lines().any(|it| it.starts_with("target"));
    let line = if is_whole { "" } else { "target = [3, 0]\n" };
    Mission::parse(&format!("{line}{text}"), "m.toml")
}

#[track_caller]
pub(crate) fn mission(text: &str) -> Mission {
    parse(text).unwrap_or_else(|error| panic!("{text}: {error}"))
}

/// Asserts that a mission written out reads back the same, and returns it.
#[track_caller]
pub(crate) fn read_back(text: &str) -> Mission {
    let read = mission(text);
    assert_eq!(mission(&toml::to_string(&read).unwrap()), read, "{text}");
    read
}

#[track_caller]
pub(crate) fn assert_refused<T: AsRef<str>, const N: usize>(cases: [(T, &str); N]) {
    for (text, words) in cases {
        let text = text.as_ref();
        let refusal = parse(text).expect_err(text).to_string();
        assert!(refusal.contains(words), "{text:?} gave {refusal:?}");
    }
}

#[track_caller]
pub(crate) fn close(got: f64, want: f64) {
    assert!((got - want).abs() < 1e-12, "got {got}, want {want}");
}

pub(crate) fn laser(name: &str, keys: &str) -> String {
    format!(
        "[[robot.sensor]]\nname = '{name}'\nkind = 'scan'\nforward_m = 0\nbearing_deg = 0\n{keys}\n"
    )
}
