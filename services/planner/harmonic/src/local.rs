//! Local updates: newly blocked and newly freed cells, repaired in a window around them.
//!
//! A hazard changes the field in a wake that grows with the room, so a local update cannot be right everywhere. It is
//! right near the change, it keeps every cell leading to the target, and it knows when that is not enough:
//! - [`window`] solves the window for u between what flows in and what flows out, and estimates from the rim how far off
//!   the directions beyond it are; the window grows until that is small.
//! - [`walks`] tries whether walks through the window still get ahead, where that is in doubt.
//! - [`patch`] keeps u as it was in each window. Across the outflow rim the ratios stay what they were, and windows that
//!   would touch are solved anew as one, from u as it was before any of them. So a walk outside all windows always climbs
//!   u of the last full solve, and each window is left higher, by that measure, than it is entered: the walk arrives.

mod paths;
mod window;

use crate::cell::Change;
use crate::domain::Domain;
use crate::field::Field;
use crate::patch::{Patch, Rect};
use crate::store::BLOCKED;
use window::{ErrorEstimate, Window, WindowError};

/// What an update did, and whether its field may be followed.
///
/// It speaks of this update alone: what an earlier one advised, or closed, holds until a full solve.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[must_use]
pub enum Verdict {
    /// The field is right: a full solve would change no direction that matters.
    Accurate,
    /// The field leads to the target from everywhere; a full solve would give better directions far away.
    FullSolveAdvised,
    /// The change closed (or opened) a passage: do not follow the field before a full solve.
    PassageClosed,
}

/// Widths and heights of the windows, cells. The larger ones are for changes that lie apart.
/// Halved again and again they keep whole vectors and end in few cells.
const SIDES: [usize; 7] = [48, 64, 96, 128, 192, 256, 384];

/// The largest window tried only because the estimate asks for more: a tick of the robot must not wait for a larger one.
const LARGEST_GROWN: usize = 96;

/// Cells between a change and the rim at least; the first window tried has about this much.
const MARGIN: usize = 24;

/// Estimates of the directions beyond the rim above this, in radians, make the window grow.
const ANGLE: f64 = 0.0175;

/// Beyond this many times that, a window half as wide again falls short more often than not: a full solve is advised at
/// once, if what flows in is known to within [`UPSTREAM_ANGLE`], or is so far off that the next window's seldom is.
const GROWTH_LIMIT: f64 = 4.0;

/// Estimates of the directions upstream above this, in radians, spoil the window itself.
const UPSTREAM_ANGLE: f64 = 0.3;

/// Beyond these ratios of u in the wake, after to before, a passage was closed or opened.
const OUTFLOW_RATIO: (f64, f64) = (0.02, 50.0);

/// Maps of at most this many cells are solved in full where a window does not do: that takes a millisecond.
const SMALL: usize = 1 << 14;

/// What came of growing a window.
enum Growth {
    /// The window of this index, the last that could be solved.
    Solved(usize, ErrorEstimate),
    /// The estimate asks for more than half of the map: a full solve costs no more.
    TooWide,
    /// The window's solution does not pass its check.
    NotConverged,
    /// No window could be solved.
    Failed,
}

/// What an update has to solve for.
struct Region {
    /// Around all of it: the changes, and those of the patches that were undone.
    area: Rect,
    /// Each on its own.
    rects: Vec<Rect>,
}

impl Region {
    /// A window of at least `least` cells either way, once no patch is near it: those that were are undone, to be solved
    /// again together with the change, which may bring others near. `None` if that is more than the largest window takes.
    fn place_window(&mut self, domain: &Domain, field: &mut Field, least: usize) -> Option<Rect> {
        loop {
            let reach = choose(domain, &self.area, least)?;
            let patches = field.patches_mut();
            let near = |patch: &Patch| patch.rect().touches(&reach);
            let Some(near) = patches.iter().position(near) else {
                return Some(reach);
            };
            let patch = patches.swap_remove(near);
            patch.restore(field.store_mut(), domain.width());
            self.area = self.area.union(patch.changed());
            self.rects.push(*patch.changed());
        }
    }
}

/// Whether a window half as wide again would not be worth its time, `before` being the angle of the one before: it does not
/// open a closed passage, and where the wake fills a hall it does not help either.
fn is_final(estimate: &ErrorEstimate, before: f64) -> bool {
    let out_of_reach = estimate.angle > GROWTH_LIMIT * ANGLE
        && !(UPSTREAM_ANGLE..2.0 * UPSTREAM_ANGLE).contains(&estimate.upstream);
    estimate.angle <= ANGLE
        || estimate.outflow_ratio.0 < OUTFLOW_RATIO.0
        || out_of_reach
        || estimate.angle > 0.7 * before
}

/// Windows kept between updates.
#[derive(Debug, Default)]
pub(crate) struct LocalUpdate {
    windows: Vec<Window>,
}

