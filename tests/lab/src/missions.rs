//! Missions on many worlds, each through the real processes, judged by the ground truth.
//!
//! | module | holds |
//! |---|---|
//! | [`trial`] | a mission in a world, and the rules it is judged by |
//! | [`row`] | one mission's result, and its latencies |
//! | [`results`] | the directory of an evaluation, and its two CSV files |
//! | [`runner`] | the missions, several at a time |
//! | [`statistics`] | shares with their intervals, differences, medians |
//! | [`page`] | a page of results |
//!
//! Every setting runs on the same worlds with the same noise, so that results differ only by the setting.

pub mod page;
pub mod results;
pub mod row;
pub mod runner;
pub mod statistics;
pub mod trial;

/// The name of `firsthand`'s own planner.
pub const HARMONIC: &str = "harmonic";

/// Mission keys that are compared on the same worlds.
#[derive(Clone)]
pub struct Setting {
    pub name: String,
    /// The planner: [`HARMONIC`], or the executable in its place.
    pub planner: String,
    pub set: Vec<String>,
}
