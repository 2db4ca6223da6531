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
//! | [`squares`] | ratio and track from squares measured by tape |
//! | [`bring_up`] | the procedure of a bring-up |
//! | [`response`] | delay and acceleration from turns to and fro |
//! | [`shell`] | the process in the planner's place |

pub mod bring_up;
pub mod loops;
mod normal;
pub mod response;
pub mod shell;
pub mod squares;
pub mod wall;
mod ways;

pub const PLANNER: &str = "calibration";
