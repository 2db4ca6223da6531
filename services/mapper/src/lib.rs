//! On-demand safety map: range samples to hazard cells, equations (8)-(10), (18), (19).
//!
//! [`step`] is the pure mapper, [`stage`] records and publishes it, [`shell`] is its process.
//! `reading` transforms readings into the mission frame, and the models interpret them.
//! `evidence_grid` sums evidence, and `evidential` grows occupied cells by the body.
//! `scan_match` estimates poses by laser, from `scan_points` and known `surfaces`; `deskew` places
//! its scans.

mod clear_beams;
mod deskew;
mod evidence_grid;
mod evidential;
mod fault;
mod infrared_model;
mod laser_model;
mod movers;
mod reading;
mod scan_match;
mod scan_points;
pub mod shell;
mod sonar_model;
pub mod stage;
pub mod step;
mod surfaces;
#[cfg(test)]
mod testing;
