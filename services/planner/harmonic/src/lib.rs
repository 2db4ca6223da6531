#![doc = include_str!("../README.md")]
//!
//! # The problem
//! A robot on a map of cells wants a direction wherever it stands, such that following it ends at the target and never
//! touches an obstacle. Potential functions built from attraction and repulsion have local maxima in which a robot stays for
//! ever. A harmonic function has none: inside the free space it takes neither a maximum nor a minimum, so steepest ascent
//! from any cell that can reach the target ends there.
//!
//! # The equation
//! u is 1 at the target and 0 on every blocked cell and outside the map. On every other cell it is the mean of its four
//! neighbours, divided by 1 + k:
//!
//! ```text
//! u(c, r) = (u(c - 1, r) + u(c + 1, r) + u(c, r - 1) + u(c, r + 1)) / (4 (1 + k))
//! ```
//!
//! With k = 0 this is the five-point form of Laplace's equation. With k > 0 it is the screened equation,
//! laplacian u = u / L^2, in which u falls by a further factor of e in the screening length L; [`Screening`] states L, and
//! k = (h / (2 L))^2 on cells of side h. A short screening length makes the field prefer short ways over wide ones.
//!
//! k may differ from cell to cell ([`Domain::with_costs`]): the field leads round cells that cost more.
//!
//! u is the probability that a random walk from the cell meets the target before it meets a blocked cell. The walk steps to each
//! neighbour with equal chance, and ends at every step with chance k / (1 + k). The normalised gradient of u is the guidance.
//!
//! # The range of u
//! In a corridor of width w, u falls like exp(-pi x / w): in a maze it reaches 1e-70000, and an `f64` ends at 1e-308. So u
//! is a [`Scaled`] number, a mantissa and an exponent of 32 bits. Directions are computed from ratios of neighbouring
//! cells, which are ordinary numbers however small u is. Fields that span less are stored as `f32` or `f64` with one common
//! exponent.
//!
//! # The solvers
//! [`Solver`] estimates the cost of each [`Method`] from the shape of the free space and falls back to the next one where a
//! field fails verification:
//! - Multigrid with interpolation by the equations (after Dendy's BoxMG): a few dozen sweeps' worth of work, where passages
//!   are wide. It is in `f32`, and in bands of u where u leaves that range; in `f64` where `f32` has too few digits.
//! - Multifrontal factorisation in order of distance from the target, in extended range: where passages are narrow; its cost
//!   does not depend on the range of u but grows with the square of the passages' width.
//!
//! # Verification
//! No field is handed out unless every cell was checked: the relative residual of its equation is at most 2e-5, and one of
//! its neighbours has a larger u. The first is relative to u of that cell, since a norm over the map says nothing about
//! cells where u is 1e-50; the second makes steepest ascent end at the target. And in every tile of 64 x 64 cells the sum of
//! the residuals is at most a hundredth of what bends the field there: small residuals of one sign would turn all directions
//! of a hall. Angles are not bounded by that; they are measured against exact solutions on thousands of maps.
//! [`Field::verification`] tells what was found; a solve that cannot be verified ends in [`SolveError::Unverified`].
//!
//! # Changes
//! A cell that becomes blocked or free alters u everywhere downstream, so the whole map is solved again. [`Domain::apply`]
//! changes the map, and [`Solver::solve_near`] starts from the field at hand, which saves most of the work. A map of
//! 512 x 512 cells takes some 4 ms on one core. On another thread, [`Cancellation`] stops a solve that nobody waits for.
//!
//! # Units and frames
//! Cells are named by column and row from 0; arrays are row-major. Positions are continuous in units of a cell, with the
//! centres at the integers: the cell (c, r) covers c - 0.5 ..= c + 0.5. Directions are unit vectors (along growing columns,
//! along growing rows). Angles are radians. Screening lengths are in cells, or in any unit the side of a cell is given in.
//!
//! # Errors
//! [`SolveError`] tells apart what is wrong with a map ([`MapEmpty`](SolveError::MapEmpty),
//! [`MapTooLarge`](SolveError::MapTooLarge), [`WrongLength`](SolveError::WrongLength), [`Outside`](SolveError::Outside),
//! [`TargetBlocked`](SolveError::TargetBlocked), [`ScreeningLength`](SolveError::ScreeningLength)) and why a solve has no
//! field ([`Cancelled`](SolveError::Cancelled), [`TooCostly`](SolveError::TooCostly),
//! [`Unverified`](SolveError::Unverified)). A position without a direction is no error: [`Guidance`] says which it is.
//!
//! # Layout
//! Each layer uses those above it in this list alone:
//! - Values: [`Cell`] and [`Change`] (`cell.rs`), [`Scaled`], [`Screening`], [`SolveError`], [`Cancellation`], [`Domain`];
//!   `real.rs` the two precisions, `simd.rs` vector instructions chosen at run time.
//! - Storage: u of a map (`store.rs`).
//! - The field: `verification.rs`, [`Field`], [`Guidance`], `path.rs`.
//! - Engines: `multigrid/`, `multigrid_bands.rs`, `multifrontal/`.
//! - [`Solver`] (`solver/`): the choice of a method, the solve.
//!
//! The feature `testing` adds a solver that is exact but slow. The library has no clock, files or unsafe code, and
//! starts no thread unless [`Settings::threads`] asks for threads; the same input gives the same field to the bit.
#![deny(missing_docs)]

mod cancellation;
mod cell;
mod domain;
mod error;
mod field;
mod guidance;
mod method;
mod multifrontal;
mod multigrid;
mod multigrid_bands;
mod path;
mod policy;
mod real;
mod scaled;
mod screening;
mod simd;
mod solver;
mod store;
#[cfg(feature = "testing")]
mod testing;
mod verification;

pub use crate::{
    cancellation::Cancellation,
    cell::{Cell, Change, MAX_SIDE},
    domain::Domain,
    error::SolveError,
    field::Field,
    guidance::Guidance,
    method::Method,
    policy::Policy,
    scaled::Scaled,
    screening::{MIN_SCREENING_CELLS, Screening},
    solver::{Phase, Settings, Solver},
    verification::Verification,
};
#[cfg(feature = "testing")]
pub use testing::solve_exactly;
