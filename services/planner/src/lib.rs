//! Planner stage: hazard cells in, guidance out, equation (11).
//!
//! The library `harmonic` solves the field. [`step`] is pure, [`stage`] records and publishes it,
//! [`shell`] is the process, and [`background_solver`] solves large maps on a thread.

mod active_sensing;
mod aim;
mod arcs;
mod background;
mod background_solver;
mod evasion;
mod fault;
mod field_publisher;
mod motion;
mod near_echoes;
mod outline;
pub mod shell;
pub mod stage;
pub mod step;
mod undetected_surfaces;
mod view;

#[cfg(test)]
mod testing;
