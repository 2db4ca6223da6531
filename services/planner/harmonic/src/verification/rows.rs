//! Sliding window of three rows of u over the map.

use super::cells::Around;
use crate::{real::Real, scaled::pow2};

pub(super) trait Window<R> {
    type Row<'f>;

    /// Moves down one row; `next` is the row below, `None` after the last.
    fn take(&mut self, next: Option<Self::Row<'_>>);

    fn around(&mut self) -> Around<'_, R>;
}

/// Three rows of the map with a zero at either end; blocked cells are zero.
pub(super) struct Rows<T> {
    above: Vec<T>,
    here: Vec<T>,
    below: Vec<T>,
}

impl<T: Copy + Default> Rows<T> {
    pub(super) fn new(width: usize) -> Self {
        let row = vec![T::default(); width + 2];
        Self { above: row.clone(), here: row.clone(), below: row }
    }

    /// Moves down one row and returns the row below, which is still that above.
    #[inline(always)]
    fn move_down(&mut self) -> &mut [T] {
        std::mem::swap(&mut self.above, &mut self.here);
        std::mem::swap(&mut self.here, &mut self.below);
        let width = self.below.len() - 2;
        &mut self.below[1..=width]
    }

    #[inline(always)]
    fn neighbours(&self) -> Around<'_, T> {
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

impl<R: Real> Window<R> for Rows<R> {
    type Row<'f> = &'f [R];

    #[inline(always)]
    fn take(&mut self, next: Option<&[R]>) {
        let zero = R::default();
        let below = self.move_down();
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
        self.neighbours()
    }
}

pub(super) struct ScaledRows {
    mantissas: Rows<f64>,
    exponents: Rows<i32>,
    /// West, east, north and south neighbours, with the exponent of the cell itself.
    relative: [Vec<f64>; 4],
}

impl ScaledRows {
    pub(super) fn new(width: usize) -> Self {
        Self {
            mantissas: Rows::new(width),
            exponents: Rows::new(width),
            relative: std::array::from_fn(|_| vec![0.0; width]),
        }
    }
}

impl Window<f64> for ScaledRows {
    type Row<'f> = (&'f [f64], &'f [i32]);

    #[inline(always)]
    fn take(&mut self, next: Option<(&[f64], &[i32])>) {
        self.mantissas.take(next.map(|(mantissas, _)| mantissas));
        let below = self.exponents.move_down();
        if let Some((_, exponents)) = next {
            below.copy_from_slice(exponents);
        }
    }

    #[inline(always)]
    fn around(&mut self) -> Around<'_, f64> {
        let (u, exponents) = (self.mantissas.neighbours(), self.exponents.neighbours());
        let n = u.here.len();
        let own = &exponents.here[..n];
        let neighbours = [
            (u.west, exponents.west),
            (u.east, exponents.east),
            (u.north, exponents.north),
            (u.south, exponents.south),
        ];
        for (into, (mantissas, theirs)) in self.relative.iter_mut().zip(neighbours) {
            let (into, mantissas, theirs) = (&mut into[..n], &mantissas[..n], &theirs[..n]);
            for x in 0..n {
                let steps = theirs[x].saturating_sub(own[x]);
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
