//! Missions on many worlds, each through the real processes, judged by the ground truth.
//!
//! | module | contents |
//! |---|---|
//! | [`trial`] | a mission in a world, and its rules |
//! | [`row`] | one mission's result and latencies |
//! | [`results`] | the directory of an evaluation, and its CSV files |
//! | [`runner`] | the missions, several at a time |
//! | [`statistics`] | shares with intervals, differences, medians |
//! | [`page`] | a page of results |
//!
//! Every setting runs on the same worlds and noise, so that only the setting changes the results.

pub mod page;
pub mod results;
pub mod row;
pub mod runner;
pub mod statistics;
pub mod trial;

pub const HARMONIC: &str = "harmonic";

#[derive(Clone)]
pub struct Setting {
    pub name: String,
    /// [`HARMONIC`], or the executable of another planner.
    pub planner: String,
    pub set: Vec<String>,
}
