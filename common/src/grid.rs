//! Grid of cells over the perimeter: its frame, the [`Part`] of a map in a sample, and a follower's
//! [`Replica`].

mod part;
mod replica;

pub use mission::grid::{Cell, CellState, GridFrame, MAX_CELLS, MIN_CELLS, Window};
pub use part::Part;
pub use replica::{Applied, Replica};

#[cfg(test)]
mod tests;
