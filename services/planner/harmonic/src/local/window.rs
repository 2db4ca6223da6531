//! The equations of one window of the map, between what flows in and what flows out.
//!
//! Across each edge of the window's rim, u flows from the larger side to the smaller (u as it was before the change).
//! Where it flows in, the cell outside keeps its u: the change is assumed not to reach upstream. Where it flows out, the
//! cell outside keeps its ratio to the cell inside: whatever changes in the window changes the outflow_ratio in proportion. Holding
//! u itself there would put false maxima just outside.
//!
//! All arrays have a frame of one cell around the window, so a cell's neighbours are one or one row away.

use crate::cell::Cell;
use crate::domain::Domain;
use crate::multigrid::Multigrid;
use crate::patch::{Patch, Rect};
use crate::screening::Coefficients;
use crate::store::Store;
use crate::verification::check_framed;

/// Coarse corrections above this weight of u mean that a cell has not converged.
const TOLERANCE: f64 = 1e-3;

/// Cycles before a window is given up.
const CYCLES: usize = 24;

/// Cycles added where the check asks for more.
const CYCLES_MORE: usize = 3;

/// u this far above and below u at the change is unknown in. Cells beyond are left outside as if they lay beyond the rim: the
/// next corridor of a maze may be 1e-45 of this one.
const SPAN: std::ops::RangeInclusive<f32> = 1e-24..=1e24;

/// Numbers read from the store that are not clamped for certain.
const EXACT: std::ops::RangeInclusive<f32> = 1e-35..=1e35;

/// The largest relative residual of a window. It holds only until the next full solve.
const RESIDUAL_LIMIT: f64 = 1e-3;

/// Arrays and levels for windows of one size, kept between updates.
#[derive(Debug)]
pub(super) struct Window {
    /// Columns and rows, without the frame.
    width: usize,
    height: usize,
    /// Cells of a row, frame included.
    stride: usize,
    levels: Multigrid<f32>,
    /// u before the change, relatively to 2^`reference`; 0 where blocked or cut off.
    before: Vec<f32>,
    /// u after it, the same way; outside as seen from inside; negative where blocked.
    after: Vec<f32>,
    /// 1 / diagonal of the cells solved for, 0 elsewhere.
    inverse: Vec<f32>,
    /// 0.25 / (1 + k), 0 where no equation holds.
    weights: Vec<f32>,
    /// Whether blocked now; beyond the map too.
    blocked: Vec<bool>,
    /// Cells the window is solved for, blocked ones included.
    unknown: Vec<bool>,
    /// Cells that what flows in can reach.
    reached: Vec<bool>,
    /// Free cells of the window with a neighbour it is not solved for.
    rim: Vec<usize>,
    /// The walk that last came by, from 1; 0 for none.
    visited: Vec<u32>,
    stack: Vec<usize>,
    inflow: Vec<(Cell, f32)>,
    reference: i32,
    rect: Rect,
}

/// What a window's solution says of the world outside.
#[derive(Clone, Debug)]
pub(super) struct ErrorEstimate {
    /// Estimate of the angle, in radians, by which directions beyond the rim are off.
    pub angle: f64,
    /// The same of where u flows in alone. What it is wrong by there it is wrong by in the window, too.
    pub upstream: f64,
    /// The smallest and the largest ratio of u after to u before on the outflow rim.
    pub outflow_ratio: (f64, f64),
    /// Cells outside that lead into the window at a place now lower than they are: whether walks from there still get
    /// ahead must be tried.
    pub ascents_to_check: Vec<Cell>,
}

