//! Missions on many worlds, each in one process or through real ones, judged by the ground truth.
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
