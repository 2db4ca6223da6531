//! The boundary value problem of one window of the map.
//!
//! Across each edge of the window's rim, u flows from the larger side to the smaller (u as it was before the change).
//! At inflow edges the cell outside keeps its u (Dirichlet): the change is assumed not to reach upstream. At outflow edges
//! the cell outside keeps its ratio to the cell inside (Robin): u downstream is scaled by what u at the rim changes by.
//! Keeping u itself there would make local maxima just outside.
//!
//! All arrays have a frame of one cell around the window, so a cell's neighbours are one or one row away.

use crate::cell::Cell;
use crate::domain::Domain;
use crate::multigrid::Multigrid;
use crate::patch::{Patch, Rect, Rim};
use crate::scaled::Scaled;
use crate::screening::Coefficients;
use crate::store::Store;
use crate::verification::check_framed;

/// A cell whose direction a coarse correction turns by more than this, radians, has not settled.
const TOLERANCE: f64 = 1e-3;

/// Cycles before a window is given up.
const CYCLES: usize = 24;

/// Cycles added where the check asks for more.
const CYCLES_MORE: usize = 3;

/// Cells whose u is in this range of multiples of u at the change are unknowns. Others are treated as beyond the rim: the
/// next corridor of a maze may be 1e-45 of this one.
const SPAN: std::ops::RangeInclusive<f32> = 1e-24..=1e24;

/// Numbers read from the store in this range were not clamped.
const EXACT: std::ops::RangeInclusive<f32> = 1e-35..=1e35;

/// Largest relative residual of a window; higher than for a full solve, which follows every update.
const RESIDUAL_LIMIT: f64 = 1e-3;

/// Arrays and levels for windows of one size, kept between updates.
#[derive(Debug)]
pub(super) struct Window {
    /// Columns and rows, without the frame.
    width: usize,
    height: usize,
    /// Cells of a row, frame included.
    pub(super) stride: usize,
    levels: Multigrid<f32>,
    /// u before the change, in units of 2^`reference`; 0 where blocked or cut off.
    pub(super) before: Vec<f32>,
    /// u after it, in the same units; outside as seen from inside; negative where blocked.
    pub(super) after: Vec<f32>,
    /// 1 / diagonal of the unknowns, 0 elsewhere.
    inverse: Vec<f32>,
    /// 0.25 / (1 + k), 0 where no equation holds.
    weights: Vec<f32>,
    /// Whether blocked now; beyond the map too.
    blocked: Vec<bool>,
    /// Cells the window is solved for, blocked ones included.
    unknown: Vec<bool>,
    /// Unknowns connected to an inflow edge or to the target.
    reached: Vec<bool>,
    /// Free unknowns with a neighbour that is none.
    pub(super) rim: Vec<usize>,
    /// The path that last came by, from 1; 0 for none.
    visited: Vec<u32>,
    stack: Vec<usize>,
    inflow: Vec<(Cell, f32)>,
    reference: i32,
    rect: Rect,
}

/// What a path of steepest ascent finds at a cell.
#[derive(Clone, Copy, Debug)]
pub(super) enum Step {
    /// An earlier path came by here; it succeeded, or this one would not be followed.
    Joined,
    /// This path was here before.
    Cycle,
    /// The neighbour with the largest u.
    To(Cell),
    /// An unknown with a neighbour that is none.
    Rim,
    /// No unknown.
    Outside,
}

/// Why a window has no solution.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum WindowError {
    /// The change joins, cuts or spans cells whose u differ beyond the range of single precision: no window can hold them.
    OutOfRange,
    /// The solution does not converge or fails its check.
    NotConverged,
}

impl Window {
    pub(super) fn new((width, height): (usize, usize)) -> Self {
        let stride = width + 2;
        let values = || vec![0.0; stride * (height + 2)];
        let flags = || vec![false; stride * (height + 2)];
        Self {
            width,
            height,
            stride,
            levels: Multigrid::new(width, height),
            before: values(),
            after: values(),
            inverse: values(),
            weights: values(),
            blocked: flags(),
            unknown: flags(),
            reached: flags(),
            rim: Vec::new(),
            visited: vec![0; stride * (height + 2)],
            stack: Vec::new(),
            inflow: Vec::new(),
            reference: 0,
            rect: Rect {
                col: 0,
                row: 0,
                width,
                height,
            },
        }
    }