impl LocalUpdate {
    /// Repairs `field` after `changes`, which `domain` already has. `None` if a full solve is the cheaper.
    pub(crate) fn update(
        &mut self,
        domain: &Domain,
        field: &mut Field,
        changes: &[Change],
    ) -> Option<Verdict> {
        let mut region = Region {
            area: bounds(changes)?,
            rects: vec![bounds(changes)?],
        };
        let small = domain.blocked().len() <= SMALL;
        let mut least = 0;
        // What a window cannot tell, a larger one may.
        while let Some(reach) = region.place_window(domain, field, least) {
            if too_wide(domain, &reach) {
                return None;
            }
            least = reach.width.min(reach.height) + 1;
            let (window, estimate) = match self.grow(domain, field, &region.area, reach) {
                Growth::Solved(window, estimate) => (window, estimate),
                Growth::TooWide => return None,
                Growth::NotConverged => continue,
                Growth::Failed => break,
            };
            let closed = estimate.outflow_ratio.0 < OUTFLOW_RATIO.0
                || estimate.outflow_ratio.1 > OUTFLOW_RATIO.1;
            if closed && small {
                return None;
            }
            let window = &mut self.windows[window];
            let (wide, high) = window.size();
            least = wide.min(high) + 1;
            let patch = window.write(domain, field.store_mut(), region.area);
            field.patches_mut().push(patch);
            if closed {
                return Some(Verdict::PassageClosed);
            }
            if paths::all_ascend(field, window, estimate.ascents_to_check) {
                return Some(if estimate.angle > ANGLE {
                    Verdict::FullSolveAdvised
                } else {
                    Verdict::Accurate
                });
            }
            if choose(domain, &region.area, least).is_none() {
                return (!small).then_some(Verdict::PassageClosed);
            }
            // Undone again: the larger window touches it.
        }
        if small {
            return None;
        }
        // No window can tell. What is known must still hold: blocked cells are blocked.
        for rect in region.rects {
            mark(domain, field, &rect);
        }
        Some(Verdict::PassageClosed)
    }

    /// Solves windows of growing side until the estimate is small, or nothing wider can be solved.
    fn grow(&mut self, domain: &Domain, field: &Field, area: &Rect, reach: Rect) -> Growth {
        let mut next = Some(reach);
        let mut found = Growth::Failed;
        let mut angle = f64::INFINITY;
        while let Some(reach) = next {
            if too_wide(domain, &reach) {
                return Growth::TooWide;
            }
            if field
                .patches()
                .iter()
                .any(|patch| patch.rect().touches(&reach))
            {
                break;
            }
            let index = self.window((reach.width, reach.height));
            let at = (reach.col, reach.row);
            let estimate = match self.windows[index].solve(domain, field.store(), at, area) {
                Ok(estimate) => estimate,
                Err(WindowError::NotConverged) if matches!(found, Growth::Failed) => {
                    return Growth::NotConverged;
                }
                Err(_) => break,
            };
            let done = is_final(&estimate, angle);
            angle = estimate.angle;
            found = Growth::Solved(index, estimate);
            if done {
                break;
            }
            next = choose(domain, area, reach.width.min(reach.height) + 1)
                .filter(|reach| reach.width.max(reach.height) <= LARGEST_GROWN);
        }
        found
    }

    fn window(&mut self, size: (usize, usize)) -> usize {
        if let Some(index) = self.windows.iter().position(|window| window.size() == size) {
            return index;
        }
        self.windows.push(Window::new(size));
        self.windows.len() - 1
    }
}

/// Whether a window is more than half of the map.
fn too_wide(domain: &Domain, reach: &Rect) -> bool {
    2 * reach.width * reach.height > domain.blocked().len()
}

/// The smallest window of at least `least` cells either way that leaves a margin around `area`.
fn choose(domain: &Domain, area: &Rect, least: usize) -> Option<Rect> {
    let place = |start: usize, len: usize, end: usize| {
        let wanted = (len + 2 * MARGIN).max(least);
        let side = SIDES.into_iter().find(|&side| side >= wanted)?;
        (side <= end).then(|| {
            let first = (start + len / 2).saturating_sub(side / 2).min(end - side);
            (first, side)
        })
    };
    let (col, width) = place(area.col, area.width, domain.width())?;
    let (row, height) = place(area.row, area.height, domain.height())?;
    Some(Rect {
        col,
        row,
        width,
        height,
    })
}

/// The rectangle around all changes.
fn bounds(changes: &[Change]) -> Option<Rect> {
    let cell = |change: &Change| Rect {
        col: change.cell.col,
        row: change.cell.row,
        width: 1,
        height: 1,
    };
    changes.iter().map(cell).reduce(|a, b| a.union(&b))
}

/// Makes the cells of `rect` blocked or cut off in the field as they are blocked or free in the map, u staying elsewhere.
fn mark(domain: &Domain, field: &mut Field, rect: &Rect) {
    for row in rect.row..rect.row + rect.height {
        for index in row * domain.width() + rect.col..row * domain.width() + rect.col + rect.width {
            let stored = field.store().raw(index).0;
            if domain.blocked()[index] {
                field.store_mut().set(index, BLOCKED, 0);
            } else if stored < 0.0 {
                field.store_mut().set(index, 0.0, 0);
            }
        }
    }
}
