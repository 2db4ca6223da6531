//! Paths of steepest ascent through a window just solved: whether they ascend.

use std::cmp::Ordering;

use super::window::{Step, Window};
use crate::cell::Cell;
use crate::field::Field;

/// Steps after which a path counts as endless, as a multiple of the window's longer side.
const MOST_STEPS: usize = 16;

/// Whether the paths of steepest ascent that enter a patch at a cell of lower u all come to a cell outside patches whose u is
/// higher than that of the cell they start from, u being unchanged at both. Those of earlier patches are followed again:
/// the patch of `window`, the last, may lie on their way. Followed one by one, the highest first, so a path that joins an
/// earlier one ascends too.
pub(super) fn all_ascend(field: &Field, window: &mut Window) -> bool {
    let entries = field
        .patches()
        .iter()
        .flat_map(|patch| &patch.rim().entries);
    let mut cells: Vec<Cell> = entries.copied().collect();
    cells.sort_by(|&a, &b| {
        let order = field.u(b).partial_cmp(&field.u(a));
        order.unwrap_or(Ordering::Equal)
    });
    window.reset_paths();
    (1..)
        .zip(cells)
        .all(|(number, start)| ascends(field, window, start, number))
}

/// Whether the path from `start`, the window's `number`th, ascends.
fn ascends(field: &Field, window: &mut Window, start: Cell, number: u32) -> bool {
    let from = field.u(start);
    let (wide, high) = window.size();
    let mut here = start;
    for _ in 0..MOST_STEPS * wide.max(high) {
        if here == field.target() {
            return true;
        }
        let next = match window.step(here, number) {
            Step::Joined => return true,
            Step::Cycle => return false,
            Step::To(next) => Some(next),
            Step::Rim => field.ascent(here),
            Step::Outside if is_outside(field, here) && field.u(here) > from => return true,
            Step::Outside => field.ascent(here),
        };
        match next {
            Some(next) => here = next,
            None => return false,
        }
    }
    false
}

fn is_outside(field: &Field, cell: Cell) -> bool {
    let at = (cell.col as i64, cell.row as i64);
    !field.patches().iter().any(|patch| patch.contains(at))
}