    pub(super) fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Solves the window at (`col`, `row`) for the map as it is now, `store` holding u as it was and `changed` having
    /// changed.
    pub(super) fn solve(
        &mut self,
        domain: &Domain,
        store: &Store,
        (col, row): (usize, usize),
        changed: &Rect,
    ) -> Result<(), WindowError> {
        self.rect = Rect {
            col,
            row,
            width: self.width,
            height: self.height,
        };
        self.read(domain, store, changed);
        self.select_unknowns();
        // A newly blocked cell must be an unknown; it may not be where a change lies on both sides of a wall.
        let missed = self
            .unknown
            .iter()
            .zip(&self.blocked)
            .zip(&self.before)
            .any(|((&t, &b), &u)| b && !t && u > 0.0);
        let target = self.target(domain);
        // A freed cell cannot join passages whose u differs by more than the range of single precision.
        let beyond = self.rim.iter().any(|&f| {
            self.outside(f)
                .any(|o| self.before[o] > 0.0 && !EXACT.contains(&self.before[o]))
        });
        if missed || beyond || self.mark_reached(target) {
            return Err(WindowError::OutOfRange);
        }
        self.set_equations(domain, target);
        let (stride, width) = (self.stride, self.width);
        let inside = |row: usize| (row + 1) * stride + 1..(row + 1) * stride + 1 + width;
        self.levels.load(
            |row| (&self.inverse[inside(row)], &self.after[inside(row)]),
            self.inflow.iter().copied(),
        );
        // The first cycle has no coarse correction yet to judge convergence by.
        self.levels.cycle(None);
        let mut cycles = 1;
        while cycles < CYCLES {
            let converged =
                (cycles..CYCLES).find(|_| self.levels.cycle_unless_converged(TOLERANCE));
            cycles = converged.ok_or(WindowError::NotConverged)? + CYCLES_MORE;
            self.levels.smooth();
            if self.read_solution(target) {
                return Ok(());
            }
            // The correction converged before the residual did.
            for _ in 0..CYCLES_MORE {
                self.levels.cycle(None);
            }
        }
        Err(WindowError::NotConverged)
    }

    /// Reads the solution from the levels; whether it passes the verification.
    fn read_solution(&mut self, target: Option<usize>) -> bool {
        let (stride, width) = (self.stride, self.width);
        self.levels.unload(|row, values| {
            self.after[(row + 1) * stride + 1..][..width].copy_from_slice(values);
        });
        self.frame(target);
        let check = check_framed(width, &self.after, &self.weights);
        check.local_maxima == 0 && check.unreached == 0 && check.worst_residual <= RESIDUAL_LIMIT
    }

    /// Writes u of the cells solved for to `store`; returns the patch with u before.
    pub(super) fn write(
        &self,
        domain: &Domain,
        store: &mut Store,
        changed: Rect,
        rim: Rim,
    ) -> Patch {
        let mut unknown = Vec::with_capacity(self.width * self.height);
        for row in 1..=self.height {
            unknown.extend_from_slice(&self.unknown[row * self.stride + 1..][..self.width]);
        }
        let patch = Patch::of(self.rect, changed, unknown, rim, (store, domain.width()));
        for row in 0..self.height {
            let start = (row + 1) * self.stride + 1;
            let first = (self.rect.row + row) * domain.width() + self.rect.col;
            store.set_row(
                first,
                &self.after[start..][..self.width],
                self.reference,
                &self.unknown[start..],
            );
        }
        let target = domain.target();
        if self.rect.contains((target.col as i64, target.row as i64)) {
            store.set(domain.index(target), 1.0, 0);
        }
        patch
    }

    pub(super) fn reset_paths(&mut self) {
        self.visited.fill(0);
    }

