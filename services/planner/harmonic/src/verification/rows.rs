//! Sliding window of three rows of u over the map.

use super::cells::Around;
use crate::{real::Real, scaled::pow2};

pub(super) trait Window<R> {
    type Row<'f>;

    /// Moves down one row; `next` is the row below, `None` after the last.
    fn take(&mut self, next: Option<Self::Row<'_>>);

    fn around(&mut self) -> Around<'_, R>;
}

/// Three rows of numbers with a zero at either end; blocked cells are zero.
pub(super) struct Rows<R> {
    above: Vec<R>,
    here: Vec<R>,
    below: Vec<R>,
}

impl<R: Real> Rows<R> {
    pub(super) fn new(width: usize) -> Self {
        let row = vec![R::default(); width + 2];
        Self { above: row.clone(), here: row.clone(), below: row }
    }
}

impl<R: Real> Window<R> for Rows<R> {
    type Row<'f> = &'f [R];

    #[inline(always)]
    fn take(&mut self, next: Option<&[R]>) {
        std::mem::swap(&mut self.above, &mut self.here);
        std::mem::swap(&mut self.here, &mut self.below);
        let zero = R::default();
        let width = self.below.len() - 2;
        let below = &mut self.below[1..=width];
        match next {
            Some(next) => {
                for (to, &from) in below.iter_mut().zip(next) {
                    *to = if from > zero { from } else { zero };
                }
            }
            None => below.fill(zero),
        }
    }

    #[inline(always)]
    fn around(&mut self) -> Around<'_, R> {
        let n = self.here.len() - 2;
        Around {
            here: &self.here[1..][..n],
            west: &self.here[..n],
            east: &self.here[2..][..n],
            north: &self.above[1..][..n],
            south: &self.below[1..][..n],
        }
    }
}

pub(super) struct ScaledRows {
    mantissas: Rows<f64>,
    above: Vec<i32>,
    here: Vec<i32>,
    below: Vec<i32>,
    /// West, east, north and south neighbours, with the exponent of the cell itself.
    relative: [Vec<f64>; 4],
}

impl ScaledRows {
    pub(super) fn new(width: usize) -> Self {
        let row = vec![0; width + 2];
        Self {
            mantissas: Rows::new(width),
            above: row.clone(),
            here: row.clone(),
            below: row,
            relative: std::array::from_fn(|_| vec![0.0; width]),
        }
    }
}

impl Window<f64> for ScaledRows {
    /// Mantissas and exponents.
    type Row<'f> = (&'f [f64], &'f [i32]);

    #[inline(always)]
    fn take(&mut self, next: Option<(&[f64], &[i32])>) {
        self.mantissas.take(next.map(|(mantissas, _)| mantissas));
        std::mem::swap(&mut self.above, &mut self.here);
        std::mem::swap(&mut self.here, &mut self.below);
        if let Some((_, exponents)) = next {
            let width = self.below.len() - 2;
            self.below[1..=width].copy_from_slice(exponents);
        }
    }

    #[inline(always)]
    fn around(&mut self) -> Around<'_, f64> {
        let u = self.mantissas.around();
        let n = u.here.len();
        let exponents = &self.here[1..][..n];
        let neighbours = [
            (u.west, &self.here[..n]),
            (u.east, &self.here[2..][..n]),
            (u.north, &self.above[1..][..n]),
            (u.south, &self.below[1..][..n]),
        ];
        for (into, (mantissas, theirs)) in self.relative.iter_mut().zip(neighbours) {
            let (into, mantissas, theirs) = (&mut into[..n], &mantissas[..n], &theirs[..n]);
            for x in 0..n {
                let steps = theirs[x].saturating_sub(exponents[x]);
                // Zero has no exponent. A cell of zero only needs to know whether a neighbour is
                // larger, and a neighbour of zero stays zero.
                let known = (u.here[x] > 0.0) & (mantissas[x] > 0.0);
                into[x] = mantissas[x] * pow2(if known { steps } else { 0 });
            }
        }
        let [west, east, north, south] = &self.relative;
        Around { here: u.here, west, east, north, south }
    }
}
