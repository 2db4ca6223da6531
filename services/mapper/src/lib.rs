//! The on-demand safety map: range samples to hazard cells, equations (8)-(10), (18), (19).
//!
//! | module | holds |
//! |---|---|
//! | [`step`] | the mapper itself, pure: poses with ranges in, the window of the grid that changed out |
//! | `sonar_model` | every number of the sonar's inverse model |
//! | `infrared_model` | every number of the infrared rangers' model |
//! | `evidence_grid` | the occupancy evidence grid: evidence for and against every cell, and where the sonar looked |
//! | `reading` | the rows of the sensors: their readings, where they were taken |
//! | `clear_beams` | the newest readings as evidence of free ground, for the planner |
//! | `inflation` | occupied cells grown by the robot's body |
//! | `evidential` | evidence and inflation together: the evidential method's state of a cell |
//! | `fault` | hazard of injected faults |
//! | [`stage`] | what a recording holds of it, what it publishes and persists |
//! | [`shell`] | its process: reads the topics `pose`, `ranges` and `directive`, publishes keyframes |

mod clear_beams;
mod evidence_grid;
mod evidential;
mod fault;
mod inflation;
mod infrared_model;
mod laser_model;
mod reading;
mod scan_match;
pub mod shell;
mod sonar_model;
pub mod stage;
pub mod step;