    /// Where path `number`, from 1, leads from `cell`, as far as the window's own u tells.
    pub(super) fn step(&mut self, cell: Cell, number: u32) -> Step {
        if !self.rect.contains((cell.col as i64, cell.row as i64)) {
            return Step::Outside;
        }
        let f = (cell.row - self.rect.row + 1) * self.stride + cell.col - self.rect.col + 1;
        match std::mem::replace(&mut self.visited[f], number) {
            0 => {}
            last if last == number => return Step::Cycle,
            _ => return Step::Joined,
        }
        if !self.unknown[f] {
            return Step::Outside;
        }
        if self.outside(f).next().is_some() {
            return Step::Rim;
        }
        // East before west before south before north, as the field has it where two are equal.
        let [west, east, north, south] = self.around(f);
        let mut best = east;
        for next in [west, south, north] {
            if self.after[next] > self.after[best] {
                best = next;
            }
        }
        Step::To(self.map_cell(best))
    }

    /// Reads u as it was and the map as it is, window and frame.
    fn read(&mut self, domain: &Domain, store: &Store, changed: &Rect) {
        let (width, height) = (domain.width(), domain.height());
        // The scale: the largest u of the change and of the cells around it, else of anywhere in the window.
        let largest = |cols: std::ops::Range<usize>, rows: std::ops::Range<usize>| {
            let cells =
                rows.flat_map(|row| cols.clone().map(move |col| store.u(row * width + col)));
            cells.filter(|u| !u.is_zero()).map(|u| u.exponent).max()
        };
        let around = |start: usize, len: usize, end: usize| {
            start.saturating_sub(1)..(start + len + 1).min(end)
        };
        self.reference = largest(
            around(changed.col, changed.width, width),
            around(changed.row, changed.height, height),
        )
        .or_else(|| {
            let rect = self.rect;
            largest(
                rect.col..rect.col + rect.width,
                rect.row..rect.row + rect.height,
            )
        })
        .unwrap_or(0);

        // The frame may lie one cell outside the map.
        let first = self.rect.col.saturating_sub(1);
        let end = (self.rect.col + self.width + 1).min(width);
        let at = first + 1 - self.rect.col;
        for framed_row in 0..self.height + 2 {
            let start = framed_row * self.stride;
            let before = &mut self.before[start..][..self.stride];
            let blocked = &mut self.blocked[start..][..self.stride];
            before.fill(0.0);
            blocked.fill(true);
            let row = (self.rect.row + framed_row).wrapping_sub(1);
            if row < height {
                let cells = row * width + first..row * width + end;
                store.read_row(cells.clone(), self.reference, &mut before[at..]);
                blocked[at..at + cells.len()].copy_from_slice(&domain.blocked()[cells]);
            }
        }
    }

    /// Selects the cells to solve for, and the rim.
    fn select_unknowns(&mut self) {
        let (width, height, stride) = (self.width, self.height, self.stride);
        self.unknown.fill(false);
        let mut whole = true;
        for row in 1..=height {
            let start = row * stride + 1;
            for (unknown, &u) in self.unknown[start..start + width]
                .iter_mut()
                .zip(&self.before[start..])
            {
                *unknown = u == 0.0 || SPAN.contains(&u);
                whole &= *unknown;
            }
        }
        self.rim.clear();
        for row in 1..=height {
            // Where all of the window is solved for, the rim is its border.
            let step = if whole && row > 1 && row < height {
                width - 1
            } else {
                1
            };
            for col in (1..=width).step_by(step.max(1)) {
                let f = row * stride + col;
                if self.unknown[f] && !self.blocked[f] && self.outside(f).next().is_some() {
                    self.rim.push(f);
                }
            }
        }
    }

    /// Marks the unknowns that inflow can reach; true if one of them has a free neighbour of u = 0 outside, which is then
    /// no longer cut off.
    fn mark_reached(&mut self, target: Option<usize>) -> bool {
        self.reached.fill(false);
        self.stack.clear();
        self.stack.extend(target);
        for &f in &self.rim {
            if self.outside(f).any(|o| self.before[o] > self.before[f]) {
                self.stack.push(f);
            }
        }
        for &f in &self.stack {
            self.reached[f] = true;
        }
        while let Some(f) = self.stack.pop() {
            for next in self.around(f) {
                if self.unknown[next] && !self.blocked[next] && !self.reached[next] {
                    self.reached[next] = true;
                    self.stack.push(next);
                }
            }
        }
        self.rim.iter().any(|&f| {
            self.reached[f]
                && self
                    .outside(f)
                    .any(|o| !self.blocked[o] && self.before[o] == 0.0)
        })
    }

    fn around(&self, f: usize) -> [usize; 4] {
        [f - 1, f + 1, f - self.stride, f + self.stride]
    }

