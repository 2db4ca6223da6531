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
//! - [`Domain`] (`domain.rs`): the map, the target and the absorption, validated once.
//! - [`Solver`] (`solver/`): a domain to a [`Field`], by multigrid where the map is wide and by elimination where it is
//!   narrow; keeps what it can use again. Every field is verified cell by cell before it is handed out.
//! - [`Field`] (`field.rs`): u of every cell, with the [`Certificate`] of its verification.
//! - [`Solver::update`] (`repair/`): a field after a few cells changed, and a [`Verdict`] on how far to trust it.
//! - [`Guidance`] (`guidance.rs`): the direction at any position, or the reason there is none.
//! - `testing` (feature of that name): generated maps and the slow reference.
//!
//! # Example
//! ```
//! use planner::{Cancellation, Cell, Change, Domain, Guidance, Solver};
//!
//! // Twenty by ten free cells, the target near the right end.
//! let mut domain = Domain::new(20, 10, vec![false; 200], Cell::new(17, 5))?;
//! let mut solver = Solver::default();
//! let mut field = solver.solve(&domain, &Cancellation::new())?;
//! assert!(matches!(field.guidance(3.2, 5.0), Guidance::Along([x, _]) if x > 0.9));
//!
//! // A hazard appears; the field is brought up to date.
//! let hazard = [Change { cell: Cell::new(10, 5), blocked: true }];
//! let _verdict = solver.update(&mut domain, &mut field, &hazard, &Cancellation::new())?;
//! assert!(field.is_blocked(Cell::new(10, 5)));
//! # Ok::<(), planner::SolveError>(())
//! ```

mod active_sensing;
pub mod background_solver;
mod cancellation;
mod domain;
mod error;
mod fault;
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
