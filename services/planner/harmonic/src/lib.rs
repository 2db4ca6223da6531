#![doc = include_str!("../README.md")]
//!
//! # Problem
//!
//! A robot on a grid map needs a direction at every position. The directions shall lead to the
//! target and away from obstacles. A harmonic function takes its extrema on the boundary of the
//! free space only. Steepest ascent therefore reaches the target from every connected cell.
//!
//! # Equation
//!
//! u is 1 at the target and 0 on blocked cells and outside the map. Elsewhere, u is the mean of its
//! four neighbours divided by 1 + k:
//!
//! ```text
//! u(c, r) = (u(c - 1, r) + u(c + 1, r) + u(c, r - 1) + u(c, r + 1)) / (4 (1 + k))
//! ```
//!
//! - k = 0 gives the five-point form of Laplace's equation.
//! - k > 0 gives the screened equation, laplacian u = u / L^2. u falls by a further factor of e per
//!   screening length L, and k = (h / (2 L))^2 on cells of side h. [`Screening`] sets L. A short L
//!   prefers short ways over wide ones.
//! - [`Domain::with_costs`] sets k per cell, and the field leads around expensive cells.
//!
//! u is also the probability that a random walk meets the target before a blocked cell. The walk
//! steps to each neighbour with equal chance and ends at every step with chance k / (1 + k).
//! Guidance follows equation (11): grad u / |grad u|.
//!
//! # Range of u
//!
//! In a corridor of width w, u falls like exp(-pi x / w). A maze reaches 1e-70000, while an `f64`
//! ends at 1e-308. [`Scaled`] therefore holds u as a mantissa with a 32-bit exponent. Directions
//! use ratios of neighbouring cells, which fit an `f64`. Fields of smaller range are stored as
//! `f32` or `f64` with one common exponent.
//!
//! # Solvers
//!
//! [`Solver`] estimates the cost of each [`Method`] from the shape of the free space. If a field
//! fails verification, it tries the next method.
//!
//! - Multigrid, after Dendy's BoxMG, suits wide passages. It takes the work of a few dozen sweeps.
//!   It runs in `f32`, in bands of u beyond the range of `f32`, and in `f64` where `f32` has too
//!   few digits.
//! - Multifrontal factorisation suits narrow passages. It eliminates cells by distance from the
//!   target, in extended range. Its cost is independent of the range of u and grows with the square
//!   of the passage width.
//!
//! # Verification
//!
//! A returned field has passed three checks. The first two cover every reachable cell except the
//! target.
//!
//! - The residual of the equation is at most 2e-5 of u in that cell.
//! - A neighbour has a larger u, so steepest ascent ends at the target.
//! - In every tile of 64 x 64 cells, the summed relative residuals explain at most 1 % of the
//!   curvature of the field. Small residuals of one sign would otherwise turn all directions of a
//!   hall.
//!
//! The checks leave angle errors unbounded. Benchmarks measure angles against exact solutions on
//! thousands of maps. [`Field::verification`] returns the findings.
//!
//! # Map changes
//!
//! A cell that becomes blocked or free changes u everywhere downstream, so the whole map is solved
//! again. [`Domain::apply`] changes the map. [`Solver::solve_near`] starts from the previous field,
//! which saves most of the work. A map of 512 x 512 cells takes some 4 ms on one core.
//! [`Cancellation`] stops an obsolete solve on another thread.
//!
//! # Units and frames
//!
//! - Cells: column and row from 0. Arrays are row-major.
//! - Positions: continuous, in units of a cell. Cell (c, r) covers c - 0.5 ..= c + 0.5, with its
//!   centre at (c, r).
//! - Directions: unit vectors (along growing columns, along growing rows).
//! - Angles: radians.
//! - Screening lengths: cells, or the unit of the cell side.
//!
//! # Errors
//!
//! [`SolveError`] covers invalid maps and solves without a field.
//!
//! Every position gets an answer: [`Guidance`] names the reason where a direction is missing.
//!
//! # Layout
//!
//! Each layer uses only the layers above it in this list:
//!
//! - Values: [`Cell`] and [`Change`] (`cell.rs`), [`Scaled`], [`Screening`], [`SolveError`],
//!   [`Cancellation`], [`Domain`], `real.rs` (both precisions), `simd.rs` (vector instructions
//!   chosen at run time).
//! - Storage: `store.rs` (u of a map).
//! - Field: `verification.rs`, [`Field`], [`Guidance`], `path.rs`.
//! - Engines: `multigrid/`, `multigrid_bands.rs`, `multifrontal/`.
//! - [`Solver`] (`solver/`): choice of a method, solve.
//!
//! The feature `testing` adds an exact but slow solver. The library uses neither clock, files nor
//! unsafe code. It starts threads only if [`Settings::threads`] exceeds one. The same input gives
//! the same field to the bit.
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
    solver::{Settings, Solver},
    verification::Verification,
};
#[cfg(feature = "testing")]
pub use testing::solve_exactly;
