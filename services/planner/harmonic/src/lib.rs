//! Harmonic fields.
mod cancellation;
mod cell;
mod domain;
mod error;
mod field;
mod guidance;
mod local;
mod method;
mod multifrontal;
mod multigrid;
mod multigrid_bands;
mod patch;
mod real;
mod scaled;
mod screening;
mod simd;
mod solver;
mod store;
#[cfg(feature = "testing")]
pub mod testing;
mod verification;

pub use cancellation::Cancellation;
pub use cell::{Cell, Change, MAX_SIDE};
pub use domain::Domain;
pub use error::SolveError;
pub use field::Field;
pub use guidance::Guidance;
pub use local::Verdict;
pub use method::Method;
pub use scaled::Scaled;
pub use screening::{MIN_SCREENING_CELLS, Screening};
pub use solver::{Phase, Settings, Solver};
pub use verification::Verification;
