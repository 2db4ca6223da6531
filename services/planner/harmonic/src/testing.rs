//! Generated maps of every kind, and a slow reference to measure the solvers against. For tests and benchmarks only.

mod exact;
mod maps;
mod random;
mod reference;

pub use exact::{Angles, exact};
pub use maps::{Kind, Map};
pub use random::Random;
pub use reference::{Reference, angle, follow};
