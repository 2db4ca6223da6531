//! Inflow at single cells, restricted to the coarse levels by the transposed interpolation.

use super::{
    coarse::Coarse,
    couplings::Level,
    finest::Finest,
    galerkin::corner_weights,
    grid::{EE, EO, MARGIN, OE, clear},
};
use crate::real::Real;

type Flow<R> = ((usize, usize), R);

/// Makes the inflow of the finest level the right-hand side of every coarse one.
pub(super) fn restrict<R: Real>(finest: &Finest<R>, coarse: &mut [Coarse<R>]) {
    let mut flows = Vec::new();
    for source in &finest.sources {
        spread_flow(finest, source.plane, source.at, source.value, &mut flows);
    }
    for level in coarse {
        clear(&mut level.f);
        let mut next = Vec::new();
        for &((col, row), value) in &flows {
            if col >= level.grid.width || row >= level.grid.height {
                continue;
            }
            let (plane, at) = level.grid.locate(col, row);
            level.f[plane][at] += value;
            spread_flow(level, plane, at, value, &mut next);
        }
        next.sort_unstable_by_key(|flow| flow.0);
        next.dedup_by(|b, a| {
            let same = a.0 == b.0;
            if same {
                a.1 += b.1;
            }
            same
        });
        flows = next;
    }
}

fn spread_flow<R: Real>(
    level: &impl Level<R>,
    plane: usize,
    at: usize,
    value: R,
    flows: &mut Vec<Flow<R>>,
) {
    let stride = level.grid().stride;
    let (col, row) = ((at - MARGIN) % stride, (at - MARGIN) / stride - 1);
    let zero = R::default();
    let [west, east, north, south] = level.weights().each_ref().map(|row| row[at]);
    // On the coarse cells north-west, north-east, south-west and south-east, of which the first is
    // in the same column or row if that is even.
    let weights = match plane {
        EE => [R::ONE, zero, zero, zero],
        OE => [west, east, zero, zero],
        EO => [north, zero, south, zero],
        _ => {
            let mut corners = [zero; 4];
            corner_weights(level, at, 1, corners.each_mut().map(std::slice::from_mut));
            corners
        }
    };
    for (k, weight) in weights.into_iter().enumerate() {
        if weight > zero {
            flows.push(((col + k % 2, row + k / 2), value * weight));
        }
    }
}
