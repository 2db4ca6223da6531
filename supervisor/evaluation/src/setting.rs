//! What missions on the same worlds differ by.

/// The planner that is `firsthand`'s own.
pub const HARMONIC: &str = "harmonic";

/// What is set for all missions of a row of totals.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Setting {
    /// Its name.
    pub name: String,
    /// The planner: [`HARMONIC`], or the executable in its place.
    pub planner: String,
    /// KEY=VALUE over the mission.
    pub set: Vec<String>,
}
