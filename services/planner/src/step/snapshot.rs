//! The field at one moment, from which the policy of every cell is computed while the planner goes on.

use std::sync::Arc;

use common::{
    grid::GridFrame,
    samples::{FieldCell, FieldHeader},
};
use harmonic::Field;

/// The field at one moment.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// The header of a `field` sample; stamp and part are still to be set.
    pub header: FieldHeader,
    /// Where its cells are.
    pub frame: GridFrame,
    pub(super) field: Arc<Field>,
}

impl Snapshot {
    /// The policy of every cell, row-major.
    pub fn cells(&self) -> Vec<FieldCell> {
        let mut cells = Vec::with_capacity(self.frame.area());
        for row in 0..self.frame.cells as usize {
            self.append_row(row, &mut cells);
        }
        cells
    }

    /// Append the policy of the cells of `row` to `cells`.
    pub fn append_row(&self, row: usize, cells: &mut Vec<FieldCell>) {
        self.field.policy_of_row(row, |policy| {
            let [ex, ey] = policy.direction.map(|component| component as f32);
            let log2_u = policy.log2_u as f32;
            cells.push(FieldCell { ex, ey, log2_u });
        });
    }
}
