//! Calibration of a robot's wheels: their diameter ratio, the track on the ground, and their slip.
//!
//! In a calibration run, [`shell::Shell`] takes the place of the planner stage and orders loops
//! before a wall. Sweeps to and fro find the wall's normal. It shows how far the robot really
//! turned between two visits; the encoders show the nominal turn. The stage saves its findings in
//! each tick. The command reads them after the run.
//!
//! | module | holds |
//! |---|---|
//! | [`wall`] | procedure before a wall |
//! | `ways` | nominal wheel distances from counts |
//! | `normal` | the wall's normal from a sweep |
//! | [`loops`] | ratio, track and slip from loops; refusals |
//! | [`gyro`] | ratio and track from a gyro |
//! | [`squares`] | ratio and track from the ends of squares, measured by tape |
//! | [`script`] | procedures of a bring-up, turns and squares |
//! | [`response`] | delay and acceleration from turns to and fro |
//! | [`shell`] | process in the planner's place |

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
