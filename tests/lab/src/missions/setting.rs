//! A setting: planner and mission keys that are compared on the same worlds.

/// The name of `firsthand`'s own planner.
pub const HARMONIC: &str = "harmonic";

/// The setting of all missions of a row of totals.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Setting {
    pub name: String,
    /// The planner: [`HARMONIC`], or the executable in its place.
    pub planner: String,
    pub set: Vec<String>,
}
