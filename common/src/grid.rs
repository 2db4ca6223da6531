//! The grid of cells over the perimeter: [`mission::grid`] has states, windows and frames of cells; a [`Part`] says which part of which
//! version of a map a sample carries, and a [`Replica`] is a follower's copy, updated from such parts.

mod part;
mod replica;

pub use mission::grid::{Cell, CellState, GridFrame, MAX_CELLS, MIN_CELLS, Window};
pub use part::Part;
pub use replica::{Applied, Replica};

#[cfg(test)]
mod tests;
