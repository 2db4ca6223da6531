//! The harmonic planner: hazard cells to a guidance field, equation (11).
//!
//! On a map of cells, u is 1 at the target, 0 on every blocked cell and outside the map, and elsewhere the mean of its
//! four neighbours divided by (1 + k), k >= 0 being the cell's absorption. u is the probability that a random walk meets
//! the target before it meets a hazard or is absorbed; its gradient, normalised, is the guidance. u falls by orders of
//! magnitude a metre, far below the smallest `f64`, so it is stored as mantissa and exponent, and the guidance is computed
//! from ratios of neighbouring cells.
//!
//! The library is pure: no shared memory, no files, no clock, no threads unless [`Settings::threads`] asks for them.
//! Around it stands the stage: [`step`], pure too, and [`shell`], which wires it to the topics.
//!
//! # Frames and units
//! Cells are named by column and row; positions are continuous in cell units with the cell centres at the integers, so
//! the cell (c, r) covers c - 0.5 ..= c + 0.5. Directions are unit vectors (along growing columns, along growing rows).
//!
//! # Layout
//! - [`Domain`]: the map, the target and the absorption, validated once.
//! - [`Solver`]: a domain to a [`Field`]; keeps what it can reuse between solves.
//! - [`Field`]: u of every cell, with the [`Certificate`] of its verification.
//! - [`Guidance`]: the direction at any position, or the reason there is none.
//! - `testing` (feature of that name): generated maps and the slow reference.

pub mod beside;
mod cancellation;
mod domain;
mod error;
mod field;
mod guidance;
mod repair;
mod scaled;
pub mod shell;
mod solver;
pub mod step;
#[cfg(feature = "testing")]
pub mod testing;

pub use cancellation::Cancellation;
pub use domain::{Absorption, Cell, Change, Domain, MAX_ABSORPTION, MAX_SIDE};
pub use error::SolveError;
pub use field::{Certificate, Field, Method};
pub use guidance::Guidance;
pub use scaled::Scaled;
pub use solver::{Phase, Settings, Solver, Verdict};
