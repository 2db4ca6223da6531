//! Local updates: the field in a window around newly blocked and newly freed cells, solved again.
//!
//! A change alters u everywhere downstream of it, so a local update cannot be right everywhere. Steepest ascent still ends at
//! the target from every cell; where directions may be trusted until a full solve, the field computes from what the
//! windows' rims tell ([`mod@trust`]).
//! - [`window`] solves for u in a window, between inflow and outflow at its rim.
//! - [`mod@estimate`] reads from the rim how far off directions beyond it are; the window grows until that is small.
//! - [`paths`] checks that paths of steepest ascent through windows still ascend.
//!
//! # Why steepest ascent ends at the target
//! A [`Patch`] keeps u of its window before the update. Call u of the last full solve, without any patch, the base. Patches
//! do not touch (windows that would touch are solved again as one), and across an outflow edge the ratio of u stays
//! that of the base. A cycle of steepest ascent would pass cells outside all patches, since u climbs inside each. Take the
//! one of them with the largest base u. Its next cell is either outside too, with a larger base u; or it enters a patch at
//! a cell whose u is above its own, from where u climbs until the path leaves across an inflow edge to a cell of larger base
//! u; or it enters at a cell whose u is now below its own, and such paths are followed, those of all patches after every
//! update, until they are outside all patches at a larger base u. So there is no such cell, and no cycle.

mod estimate;
mod paths;
mod trust;
mod window;

use crate::cell::Change;
use crate::domain::Domain;
use crate::field::Field;
use crate::patch::{Patch, Rect};
use crate::store::BLOCKED;
use estimate::{ErrorEstimate, estimate};
use window::{Window, WindowError};

/// What an update did, and whether its field may be followed.
///
/// It speaks of this update alone: what an earlier one closed holds until a full solve.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[must_use]
pub enum Verdict {
    /// The whole map was solved, or nothing changed: every direction is verified.
    Solved,
    /// A window was solved: steepest ascent leads to the target from everywhere, and directions may be trusted where
    /// [`Field::is_trusted`] says so. A full solve must follow.
    Provisional,
    /// The change closed (or opened) a passage: do not follow the field before a full solve.
    PassageClosed,
}

/// Widths and heights of the windows, cells: multiples of high powers of two, which coarsen well. The larger ones are for
/// changes that lie apart.
const SIDES: [usize; 7] = [48, 64, 96, 128, 192, 256, 384];

/// The largest side a window grows to because of the estimate: larger ones take longer than a control period.
const LARGEST_GROWN: usize = 96;

/// Least distance of a change from the rim, cells; about that of the first window tried.
const MARGIN: usize = 24;

/// Estimated error of directions beyond the rim, radians, above which the window grows.
const ANGLE: f64 = 0.0175;

/// At more than this multiple of [`ANGLE`] a window half as wide again is seldom enough: the window grows no further, if the
/// upstream error is below [`UPSTREAM_ANGLE`] or above twice that.
const GROWTH_LIMIT: f64 = 4.0;

/// Estimated error of directions upstream, radians, above which directions in the window itself are too far off.
const UPSTREAM_ANGLE: f64 = 0.3;

/// Ratios of u on the outflow rim, after to before, beyond which a passage was closed or opened.
const OUTFLOW_RATIO: (f64, f64) = (0.02, 50.0);

/// The outcome of growing a window.
enum Growth {
    /// The window of this index, the last that could be solved.
    Solved(usize, ErrorEstimate),
    /// The estimate asks for more than half of the map: a full solve costs no more.
    TooWide,
    /// The window's solution does not converge or pass its verification.
    NotConverged,
    /// No window could be solved.
    Failed,
}

/// The changes an update has to take in.
struct Region {
    /// The rectangle around all of them.
    area: Rect,
    /// The rectangle of this update's changes, then those of the patches that were undone.
    rects: Vec<Rect>,
}

impl Region {
    /// A window of at least `least` cells either way that touches no patch: patches it would touch are undone and their
    /// changes taken in, which may make it touch others. `None` if the region outgrows the largest window.
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

/// Whether a larger window would not improve the estimate enough, `before` being the angle of the window before: it does not
/// open a closed passage, and does not help either where the change alters all of a hall downstream.
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
    /// Updates `field` after `changes`, which `domain` already has. `None` if a full solve is cheaper.
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
        let mut least = 0;
        // Where a window is not enough, a larger one may be.
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
            let window = &mut self.windows[window];
            let (wide, high) = window.size();
            least = wide.min(high) + 1;
            let patch = window.write(domain, field.store_mut(), region.area, estimate.rim);
            field.patches_mut().push(patch);
            if closed {
                return Some(Verdict::PassageClosed);
            }
            if paths::all_ascend(field, window) {
                return Some(Verdict::Provisional);
            }
            if choose(domain, &region.area, least).is_none() {
                return Some(Verdict::PassageClosed);
            }
            // The larger window touches the patch just written and undoes it.
        }
        // No window is enough. Blocked cells must still be blocked in the field.
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
                Ok(()) => estimate(&self.windows[index]),
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

/// Marks cells of `rect` blocked in the map as blocked in the field, and freed ones as cut off; u of the others stays.
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
