//! Walks from cell to cell through a window just solved: whether they get ahead.

use std::cmp::Ordering;

use super::window::{Step, Window};
use crate::cell::Cell;
use crate::field::Field;

/// Steps of a walk before it is taken for one that leads nowhere, as a multiple of the window's longer side.
const MOST_STEPS: usize = 16;

/// Whether walks from `cells`, all outside patches, come out of the patches higher than they went in: above u of the cell
/// they started from, which no patch changed. Then no walk can return to where it was. Tried one by one, from the highest
/// down, so a walk that meets an earlier one is done.
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

/// The walk from `start`, the window's `number`th.
fn ascends(field: &Field, window: &mut Window, start: Cell, number: u32) -> bool {
    let from = field.u(start);
    let (wide, high) = window.size();
    let mut here = start;
    for _ in 0..MOST_STEPS * wide.max(high) {
        if here == field.target() {
            return true;
        }
        let next = match window.step(here, number) {
            Step::Proven => return true,
            Step::Again => return false,
            Step::To(next) => Some(next),
            Step::Inside => field.ascent(here),
            Step::Beyond if is_outside(field, here) && field.u(here) > from => return true,
            Step::Beyond => field.ascent(here),
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
