//! The grid of cells over the perimeter: its frame, and the parts of a map that samples carry.
//!
//! | file | holds |
//! |---|---|
//! | [`mission::grid`] | the state of a cell, windows of cells, cells and metres |
//! | `part.rs` | which part of which version of a map a sample carries |
//! | `replica.rs` | a follower's copy of a map, updated from such parts |

mod part;
mod replica;

pub use mission::grid::{Cell, CellState, GridFrame, MAX_CELLS, MIN_CELLS, Window};
pub use part::Part;
pub use replica::{Applied, Replica};

#[cfg(test)]
mod tests;
