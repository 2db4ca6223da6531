//! The harmonic field: u of every cell, with the certificate of its verification.

use std::ops::Range;

use crate::domain::{Cell, Domain};
use crate::repair::Patch;
use crate::scaled::{Scaled, pow2};

/// How a field was computed.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub enum Method {
    /// Elimination in order of decreasing distance from the target, in extended range.
    Elimination,
    /// Multigrid in single precision.
    MultigridSingle,
    /// Multigrid in double precision.
    MultigridDouble,
    /// Multigrid in double precision, one band of u after the other, each with an exponent of its own.
    MultigridBands,
}

impl Method {
    /// The method's name, for logs and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Elimination => "elimination",
            Self::MultigridSingle => "multigrid f32",
            Self::MultigridDouble => "multigrid f64",
            Self::MultigridBands => "multigrid bands",
        }
    }
}

/// What was verified of a field, cell by cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Certificate {
    /// The largest |u - mean / (1 + k)| / u over the reachable cells but the target.
    pub worst_residual: f64,
    /// How the field was computed.
    pub method: Method,
    /// Free cells from which the target can be reached, the target's own included.
    pub reachable: usize,
}

/// u of a blocked cell in the stores: any negative number would do, the accessors hide it.
pub(crate) const BLOCKED: f64 = -1.0;

/// u as stored: positive where reachable, 0 where free but cut off, [`BLOCKED`] where blocked.
#[derive(Clone, Debug)]
pub(crate) enum Store {
    /// All of u fits an `f32` with one common exponent.
    Single { values: Vec<f32>, exponent: i32 },
    /// All of u fits an `f64` with one common exponent.
    Double { values: Vec<f64>, exponent: i32 },
    /// A mantissa and an exponent a cell.
    Extended {
        mantissas: Vec<f64>,
        exponents: Vec<i32>,
    },
}

impl Store {
    /// The stored value and its exponent.
    pub(crate) fn raw(&self, index: usize) -> (f64, i32) {
        match self {
            Self::Single { values, exponent } => (f64::from(values[index]), *exponent),
            Self::Double { values, exponent } => (values[index], *exponent),
            Self::Extended {
                mantissas,
                exponents,
            } => (mantissas[index], exponents[index]),
        }
    }

    /// Sets a cell to u, [`BLOCKED`] or 0; the whole store becomes extended if u is out of its range.
    pub(crate) fn set(&mut self, index: usize, value: f64, exponent: i32) {
        let u = Scaled::new(value, exponent);
        // 0 and BLOCKED have no exponent to fit.
        let plain = |common: i32| {
            if value > 0.0 {
                u.relative_to(common)
            } else {
                value
            }
        };
        match self {
            Self::Single {
                values,
                exponent: common,
            } if fits(
                plain(*common),
                f64::from(f32::MIN_POSITIVE),
                f64::from(f32::MAX),
            ) =>
            {
                values[index] = plain(*common) as f32;
            }
            Self::Double {
                values,
                exponent: common,
            } if fits(plain(*common), f64::MIN_POSITIVE, f64::MAX) => {
                values[index] = plain(*common);
            }
            Self::Extended {
                mantissas,
                exponents,
            } => {
                mantissas[index] = if value > 0.0 { u.mantissa } else { value };
                exponents[index] = u.exponent;
            }
            Self::Single { .. } | Self::Double { .. } => {
                self.extend();
                self.set(index, value, exponent);
            }
        }
    }

    /// u of a cell; zero where blocked or cut off.
    pub(crate) fn u(&self, index: usize) -> Scaled {
        let (value, exponent) = self.raw(index);
        Scaled::new(value, exponent)
    }

