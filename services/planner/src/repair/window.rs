//! The equations of one window of the map, between what flows in and what flows out.
//!
//! Across each edge of the window's rim, u flows from the larger side to the smaller (u as it was before the change).
//! Where it flows in, the cell outside keeps its u: the change is assumed not to reach upstream. Where it flows out, the
//! cell outside keeps its ratio to the cell inside: whatever changes in the window changes the wake in proportion. Holding
//! u itself there would put false maxima just outside.

use super::patch::{Patch, Rect};
use crate::domain::{Cell, Domain};
use crate::field::{BLOCKED, Store};
use crate::scaled::Scaled;
use crate::solver::certificate::{Check, check_framed};
use crate::solver::multigrid::Multigrid;

/// Coarse corrections above this share of u mean that a cell has not settled.
const TOLERANCE: f64 = 1e-3;

/// Cycles before a window is given up.
const CYCLES: usize = 24;

/// Binary orders of magnitude above and below u at the change that a window takes in. Cells beyond them are left outside as
/// if they lay beyond the rim: the next corridor of a maze may be 1e-45 of this one.
const SPAN: i32 = 80;

/// The largest relative residual of a repaired window. It holds only until the next full solve.
const RESIDUAL_LIMIT: f64 = 1e-3;

/// Arrays and levels for windows of one side, kept between updates.
#[derive(Debug)]
pub(super) struct Window {
    side: usize,
    levels: Multigrid<f32>,
    /// u before the change with one cell all around, relatively to 2^`reference`; 0 where blocked or cut off.
    before: Vec<f32>,
    /// u after it, the same way; around the window as seen from inside.
    after: Vec<f32>,
    /// Without the frame: 1 / diagonal, 0.25 / (1 + k), first guess and result.
    inverse: Vec<f32>,
    shares: Vec<f32>,
    values: Vec<f32>,
    /// Framed: cells the window is solved for, blocked ones included.
    taken: Vec<bool>,
    /// Framed: cells that what flows in can reach.
    fed: Vec<bool>,
    /// Free cells of the window with a neighbour it is not solved for.
    rim: Vec<u32>,
    stack: Vec<u32>,
    reference: i32,
    rect: Rect,
}

/// What a window's solution says of the world outside.
#[derive(Clone, Copy, Debug)]
pub(super) struct Judgement {
    /// Estimate of the angle, in radians, by which directions beyond the rim are off.
    pub angle: f64,
    /// The smallest and the largest ratio of u after to u before on the outflow rim.
    pub wake: (f64, f64),
    /// Whether every cell of the window leads to the target, as far as u before tells beyond the rim.
    pub sound: bool,
}

impl Window {
    pub(super) fn new(side: usize) -> Self {
        let framed = (side + 2) * (side + 2);
        Self {
            side,
            levels: Multigrid::new(side, side),
            before: vec![0.0; framed],
            after: vec![0.0; framed],
            inverse: vec![0.0; side * side],
            shares: vec![0.0; side * side],
            values: vec![0.0; side * side],
            taken: vec![false; framed],
            fed: vec![false; framed],
            rim: Vec::new(),
            stack: Vec::new(),
            reference: 0,
            rect: Rect {
                col: 0,
                row: 0,
                width: side,
                height: side,
            },
        }
    }

    pub(super) fn side(&self) -> usize {
        self.side
    }

    /// Solves the window at (`col`, `row`) for the map as it is now, `store` holding u as it was and `changed` having
    /// changed. `None` if the solution does not settle or fails its check.
    pub(super) fn solve(
        &mut self,
        domain: &Domain,
        store: &Store,
        (col, row): (usize, usize),
        changed: &Rect,
    ) -> Option<Judgement> {
        self.rect = Rect {
            col,
            row,
            width: self.side,
            height: self.side,
        };
        self.gather(domain, store, changed);
        if self.misses_a_change(domain) {
            return None;
        }
        let touches_lost = self.feed(domain);
        self.set_equations(domain);
        let mut settled = false;
        for cycle in 0..CYCLES {
            settled = self.levels.cycle(TOLERANCE).unsettled == 0;
            if settled && cycle > 0 {
                break;
            }
        }
        self.levels.finish();
        self.levels.unload(&mut self.values);
        self.frame(domain);
        let check: Check = check_framed(self.side, &self.after, &self.shares);
        let right = settled
            && !touches_lost
            && check.stalled == 0
            && check.lost == 0
            && check.worst_residual <= RESIDUAL_LIMIT;
        right.then(|| self.judge())
    }

