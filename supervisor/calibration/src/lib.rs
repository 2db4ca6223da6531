//! Calibration: the ratio of a robot's wheels, their track on the ground, and their slip.
//!
//! The planner stage of such a run is [`shell::Shell`]. It orders loops before a wall. The normal of the wall, found
//! by turning to and fro, shows how far the robot really turned between two visits, and the encoders show how far it
//! turned by them. The stage saves its findings in each tick, and the command reads them when the run has ended.
//!
//! | module | holds |
//! |---|---|
//! | [`wall`] | the procedure before a wall |
//! | `ways` | nominal ways from counts |
//! | `normal` | the wall's normal from a sweep |
//! | [`loops`] | ratio, track and slip from loops, and refusals |
//! | [`gyro`] | ratio and track from a gyro |
//! | [`squares`] | ratio and track from the ends of squares, measured by tape |
//! | [`script`] | the procedures of a bring-up, of turns and of squares |
//! | [`response`] | delay and acceleration from turns to and fro |
//! | [`shell`] | the process in the planner's place |

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
