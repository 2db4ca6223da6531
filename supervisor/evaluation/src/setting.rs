//! What missions on the same worlds differ by.

/// What is set for all missions of a row of totals.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Setting {
    /// Its name.
    pub name: String,
    /// The planner: `harmonic`, or the executable in its place.
    pub planner: String,
    /// KEY=VALUE over the mission.
    pub set: Vec<String>,
}
