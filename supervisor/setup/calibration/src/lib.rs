//! Calibration of a robot's wheels: their diameter ratio, the track on the ground, and their slip.
//!
//! In a calibration run, [`shell::Shell`] takes the place of the planner stage and orders loops
//! before a wall. Sweeps to and fro find the wall's normal. It shows how far the robot really
//! turned between two visits; the encoders show the nominal turn. The stage saves its findings in
//! each tick. The command reads them after the run.

pub mod gyro;
pub mod loops;
mod normal;
pub mod response;
pub mod script;
pub mod shell;
pub mod squares;
pub mod wall;
mod ways;

pub const PLANNER: &str = "calibration";
