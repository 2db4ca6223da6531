//! Storage of u: one number per cell, in the narrowest format that holds the whole field.

use std::ops::Range;

use crate::{Scaled, real::Real, scaled::pow2};

/// Stored u of a blocked cell; any negative number works, because the accessors hide it.
pub(crate) const BLOCKED: f64 = -1.0;

/// Exponent of the largest u in a store with a common exponent; four such values can be added.
const TOP: i32 = 1020;

/// Exponent of the smallest u in such a store; u keeps all its digits.
const BOTTOM: i32 = -960;

/// Stored u: positive if reachable, 0 if free but cut off, [`BLOCKED`] if blocked.
#[derive(Clone, Debug)]
pub(crate) enum Store {
    /// `f32`, as u times 2^[`TOP`](Real::TOP) of an `f32`.
    Single(Vec<f32>),
    /// `f64` with one common exponent.
    Double { values: Vec<f64>, exponent: i32 },
    /// Mantissa and exponent per cell.
    Extended { mantissas: Vec<f64>, exponents: Vec<i32> },
}

/// Takes values of u times 2^TOP.
impl From<Vec<f32>> for Store {
    fn from(values: Vec<f32>) -> Self {
        Self::Single(values)
    }
}

impl From<Vec<f64>> for Store {
    fn from(values: Vec<f64>) -> Self {
        Self::Double { values, exponent: -f64::TOP }
    }
}

impl Store {
    pub(crate) fn raw(&self, index: usize) -> (f64, i32) {
        match self {
            Self::Single(values) => (f64::from(values[index]), -f32::TOP),
            Self::Double { values, exponent } => (values[index], *exponent),
            Self::Extended { mantissas, exponents } => (mantissas[index], exponents[index]),
        }
    }

    /// Returns u of a cell; zero if blocked or cut off.
    pub(crate) fn u(&self, index: usize) -> Scaled {
        let (value, exponent) = self.raw(index);
        Scaled::new(value, exponent)
    }

    /// In units of 2^`reference`; 0 if the result is below the range of `R`.
    pub(crate) fn read_row_as<R: Real>(&self, cells: Range<usize>, reference: i32, into: &mut [R]) {
        assert_eq!(into.len(), cells.len());
        if let Self::Single(values) = self
            && reference == -f32::TOP
        {
            for (to, &u) in into.iter_mut().zip(&values[cells]) {
                *to = R::of(f64::from(u.max(0.0)));
            }
            return;
        }
        for (to, index) in into.iter_mut().zip(cells) {
            let (value, exponent) = self.raw(index);
            let shift = exponent.saturating_sub(reference);
            // Two multiplications are needed: the factor may be out of range where the product is
            // not.
            *to = R::of(value.max(0.0) * pow2(shift / 2) * pow2(shift - shift / 2));
        }
    }

    /// Stores u of the cells in the [`narrowest`](Self::narrowest) format.
    pub(crate) fn of(blocked: &[bool], u: impl Iterator<Item = Scaled>) -> Self {
        let mut mantissas = Vec::with_capacity(blocked.len());
        let mut exponents = Vec::with_capacity(blocked.len());
        for (&blocked, u) in blocked.iter().zip(u) {
            mantissas.push(if blocked { BLOCKED } else { u.mantissa });
            exponents.push(u.exponent);
        }
        assert_eq!(mantissas.len(), blocked.len());
        Self::narrowest(mantissas, exponents)
    }

    /// Stores mantissas, which may be 0 or [`BLOCKED`], with a common exponent if an `f64` holds
    /// all values.
    pub(crate) fn narrowest(mut mantissas: Vec<f64>, exponents: Vec<i32>) -> Self {
        assert_eq!(mantissas.len(), exponents.len());
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
