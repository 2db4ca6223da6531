//! Calibration: the differences between a robot's wheels and nominal ones, which are their ratio, the track on the ground, and their slip.
//!
//! A calibration is a run whose planner stage is [`shell::Shell`]. It orders loops before a wall. The normal of the wall, found by turning
//! to and fro, shows how far the robot really turned between two visits, and the encoders show how far it turned by them. The stage saves
//! its findings in each tick, and the command reads them when the run has ended.
//!
//! | module | holds |
//! |---|---|
//! | [`wall`] | the procedure before a wall: a step for each tick, pure |
//! | `ways` | nominal ways of the wheels from their counts |
//! | `normal` | the normal of the wall from the echoes of a sweep |
//! | [`loops`] | ratio, track and slip from the loops, and what is refused; pure |
//! | [`squares`] | ratio and track from squares whose ends were measured by tape; pure |
//! | [`shell`] | the process that takes the place of the planner |

pub mod loops;
mod normal;
pub mod shell;
pub mod squares;
pub mod wall;
mod ways;

/// The name of the planner stage that calibrates, in `planner.executable`.
pub const PLANNER: &str = "calibration";
