//! Paths of steepest ascent through a window just solved: whether they ascend.

use std::cmp::Ordering;

use super::window::{Step, Window};
use crate::cell::Cell;
use crate::field::Field;

/// Steps after which a path counts as endless, as a multiple of the window's longer side.
const MOST_STEPS: usize = 16;

/// Whether the paths of steepest ascent from `cells`, all outside patches, leave the patches at a cell of higher u than the
/// cell they start from, u being unchanged at both. Then no path can return to where it was. Followed one by one, the
/// highest first, so a path that joins an earlier one ascends too.
pub(super) fn all_ascend(field: &Field, window: &mut Window, mut cells: Vec<Cell>) -> bool {
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
