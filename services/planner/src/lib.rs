//! The planner stage: hazard cells in, guidance out, equation (11).
//!
//! The library `harmonic` solves the field; this crate is the stage around it.
//!
//! - [`step`]: follows the `grid`, has a field of it solved, answers a pose; pure.
//! - [`stage`]: what a recording holds of it, and what it publishes.
//! - [`shell`]: its process.
//! - [`background_solver`]: the thread that solves large maps.

mod active_sensing;
mod aim;
mod arcs;
mod background;
pub mod background_solver;
mod fault;
mod field_publisher;
mod near_echoes;
pub mod shell;
pub mod stage;
pub mod step;
mod undetected_surfaces;
mod view;