    /// The neighbours of a cell that are no unknowns.
    pub(super) fn outside(&self, f: usize) -> impl Iterator<Item = usize> {
        self.around(f).into_iter().filter(|&o| !self.unknown[o])
    }

    /// Whether u flows from the rim cell `f` out to `o`.
    pub(super) fn flows_out(&self, f: usize, o: usize) -> bool {
        self.before[o] > 0.0 && self.before[f] > 0.0 && self.before[o] <= self.before[f]
    }

    fn set_equations(&mut self, domain: &Domain, target: Option<usize>) {
        let (width, stride) = (self.width, self.stride);
        for row in 0..self.height {
            let start = (row + 1) * stride + 1;
            let weights = &mut self.weights[start..][..width];
            match domain.screening() {
                Coefficients::Uniform(k) => weights.fill((0.25 / (1.0 + k)) as f32),
                Coefficients::PerCell(cells) => {
                    let first = (self.rect.row + row) * domain.width() + self.rect.col;
                    for (weight, &k) in weights.iter_mut().zip(&cells[first..]) {
                        *weight = 0.25 / (1.0 + k);
                    }
                }
            }
            let (inverse, guess) = (
                &mut self.inverse[start..][..width],
                &mut self.after[start..][..width],
            );
            let (before, reached) = (
                &self.before[start..][..width],
                &self.reached[start..][..width],
            );
            for x in 0..width {
                inverse[x] = if reached[x] { weights[x] } else { 0.0 };
                guess[x] = if reached[x] { before[x] } else { 0.0 };
            }
        }
        let cell = |f: usize| Cell::new(f % stride - 1, f / stride - 1);
        self.inflow.clear();
        if let Some(target) = target {
            // The target's own equation does not hold: what it gives its neighbours flows in.
            self.inverse[target] = 0.0;
            for next in self
                .around(target)
                .into_iter()
                .filter(|&next| self.unknown[next])
            {
                self.inflow.push((cell(next), self.before[target]));
            }
        }
        for &f in &self.rim {
            if self.inverse[f] == 0.0 {
                continue;
            }
            let mut rest = 1.0 / self.weights[f];
            for o in self.around(f).into_iter().filter(|&o| !self.unknown[o]) {
                if self.flows_out(f, o) {
                    rest -= self.before[o] / self.before[f];
                } else if self.before[o] > 0.0 {
                    self.inflow.push((cell(f), self.before[o]));
                }
            }
            self.inverse[f] = 1.0 / rest;
        }
    }

    /// Completes the solution by the cells that are no unknowns, as seen from inside.
    fn frame(&mut self, target: Option<usize>) {
        if let Some(target) = target {
            self.after[target] = self.before[target];
            self.weights[target] = 0.0;
        }
        for f in 0..self.after.len() {
            if !self.unknown[f] {
                self.after[f] = self.before[f];
                self.weights[f] = 0.0;
            } else if self.blocked[f] {
                self.after[f] = -1.0;
            }
        }
        for &f in &self.rim {
            for o in self.around(f).into_iter().filter(|&o| !self.unknown[o]) {
                if self.flows_out(f, o) {
                    self.after[o] = self.after[f] * (self.before[o] / self.before[f]);
                } else if !self.reached[f] {
                    // Not reached from here, so nothing flows in.
                    self.after[o] = 0.0;
                }
            }
        }
    }

    /// The target's place, if it is an unknown.
    fn target(&self, domain: &Domain) -> Option<usize> {
        let target = domain.target();
        let inside = self.rect.contains((target.col as i64, target.row as i64));
        let f = |target: Cell| {
            (target.row - self.rect.row + 1) * self.stride + target.col - self.rect.col + 1
        };
        inside.then(|| f(target)).filter(|&f| self.unknown[f])
    }

    /// u read from `before` or `after`.
    pub(super) fn scaled(&self, u: f32) -> Scaled {
        Scaled::new(f64::from(u), self.reference)
    }

    /// The cell of the map at a place of the arrays that lies inside it.
    pub(super) fn map_cell(&self, f: usize) -> Cell {
        Cell::new(
            self.rect.col + f % self.stride - 1,
            self.rect.row + f / self.stride - 1,
        )
    }
}
