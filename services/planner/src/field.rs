//! The harmonic field: u of every cell, with the certificate of its verification.

use crate::domain::Cell;
use crate::scaled::Scaled;

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
}

impl Method {
    /// The method's name, for logs and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Elimination => "elimination",
            Self::MultigridSingle => "multigrid f32",
            Self::MultigridDouble => "multigrid f64",
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
    fn raw(&self, index: usize) -> (f64, i32) {
        match self {
            Self::Single { values, exponent } => (f64::from(values[index]), *exponent),
            Self::Double { values, exponent } => (values[index], *exponent),
            Self::Extended {
                mantissas,
                exponents,
            } => (mantissas[index], exponents[index]),
        }
    }
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

    /// u at a signed column and row: zero outside the map.
    pub(crate) fn u_at(&self, col: i64, row: i64) -> Scaled {
        match (usize::try_from(col), usize::try_from(row)) {
            (Ok(col), Ok(row)) => self.u(Cell { col, row }),
            _ => Scaled::ZERO,
        }
    }
}