    /// Writes u of the cells solved for to `store`; returns the patch that remembers what it was.
    pub(super) fn write(&self, domain: &Domain, store: &mut Store) -> Patch {
        let taken = (0..self.side * self.side)
            .map(|at| self.taken[self.framed(at)])
            .collect();
        let patch = Patch::of(self.rect, taken, store, domain.width());
        let target = domain.index(domain.target());
        for (at, &u) in self.values.iter().enumerate() {
            let index = self.map_index(domain, at);
            if index == target || !self.taken[self.framed(at)] {
                continue;
            }
            let (value, exponent) = if domain.blocked()[index] {
                (BLOCKED, 0)
            } else {
                (f64::from(u.max(0.0)), self.reference)
            };
            store.set(index, value, exponent);
        }
        patch
    }

    fn map_index(&self, domain: &Domain, at: usize) -> usize {
        (self.rect.row + at / self.side) * domain.width() + self.rect.col + at % self.side
    }

    /// Place in the framed arrays of a cell of the window.
    fn framed(&self, at: usize) -> usize {
        (at / self.side + 1) * (self.side + 2) + at % self.side + 1
    }

    /// Reads u as it was, window and frame, and decides which cells to solve for.
    fn gather(&mut self, domain: &Domain, store: &Store, changed: &Rect) {
        let (side, framed) = (self.side, self.side + 2);
        let (width, height) = (domain.width(), domain.height());
        let mut cells = Vec::with_capacity(framed * framed);
        for row in 0..framed {
            for col in 0..framed {
                // The frame may lie one cell outside the map.
                let (col, row) = (
                    (self.rect.col + col).wrapping_sub(1),
                    (self.rect.row + row).wrapping_sub(1),
                );
                let inside = col < width && row < height;
                cells.push(if inside {
                    let (value, exponent) = store.raw(row * width + col);
                    Scaled::new(value, exponent)
                } else {
                    Scaled::ZERO
                });
            }
        }
        // The change and one cell around it; the frame is one cell itself.
        let (first_col, first_row) = (changed.col - self.rect.col, changed.row - self.rect.row);
        let near = (first_row..first_row + changed.height + 2)
            .flat_map(|row| {
                (first_col..first_col + changed.width + 2).map(move |col| row * framed + col)
            })
            .filter_map(|f| cells.get(f));
        let exponents = |u: &Scaled| (!u.is_zero()).then_some(u.exponent);
        let centre = near
            .filter_map(exponents)
            .max()
            .or_else(|| cells.iter().filter_map(exponents).max());
        self.reference = centre.unwrap_or(0);
        for (f, u) in cells.iter().enumerate() {
            let distance = u.exponent.saturating_sub(self.reference);
            let clamped = Scaled {
                exponent: self.reference + distance.clamp(-126, 120),
                ..*u
            };
            self.before[f] = clamped.relative_to(self.reference) as f32;
            let inside = (1..=side).contains(&(f / framed)) && (1..=side).contains(&(f % framed));
            self.taken[f] = inside && (u.is_zero() || distance.abs() <= SPAN);
        }
        self.rim.clear();
        for at in 0..side * side {
            let free = self.taken[self.framed(at)] && !domain.blocked()[self.map_index(domain, at)];
            if free && self.outside(at).next().is_some() {
                self.rim.push(at as u32);
            }
        }
    }

    /// Whether a cell that was blocked since is not among those solved for: one change on both sides of a wall, say.
    fn misses_a_change(&self, domain: &Domain) -> bool {
        (0..self.side * self.side).any(|at| {
            let f = self.framed(at);
            !self.taken[f] && domain.blocked()[self.map_index(domain, at)]
        })
    }

