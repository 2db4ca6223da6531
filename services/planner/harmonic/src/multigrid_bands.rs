//! Multigrid for maps on which u spans more than single precision holds, in bands of u from the target outwards.
//!
//! The unknowns of a band are cells that are not resolved yet; u of the resolved cells beside them is their inflow, scaled to the
//! top of the range. Unknowns that come out well inside the range are resolved, with the exponent of the band. The others are left
//! to the next band: their influence on resolved cells goes with the square of the ratio of both u, since a random walk has to get
//! there and back. For the same reason a band needs no cells in which u is below its range, so its equations are those of the
//! rectangle around the cells within a number of steps from the inflow, which the band before told.

use crate::{
    Cancellation, Cell, Domain, Scaled, SolveError,
    multigrid::{FIRST_CHECK, Multigrid, SINGLE_CYCLES},
    real::Real,
    store::{BLOCKED, Store},
    verification,
};

/// Binary orders of magnitude below the largest inflow at which inflow has no effect on a band.
const NO_INFLOW: i32 = 2 * f32::TOP;

/// u in the farthest cells of a band is at most this, a thousandth of what is resolved; else the band was cut too short.
const CUT: f64 = 1e-3 * f32::KNOWN;

/// Cells are checked in which u is above this, so that those beside resolved ones are.
const CHECKED: f64 = 0.1 * f32::KNOWN;

/// Residuals in a band are smaller by this factor than they must be, as those at its end change with the next band.
const MARGIN: f64 = 16.0;

/// u of resolved cells is at most this in a band's units; larger ones are not beside an unknown.
const LARGEST: f32 = 1e35;

/// Steps of a band beyond those in which u fell out of range in the band before, and as a multiple of them. A band that is cut too
/// short is computed again.
const MORE: usize = 4;
const RESERVE: f64 = 1.1;

/// In a band of at most so many steps the second visits of coarse levels save no cycle, and take up to a third of the time.
const STEEP: usize = 96;

/// The sides of rectangles are multiples of this, for whole vectors.
const SIDES: usize = 16;

type Place = [u16; 2];

/// u of the cells resolved so far, and the cells from which the next band begins.
struct Bands<'a> {
    domain: &'a Domain,
    /// 0 in cells that are not resolved; [`BLOCKED`] in blocked ones.
    mantissas: Vec<f64>,
    /// In cells that are not resolved the number of the last band they were in.
    exponents: Vec<i32>,
    /// Resolved cells beside others that are not.
    edge: Vec<Place>,
}

#[derive(Default)]
struct Unknowns {
    /// In order of their distance in steps from the inflow.
    places: Vec<Place>,
    /// The start of each distance in `places`.
    starts: Vec<usize>,
}

/// The part of the map that holds a band's unknowns and their neighbours.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
struct Rectangle {
    col: usize,
    row: usize,
    width: usize,
    height: usize,
}

