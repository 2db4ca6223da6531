//! The planner stage: hazard cells in, guidance out, equation (11).
//!
//! The field itself is the library `harmonic`; here is the stage around it.
//!
//! - [`step`]: follows the `grid`, keeps the field up to date, answers for a pose; pure.
//! - [`shell`]: wires it to the topics.
//! - [`background_solver`]: the thread of full solves beside the live field.

mod active_sensing;
mod aim;
mod arcs;
mod background;
pub mod background_solver;
mod fault;
mod field_publisher;
mod near_echoes;
pub mod replay;
mod scheduling;
pub mod shell;
pub mod step;
mod undetected_surfaces;