    /// u of a run of cells in units of 2^`reference`, clamped to what an `f32` holds; 0 where u is.
    pub(crate) fn read_row(&self, cells: Range<usize>, reference: i32, into: &mut [f32]) {
        let clamp = |u: f64| {
            if u > 0.0 {
                u.clamp(LEAST_READ, MOST_READ) as f32
            } else {
                0.0
            }
        };
        match self {
            Self::Single { values, exponent } => {
                let scale = pow2(exponent.saturating_sub(reference));
                for (to, &u) in into.iter_mut().zip(&values[cells]) {
                    *to = clamp(f64::from(u) * scale);
                }
            }
            Self::Double { values, exponent } => {
                // In two steps: the whole factor may be out of range where the product is not.
                let shift = exponent.saturating_sub(reference);
                let (half, rest) = (pow2(shift / 2), pow2(shift - shift / 2));
                for (to, &u) in into.iter_mut().zip(&values[cells]) {
                    *to = clamp(u * half * rest);
                }
            }
            Self::Extended {
                mantissas,
                exponents,
            } => {
                for (to, index) in into.iter_mut().zip(cells) {
                    let shift = exponents[index]
                        .saturating_sub(reference)
                        .clamp(-1000, 1000);
                    *to = clamp(mantissas[index] * pow2(shift));
                }
            }
        }
    }

    /// u of a run of cells in units of 2^`reference`, 0 where that is below what an `f64` holds.
    pub(crate) fn read_row_wide(&self, cells: Range<usize>, reference: i32, into: &mut [f64]) {
        for (to, index) in into.iter_mut().zip(cells) {
            let (value, exponent) = self.raw(index);
            let shift = exponent.saturating_sub(reference);
            // In two steps: the factor may be out of range where the product is not.
            *to = value.max(0.0) * pow2(shift / 2) * pow2(shift - shift / 2);
        }
    }

    /// Sets the cells from `first` on for which `wanted` holds to u in units of 2^`reference`; negative is blocked.
    pub(crate) fn set_row(
        &mut self,
        first: usize,
        values: &[f32],
        reference: i32,
        wanted: &[bool],
    ) {
        for (at, (&value, _)) in values
            .iter()
            .zip(wanted)
            .enumerate()
            .filter(|(_, (_, wanted))| **wanted)
        {
            let index = first + at;
            match self {
                Self::Single { values, exponent } => {
                    let plain = f64::from(value) * pow2(reference.saturating_sub(*exponent));
                    if value <= 0.0 {
                        values[index] = value;
                        continue;
                    }
                    if fits(plain, f64::from(f32::MIN_POSITIVE), f64::from(f32::MAX)) {
                        values[index] = plain as f32;
                        continue;
                    }
                }
                Self::Double { .. } | Self::Extended { .. } => {}
            }
            self.set(index, f64::from(value), reference);
        }
    }

    fn extend(&mut self) {
        let len = match self {
            Self::Single { values, .. } => values.len(),
            Self::Double { values, .. } => values.len(),
            Self::Extended { .. } => return,
        };
        let (mantissas, exponents) = (0..len).map(|index| self.raw(index)).unzip();
        *self = Self::Extended {
            mantissas,
            exponents,
        };
    }
}

/// What [`Store::read_row`] clamps to: normal numbers, with room for a sum of a few.
const LEAST_READ: f64 = 2e-38;
const MOST_READ: f64 = 1e36;

/// Whether a plain value is 0 or [`BLOCKED`], or lies in a range of normal numbers.
fn fits(value: f64, least: f64, largest: f64) -> bool {
    value <= 0.0 || (least..=largest).contains(&value)
}

/// The field of one domain: u = 1 at the target, 0 where blocked or cut off, positive wherever the target can be reached.
///
/// Row-major, as [`Domain`](crate::Domain); cells outside the map count as blocked.
#[derive(Clone, Debug)]
pub struct Field {
    width: usize,
    height: usize,
    target: Cell,
    store: Store,
    certificate: Certificate,
    /// Local updates since the field was solved.
    patches: Vec<Patch>,
}