/// u of every cell of `domain` that can be reached, from that of the cells in which `known` is above [`KNOWN`](Real::KNOWN). The
/// memory of `levels` is used.
pub(crate) fn solve(
    domain: &Domain,
    known: Store,
    levels: &mut Multigrid<f32>,
    cancellation: &Cancellation,
    cycled: &mut dyn FnMut(),
) -> Result<Store, SolveError> {
    let mut bands = Bands::new(domain, &known);
    drop(known);
    let (mut inverse, mut values) = (Vec::new(), Vec::new());
    // The first band is about as deep as the known cells are.
    let resolved = bands.mantissas.iter().filter(|&&mantissa| mantissa > 0.0).count();
    let mut steps = 8 + 3 * resolved / bands.edge.len().max(1);
    let mut number = 0;
    while let Some(top) = bands.edge.iter().map(|&at| bands.exponents[bands.index(at)]).max() {
        cancellation.check()?;
        number += 1;
        let unknowns = bands.unknowns(top, number, steps);
        let here = bands.rectangle(&unknowns);
        levels.reshape(here.width, here.height);
        bands.load(here, top, &unknowns, (&mut inverse, &mut values), levels);
        levels.converge((FIRST_CHECK, SINGLE_CYCLES), cancellation, |levels, checked| {
            cycled();
            if !checked {
                return None;
            }
            levels.finish();
            levels.unload(|row, found| {
                let cells = row * here.width..(row + 1) * here.width;
                let values = values[cells.clone()].iter_mut().zip(&inverse[cells]);
                for ((value, _), found) in values.zip(found).filter(|it| *it.0.1 > 0.0) {
                    *value = found.max(0.0);
                }
            });
            let check = verification::check_above_with(here.width, &values, &inverse, CHECKED);
            let excess = MARGIN * check.excess();
            (excess > 1.0 || !check.holds_where_reached()).then_some(excess)
        })?;
        let value = |at: Place| f64::from(values[here.index(at)]);
        let farthest = unknowns.places.iter().rposition(|&at| value(at) > CUT).unwrap_or(0);
        let reached = unknowns.starts.partition_point(|&start| start <= farthest);
        if reached >= steps {
            steps *= 2;
            continue;
        }
        steps = MORE + (RESERVE * reached as f64) as usize;
        if !bands.resolve(&unknowns.places, value, top) {
            break;
        }
    }
    Ok(Store::narrowest(bands.mantissas, bands.exponents))
}

impl<'a> Bands<'a> {
    fn new(domain: &'a Domain, known: &Store) -> Self {
        let cells = 0..domain.blocked().len();
        let (mantissas, exponents) = cells
            .map(|cell| {
                let (value, _) = known.raw(cell);
                let u = if value > f32::KNOWN { known.u(cell) } else { Scaled::ZERO };
                (if value < 0.0 { BLOCKED } else { u.mantissa }, u.exponent)
            })
            .unzip();
        let mut bands = Self { domain, mantissas, exponents, edge: Vec::new() };
        let rows = 0..domain.height() as u16;
        bands.edge = rows
            .flat_map(|row| (0..domain.width() as u16).map(move |col| [col, row]))
            .filter(|&at| bands.is_edge(at))
            .collect();
        bands
    }

    fn index(&self, [col, row]: Place) -> usize {
        usize::from(row) * self.domain.width() + usize::from(col)
    }

    fn u(&self, at: Place) -> Scaled {
        let cell = self.index(at);
        Scaled { mantissa: self.mantissas[cell], exponent: self.exponents[cell] }
    }

    fn open(&self, [col, row]: Place) -> impl Iterator<Item = Place> {
        let (width, height) = (self.domain.width(), self.domain.height());
        let around = [
            (col > 0).then(|| [col - 1, row]),
            (usize::from(col) + 1 < width).then(|| [col + 1, row]),
            (row > 0).then(|| [col, row - 1]),
            (usize::from(row) + 1 < height).then(|| [col, row + 1]),
        ];
        around.into_iter().flatten().filter(|&at| self.mantissas[self.index(at)] == 0.0)
    }

    fn is_edge(&self, at: Place) -> bool {
        self.mantissas[self.index(at)] > 0.0 && self.open(at).next().is_some()
    }

    /// The cells of the edge from which there is inflow into a band.
    fn inflow(&self, top: i32) -> impl Iterator<Item = Place> {
        let least = top.saturating_sub(NO_INFLOW);
        self.edge.iter().copied().filter(move |&at| self.u(at).exponent > least)
    }

