//! Storage of u: one number a cell, in the narrowest format that holds the whole field.

use std::ops::Range;

use crate::{Scaled, real::Real, scaled::pow2};

/// u of a blocked cell in the stores: any negative number would do, the accessors hide it.
pub(crate) const BLOCKED: f64 = -1.0;

/// Exponent of the largest u in a store of many bands or fronts with a common exponent: so high that four of it can be added.
const TOP: i32 = 1020;

/// Exponent of the smallest u in such a store: so low that the u keeps all of its digits.
const BOTTOM: i32 = -960;

/// u as stored: positive where reachable, 0 where free but cut off, [`BLOCKED`] where blocked.
#[derive(Clone, Debug)]
pub(crate) enum Store {
    /// All of u fits an `f32` with one common exponent.
    Single { values: Vec<f32>, exponent: i32 },
    /// All of u fits an `f64` with one common exponent.
    Double { values: Vec<f64>, exponent: i32 },
    /// A mantissa and an exponent a cell.
    Extended { mantissas: Vec<f64>, exponents: Vec<i32> },
}

/// The values are u times 2^TOP.
impl From<Vec<f32>> for Store {
    fn from(values: Vec<f32>) -> Self {
        let exponent = -f32::TOP;
        Self::Single { values, exponent }
    }
}

/// The values are u times 2^TOP.
impl From<Vec<f64>> for Store {
    fn from(values: Vec<f64>) -> Self {
        let exponent = -f64::TOP;
        Self::Double { values, exponent }
    }
}

impl Store {
    /// The stored value and its exponent.
    pub(crate) fn raw(&self, index: usize) -> (f64, i32) {
        match self {
            Self::Single { values, exponent } => (f64::from(values[index]), *exponent),
            Self::Double { values, exponent } => (values[index], *exponent),
            Self::Extended { mantissas, exponents } => (mantissas[index], exponents[index]),
        }
    }

    /// u of a cell; zero where blocked or cut off.
    pub(crate) fn u(&self, index: usize) -> Scaled {
        let (value, exponent) = self.raw(index);
        Scaled::new(value, exponent)
    }

    /// u of a run of cells in units of 2^`reference`, 0 where the result is below the range of `R`.
    pub(crate) fn read_row_as<R: Real>(&self, cells: Range<usize>, reference: i32, into: &mut [R]) {
        if let Self::Single { values, exponent } = self
            && *exponent == reference
        {
            for (to, &u) in into.iter_mut().zip(&values[cells]) {
                *to = R::of(f64::from(u.max(0.0)));
            }
            return;
        }
        for (to, index) in into.iter_mut().zip(cells) {
            let (value, exponent) = self.raw(index);
            let shift = exponent.saturating_sub(reference);
            // The multiplication is done in two steps, because the factor may be out of range where the product is not.
            *to = R::of(value.max(0.0) * pow2(shift / 2) * pow2(shift - shift / 2));
        }
    }

    /// The store of mantissas, which may be 0 or [`BLOCKED`], and exponents: with a common exponent if an `f64` holds them
    /// all.
    pub(crate) fn narrowest(mut mantissas: Vec<f64>, exponents: Vec<i32>) -> Self {
        let positive = mantissas.iter().zip(&exponents).filter(|(mantissa, _)| **mantissa > 0.0);
        if positive.map(|(_, &exponent)| exponent).min().is_none_or(|it| it < BOTTOM - TOP) {
            return Self::Extended { mantissas, exponents };
        }
        for (value, exponent) in mantissas.iter_mut().zip(exponents) {
            *value *= if *value > 0.0 { pow2(exponent + TOP) } else { 1.0 };
        }
        Self::Double { values: mantissas, exponent: -TOP }
    }
}