/// What a walk finds at a cell.
#[derive(Clone, Copy, Debug)]
pub(super) enum Step {
    /// An earlier walk came by here, and they are tried only until one fails.
    Proven,
    /// This walk was here before.
    Again,
    /// The cell with the largest u beside it.
    To(Cell),
    /// A cell the window is solved for, with one beside it that it is not.
    Inside,
    /// A cell the window is not solved for.
    Beyond,
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
    ) -> Result<ErrorEstimate, WindowError> {
        self.rect = Rect {
            col,
            row,
            width: self.width,
            height: self.height,
        };
        self.read(domain, store, changed);
        self.select_unknowns();
        // A cell that was blocked since must be solved for: a change may lie on both sides of a wall.
        let missed = self
            .unknown
            .iter()
            .zip(&self.blocked)
            .zip(&self.before)
            .any(|((&t, &b), &u)| b && !t && u > 0.0);
        let target = self.target(domain);
        // Nor can a freed cell join passages whose u differs beyond what the window's numbers hold.
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
        // The first cycle has no correction yet that could be judged.
        self.levels.cycle(TOLERANCE);
        let mut cycles = 1;
        while cycles < CYCLES {
            let converged =
                (cycles..CYCLES).find(|_| self.levels.cycle_unless_converged(TOLERANCE));
            cycles = converged.ok_or(WindowError::NotConverged)? + CYCLES_MORE;
            self.levels.smooth();
            if self.is_right(target) {
                return Ok(self.estimate_error());
            }
            // The correction converged before the residual did.
            for _ in 0..CYCLES_MORE {
                self.levels.cycle(TOLERANCE);
            }
        }
        Err(WindowError::NotConverged)
    }

    /// Takes the solution over; whether it passes its check.
    fn is_right(&mut self, target: Option<usize>) -> bool {
        let (stride, width) = (self.stride, self.width);
        self.levels.unload(|row, values| {
            self.after[(row + 1) * stride + 1..][..width].copy_from_slice(values);
        });
        self.frame(target);
        let check = check_framed(width, &self.after, &self.weights);
        check.local_maxima == 0 && check.unreached == 0 && check.worst_residual <= RESIDUAL_LIMIT
    }

    /// Writes u of the cells solved for to `store`; returns the patch that remembers what it was.
    pub(super) fn write(&self, domain: &Domain, store: &mut Store, changed: Rect) -> Patch {
        let mut unknown = Vec::with_capacity(self.width * self.height);
        for row in 1..=self.height {
            unknown.extend_from_slice(&self.unknown[row * self.stride + 1..][..self.width]);
        }
        let patch = Patch::of(self.rect, changed, unknown, store, domain.width());
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

    /// Where walk `number`, from 1, goes from `cell`, as far as the window's own u tells.
    pub(super) fn step(&mut self, cell: Cell, number: u32) -> Step {
        if !self.rect.contains((cell.col as i64, cell.row as i64)) {
            return Step::Beyond;
        }
        let f = (cell.row - self.rect.row + 1) * self.stride + cell.col - self.rect.col + 1;
        match std::mem::replace(&mut self.visited[f], number) {
            0 => {}
            last if last == number => return Step::Again,
            _ => return Step::Proven,
        }
        if !self.unknown[f] {
            return Step::Beyond;
        }
        if self.outside(f).next().is_some() {
            return Step::Inside;
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

    /// Decides which cells to solve for, and finds the rim.
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

    /// Marks the cells that what flows in can reach; true if that includes one beside a free cell of u = 0 outside, which
    /// is then cut off no longer.
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

    /// The neighbours of a cell that the window is not solved for.
    fn outside(&self, f: usize) -> impl Iterator<Item = usize> {
        self.around(f).into_iter().filter(|&o| !self.unknown[o])
    }

    /// Whether u flows from the window's rim cell out to `o`.
    fn flows_out(&self, f: usize, o: usize) -> bool {
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

    /// Completes the solution by what is not solved for, as seen from inside.
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

    /// The target's place, if it is among the cells solved for.
    fn target(&self, domain: &Domain) -> Option<usize> {
        let target = domain.target();
        let inside = self.rect.contains((target.col as i64, target.row as i64));
        let f = |target: Cell| {
            (target.row - self.rect.row + 1) * self.stride + target.col - self.rect.col + 1
        };
        inside.then(|| f(target)).filter(|&f| self.unknown[f])
    }

    fn estimate_error(&self) -> ErrorEstimate {
        let mut found = ErrorEstimate {
            angle: 0.0,
            upstream: 0.0,
            outflow_ratio: (f64::INFINITY, 0.0),
            ascents_to_check: Vec::new(),
        };
        // The largest tangent of an angle; its arc is unknown once, at the end.
        let (mut slope, mut upstream) = (0.0_f64, 0.0_f64);
        for &f in &self.rim {
            if self.before[f] <= 0.0 {
                // A freed cell now leads where u was too far from that of the window to be solved for.
                found.outflow_ratio.1 = found.outflow_ratio.1.max(self.opening_ratio(f));
                continue;
            }
            let ratio = f64::from(self.after[f]) / f64::from(self.before[f]);
            let scale = 1.0 / (self.steepness(f) * ratio.max(f64::MIN_POSITIVE));
            for o in self.outside(f).filter(|&o| self.before[o] > 0.0) {
                if self.flows_out(f, o) {
                    found.outflow_ratio = (
                        found.outflow_ratio.0.min(ratio),
                        found.outflow_ratio.1.max(ratio),
                    );
                    for beside in self.beside(f, o) {
                        if self.before[beside] > 0.0 && self.after[beside] > 0.0 {
                            let other =
                                f64::from(self.after[beside]) / f64::from(self.before[beside]);
                            slope = slope.max((ratio - other).abs() * scale);
                        }
                    }
                    if self.after[f] < self.before[o] {
                        found.ascents_to_check.push(self.map_cell(o));
                    }
                } else {
                    upstream = upstream.max((1.0 - ratio).abs() * scale);
                }
            }
        }
        found.angle = slope.max(upstream).atan();
        found.upstream = upstream.atan();
        found
    }

    /// How many times u before of the cells outside u of the freed cell `f` is now: what flows there had another way before.
    fn opening_ratio(&self, f: usize) -> f64 {
        let beyond = self.outside(f).map(|o| self.before[o]);
        let least = beyond.filter(|&u| u > 0.0).reduce(f32::min);
        least.map_or(0.0, |least| f64::from(self.after[f]) / f64::from(least))
    }

    /// The neighbours of `f` along the rim, across from `o` outside.
    fn beside(&self, f: usize, o: usize) -> [usize; 2] {
        if f.abs_diff(o) == 1 {
            [f - self.stride, f + self.stride]
        } else {
            [f - 1, f + 1]
        }
    }

    /// |gradient of ln u| before the change.
    fn steepness(&self, f: usize) -> f64 {
        let u = |at: usize| f64::from(self.before[at]) / f64::from(self.before[f]);
        let (x, y) = (
            0.5 * (u(f + 1) - u(f - 1)),
            0.5 * (u(f + self.stride) - u(f - self.stride)),
        );
        x.hypot(y).max(1e-6)
    }

    /// The cell of the map at a place of the arrays that lies inside it.
    fn map_cell(&self, f: usize) -> Cell {
        Cell::new(
            self.rect.col + f % self.stride - 1,
            self.rect.row + f / self.stride - 1,
        )
    }
}