    /// The cells within so many `steps` from the inflow, marked by the `number` of the band.
    fn unknowns(&mut self, top: i32, number: i32, steps: usize) -> Unknowns {
        let mut unknowns = Unknowns::default();
        let mut before: Vec<Place> = self.inflow(top).collect();
        while !before.is_empty() && unknowns.starts.len() < steps {
            let start = unknowns.places.len();
            for &from in &before {
                let open: [Option<Place>; 4] = {
                    let mut open = self.open(from);
                    std::array::from_fn(|_| open.next())
                };
                for at in open.into_iter().flatten() {
                    let cell = self.index(at);
                    if self.exponents[cell] != number {
                        self.exponents[cell] = number;
                        unknowns.places.push(at);
                    }
                }
            }
            before.clear();
            before.extend_from_slice(&unknowns.places[start..]);
            unknowns.starts.push(start);
        }
        unknowns
    }

    /// The rectangle around the unknowns and their neighbours, extended to whole multiples of [`SIDES`] within the map.
    fn rectangle(&self, unknowns: &Unknowns) -> Rectangle {
        let (width, height) = (self.domain.width(), self.domain.height());
        let (mut cols, mut rows) = ((width, 0), (height, 0));
        for at in &unknowns.places {
            let [col, row] = at.map(usize::from);
            cols = (cols.0.min(col), cols.1.max(col + 1));
            rows = (rows.0.min(row), rows.1.max(row + 1));
        }
        let fit = |(start, end): (usize, usize), most: usize| {
            let side = (end + 2 - start).next_multiple_of(SIDES).min(most);
            (start.saturating_sub(1).min(most - side), side)
        };
        let ((col, width), (row, height)) = (fit(cols, width), fit(rows, height));
        Rectangle { col, row, width, height }
    }

    /// Loads the equations of a band; `inverse` takes 1 / diagonal of its unknowns, `values` u of the resolved cells beside them.
    fn load(
        &self,
        here: Rectangle,
        top: i32,
        unknowns: &Unknowns,
        (inverse, values): (&mut Vec<f32>, &mut Vec<f32>),
        levels: &mut Multigrid<f32>,
    ) {
        inverse.clear();
        inverse.resize(here.width * here.height, 0.0);
        values.clear();
        values.resize(here.width * here.height, BLOCKED as f32);
        for &at in &unknowns.places {
            let k = self.domain.screening_of(self.index(at));
            inverse[here.index(at)] = (0.25 / (1.0 + k)) as f32;
        }
        let inflow = |from| self.u(from).relative_to(top - f32::TOP) as f32;
        for &at in self.edge.iter().filter(|&&at| here.contains(at)) {
            values[here.index(at)] = inflow(at).min(LARGEST);
        }
        let inflow = self
            .inflow(top)
            .flat_map(|from| self.open(from).map(move |to| (here.cell(to), inflow(from))));
        let width = here.width;
        let is_steep = unknowns.starts.len() <= STEEP;
        levels.load(|row| &inverse[row * width..(row + 1) * width], inflow, is_steep);
    }

    /// Resolves the unknowns whose `value` is well inside the range; false if there is none.
    fn resolve(&mut self, unknowns: &[Place], value: impl Fn(Place) -> f64, top: i32) -> bool {
        let before = self.edge.len();
        for &at in unknowns {
            let value = value(at);
            if value > f32::KNOWN {
                let (u, cell) = (Scaled::new(value, top - f32::TOP), self.index(at));
                (self.mantissas[cell], self.exponents[cell]) = (u.mantissa, u.exponent);
                self.edge.push(at);
            }
        }
        let resolved = self.edge.len() > before;
        let mut edge = std::mem::take(&mut self.edge);
        edge.retain(|&at| self.is_edge(at));
        self.edge = edge;
        resolved
    }
}

impl Rectangle {
    fn contains(self, at: Place) -> bool {
        let [col, row] = at.map(usize::from);
        (self.col..self.col + self.width).contains(&col)
            && (self.row..self.row + self.height).contains(&row)
    }

    fn cell(self, at: Place) -> Cell {
        let [col, row] = at.map(usize::from);
        Cell::new(col - self.col, row - self.row)
    }

    fn index(self, at: Place) -> usize {
        let Cell { col, row } = self.cell(at);
        row * self.width + col
    }
}