impl Field {
    pub(crate) fn new(
        (width, height): (usize, usize),
        target: Cell,
        store: Store,
        certificate: Certificate,
    ) -> Self {
        Self {
            width,
            height,
            target,
            store,
            certificate,
            patches: Vec::new(),
        }
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The target the field leads to.
    pub fn target(&self) -> Cell {
        self.target
    }

    /// What was verified when the field was last solved in full.
    pub fn certificate(&self) -> &Certificate {
        &self.certificate
    }

    /// u of `cell`; zero where blocked, cut off from the target, or outside the map.
    pub fn u(&self, cell: Cell) -> Scaled {
        if cell.col >= self.width || cell.row >= self.height {
            return Scaled::ZERO;
        }
        let (value, exponent) = self.store.raw(cell.row * self.width + cell.col);
        Scaled::new(value, exponent)
    }

    /// Whether the target can be reached from `cell`.
    pub fn is_reachable(&self, cell: Cell) -> bool {
        !self.u(cell).is_zero()
    }

    /// Whether `cell` was blocked when the field was computed, or lies outside the map.
    pub fn is_blocked(&self, cell: Cell) -> bool {
        cell.col >= self.width
            || cell.row >= self.height
            || self.store.raw(cell.row * self.width + cell.col).0 < 0.0
    }

    /// log10 of the smallest u of a reachable cell: how far below the range of a floating-point number the field goes.
    pub fn log10_u_min(&self) -> f64 {
        let mut least = Scaled::ONE;
        for index in 0..self.width * self.height {
            let (value, exponent) = self.store.raw(index);
            let u = Scaled::new(value, exponent);
            if !u.is_zero() && u < least {
                least = u;
            }
        }
        least.log10()
    }

    /// The neighbour with the largest u as seen from `cell`, `None` where u is zero and at the target.
    ///
    /// This is steepest ascent cell by cell; it ends at the target from every reachable cell.
    pub fn ascent(&self, cell: Cell) -> Option<Cell> {
        if cell == self.target || !self.is_reachable(cell) {
            return None;
        }
        let (col, row) = (cell.col as i64, cell.row as i64);
        let [dc, dr] = self.steepest_ascent(col, row);
        Some(Cell::new((col + dc) as usize, (row + dr) as usize))
    }

    /// u of the cell `there` as seen from its neighbour `here`: their ratio is what counts, u(here) being what it is.
    ///
    /// A local update changes u in a window and leaves it beyond. Where u flows out of the window, everything beyond is
    /// to be scaled by what u changed by at its rim, and that is done here rather than in every cell of the wake: across
    /// such an edge the ratio stays what it was before.
    pub(crate) fn seen(&self, here: (i64, i64), there: (i64, i64)) -> Scaled {
        let u = self.u_at(there.0, there.1);
        if self.patches.is_empty() {
            return u;
        }
        let patch_of = |cell| self.patches.iter().position(|patch| patch.contains(cell));
        let (from, to) = (patch_of(here), patch_of(there));
        if from == to {
            return u;
        }
        let before = |cell: (i64, i64), patch: Option<usize>| {
            patch.map_or_else(
                || self.u_at(cell.0, cell.1),
                |patch| self.patches[patch].before(cell),
            )
        };
        let (from_before, to_before) = (before(here, from), before(there, to));
        // Patches keep a distance, so exactly one of the two lies in one.
        let (outside, inside) = if from.is_none() {
            (from_before, to_before)
        } else {
            (to_before, from_before)
        };
        // To single precision, as the window was solved.
        let rounded = |u: Scaled| Scaled::new(f64::from(u.mantissa as f32), u.exponent);
        if outside.is_zero() || inside.is_zero() || rounded(outside) > rounded(inside) {
            return u;
        }
        let own = self.u_at(here.0, here.1);
        Scaled::new(
            own.mantissa * to_before.mantissa / from_before.mantissa,
            own.exponent + to_before.exponent - from_before.exponent,
        )
    }

    /// Whether this is a field of a map of the same size and the same target.
    pub(crate) fn fits(&self, domain: &Domain) -> bool {
        (self.width, self.height, self.target) == (domain.width(), domain.height(), domain.target())
    }

    pub(crate) fn store(&self) -> &Store {
        &self.store
    }

    pub(crate) fn store_mut(&mut self) -> &mut Store {
        &mut self.store
    }

    pub(crate) fn patches(&self) -> &[Patch] {
        &self.patches
    }

    pub(crate) fn patches_mut(&mut self) -> &mut Vec<Patch> {
        &mut self.patches
    }

    /// u at a signed column and row: zero outside the map.
    pub(crate) fn u_at(&self, col: i64, row: i64) -> Scaled {
        match (usize::try_from(col), usize::try_from(row)) {
            (Ok(col), Ok(row)) => self.u(Cell { col, row }),
            _ => Scaled::ZERO,
        }
    }
}