    /// Marks the cells that what flows in can reach; true if that includes one beside a free cell of u = 0 outside, which
    /// is then cut off no longer.
    fn feed(&mut self, domain: &Domain) -> bool {
        let (side, framed) = (self.side, self.side + 2);
        self.fed.fill(false);
        self.stack.clear();
        let target = domain.index(domain.target());
        for at in 0..side * side {
            let index = self.map_index(domain, at);
            let f = self.framed(at);
            if domain.blocked()[index] || !self.taken[f] {
                continue;
            }
            let fed = index == target
                || self
                    .outside(at)
                    .any(|o| self.before[o] > 0.0 && self.before[o] > self.before[f]);
            if fed {
                self.fed[f] = true;
                self.stack.push(at as u32);
            }
        }
        let mut touches_lost = false;
        while let Some(at) = self.stack.pop() {
            let at = at as usize;
            let f = self.framed(at);
            for o in self.outside(at) {
                let (col, row) = (self.rect.col + o % framed, self.rect.row + o / framed);
                let free = !domain.is_blocked(Cell::new(col.wrapping_sub(1), row.wrapping_sub(1)));
                touches_lost |= free && self.before[o] == 0.0;
            }
            for (step, inside) in [
                (f - 1, !at.is_multiple_of(side)),
                (f + 1, at % side + 1 < side),
                (f - framed, at >= side),
                (f + framed, at + side < side * side),
            ] {
                if inside && self.taken[step] && !self.fed[step] {
                    let next = (step / framed - 1) * side + step % framed - 1;
                    if !domain.blocked()[self.map_index(domain, next)] {
                        self.fed[step] = true;
                        self.stack.push(next as u32);
                    }
                }
            }
        }
        touches_lost
    }

    /// Places of the neighbours of a cell that the window is not solved for.
    fn outside(&self, at: usize) -> impl Iterator<Item = usize> + use<> {
        let (framed, f) = (self.side + 2, self.framed(at));
        [f - 1, f + 1, f - framed, f + framed]
            .map(|o| (!self.taken[o]).then_some(o))
            .into_iter()
            .flatten()
    }

    /// Whether u flows from the window's rim cell out to `o` of the frame.
    fn flows_out(&self, f: usize, o: usize) -> bool {
        self.before[o] > 0.0 && self.before[f] > 0.0 && self.before[o] <= self.before[f]
    }

    fn set_equations(&mut self, domain: &Domain) {
        let side = self.side;
        let target = domain.index(domain.target());
        let mut inflow: Vec<(Cell, f32)> = Vec::new();
        for at in 0..side * side {
            let index = self.map_index(domain, at);
            let f = self.framed(at);
            let diagonal = 4.0 * (1.0 + domain.absorption_at(index)) as f32;
            self.shares[at] = 1.0 / diagonal;
            self.values[at] = if self.fed[f] { self.before[f] } else { 0.0 };
            if !self.fed[f] || index == target {
                self.inverse[at] = 0.0;
                continue;
            }
            self.inverse[at] = 1.0 / diagonal;
        }
        for &at in &self.rim {
            let at = at as usize;
            let f = self.framed(at);
            if self.inverse[at] == 0.0 {
                continue;
            }
            let mut rest = 1.0 / self.shares[at];
            for o in self.outside(at) {
                if self.flows_out(f, o) {
                    rest -= self.before[o] / self.before[f];
                } else if self.before[o] > 0.0 {
                    inflow.push((Cell::new(at % side, at / side), self.before[o]));
                }
            }
            self.inverse[at] = 1.0 / rest;
        }
        if let Some(at) = self.target(domain) {
            // The target's own equation does not hold: what it gives its neighbours flows in.
            let f = self.framed(at);
            let framed = side + 2;
            for next in [f - 1, f + 1, f - framed, f + framed]
                .into_iter()
                .filter(|&next| self.taken[next])
            {
                inflow.push((
                    Cell::new(next % framed - 1, next / framed - 1),
                    self.before[f],
                ));
            }
        }
        self.levels
            .load(&self.inverse, &self.values, inflow.into_iter());
    }

