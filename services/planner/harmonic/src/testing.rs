//! Generated maps of every kind, and a slow reference solver. Only tests and benchmarks use them.

mod exact;
mod maps;
mod random;
mod reference;

pub use exact::{Angles, exact};
pub use maps::{Kind, Map};
pub use random::Random;
pub use reference::{Reference, angle, follow};
