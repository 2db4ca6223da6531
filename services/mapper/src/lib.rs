//! The on-demand safety map: range samples to hazard cells, equations (8)-(10), (18), (19).
//!
//! [`step`] is the pure mapper, [`stage`] records and publishes it, [`shell`] is its process. `reading` puts readings into the mission
//! frame, the models say what they mean for cells, `evidence_grid` sums that up, `inflation` grows occupied cells by the body, and
//! `evidential` joins both. `scan_match` gives poses by the laser, `deskew` lays its
//! scans where they were taken.

mod clear_beams;
mod deskew;
mod evidence_grid;
mod evidential;
mod fault;
mod inflation;
mod infrared_model;
mod laser_model;
mod movers;
mod reading;
mod scan_match;
pub mod shell;
mod sonar_model;
pub mod stage;
pub mod step;