    /// Puts the solution in its frame, as seen from inside.
    fn frame(&mut self, domain: &Domain) {
        let side = self.side;
        self.after.copy_from_slice(&self.before);
        if let Some(target) = self.target(domain) {
            self.values[target] = self.before[self.framed(target)];
            self.shares[target] = 0.0;
        }
        for at in 0..side * side {
            let f = self.framed(at);
            if !self.taken[f] {
                self.shares[at] = 0.0;
            } else if domain.blocked()[self.map_index(domain, at)] {
                self.after[f] = -1.0;
            } else {
                self.after[f] = self.values[at];
            }
        }
        for &at in &self.rim {
            let at = at as usize;
            let f = self.framed(at);
            for o in self.outside(at) {
                if self.flows_out(f, o) {
                    self.after[o] = self.values[at] * (self.before[o] / self.before[f]);
                } else if !self.fed[f] {
                    // Not fed from here, so nothing flows in.
                    self.after[o] = 0.0;
                }
            }
        }
    }

    /// The target's place among the cells the window is solved for.
    fn target(&self, domain: &Domain) -> Option<usize> {
        let col = domain.target().col.checked_sub(self.rect.col)?;
        let row = domain.target().row.checked_sub(self.rect.row)?;
        let at = row * self.side + col;
        (col < self.side && row < self.side && self.taken[self.framed(at)]).then_some(at)
    }

    fn judge(&self) -> Judgement {
        let mut found = Judgement {
            angle: 0.0,
            wake: (f64::INFINITY, 0.0),
            sound: true,
        };
        for &at in &self.rim {
            let at = at as usize;
            let f = self.framed(at);
            if self.before[f] <= 0.0 {
                continue;
            }
            let ratio = f64::from(self.after[f]) / f64::from(self.before[f]);
            let steepness = self.steepness(f);
            for o in self.outside(at).filter(|&o| self.before[o] > 0.0) {
                if self.flows_out(f, o) {
                    found.wake = (found.wake.0.min(ratio), found.wake.1.max(ratio));
                    for beside in self.beside(f, o) {
                        if self.before[beside] > 0.0 && self.after[beside] > 0.0 {
                            let other =
                                f64::from(self.after[beside]) / f64::from(self.before[beside]);
                            let jump = (ratio - other).abs() / ratio.max(f64::MIN_POSITIVE);
                            found.angle = found.angle.max((jump / steepness).atan());
                        }
                    }
                    // From the wake into the window and out upstream: u before must have grown on the way, or the walk
                    // might come back.
                    if ratio * f64::from(self.before[f]) < f64::from(self.before[o]) {
                        found.sound &= self.exit(at) > self.before[o];
                    }
                } else {
                    let jump = (1.0 - ratio).abs() / ratio.max(f64::MIN_POSITIVE);
                    found.angle = found.angle.max((jump / steepness).atan());
                }
            }
        }
        found
    }

    /// The neighbours of `f` along the rim, across from `o` outside.
    fn beside(&self, f: usize, o: usize) -> [usize; 2] {
        let framed = self.side + 2;
        if f.abs_diff(o) == 1 {
            [f - framed, f + framed]
        } else {
            [f - 1, f + 1]
        }
    }

    /// |gradient of ln u| before the change.
    fn steepness(&self, f: usize) -> f64 {
        let framed = self.side + 2;
        let u = |at: usize| f64::from(self.before[at]) / f64::from(self.before[f]);
        let (x, y) = (
            0.5 * (u(f + 1) - u(f - 1)),
            0.5 * (u(f + framed) - u(f - framed)),
        );
        x.hypot(y).max(1e-6)
    }

    /// u before the change of the cell at which steepest ascent from a cell of the window leaves it; infinite at the
    /// target.
    fn exit(&self, at: usize) -> f32 {
        let framed = self.side + 2;
        let mut here = self.framed(at);
        // u grows with every step, so no cell is met twice.
        for _ in 0..self.side * self.side {
            let best = [here - 1, here + 1, here - framed, here + framed]
                .into_iter()
                .fold(here, |best, next| {
                    if self.after[next] > self.after[best] {
                        next
                    } else {
                        best
                    }
                });
            if best == here {
                return f32::INFINITY;
            }
            let (col, row) = (best % framed, best / framed);
            if col == 0 || row == 0 || col == framed - 1 || row == framed - 1 {
                return self.before[best];
            }
            here = best;
        }
        0.0
    }
}
