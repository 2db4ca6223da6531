//! Multigrid in bands of u, from the target outwards, for maps whose u exceeds the range of single
//! precision.
//!
//! The unknowns of a band are unresolved cells. u of adjacent resolved cells is their inflow,
//! scaled to the top of the range. Unknowns well inside the range become resolved, with the
//! exponent of the band. The next band takes the others.
//!
//! The others affect resolved cells by the square of the ratio of both u, because a random walk has
//! to get there and back. A band can therefore omit cells below its range. It covers the rectangle
//! around the cells within a number of steps from the inflow, estimated from the previous band.

use crate::{
    Cancellation, Cell, Domain, Scaled, SolveError,
    multigrid::{FIRST_CHECK, Multigrid, SINGLE_CYCLES},
    real::Real,
    store::{BLOCKED, Store},
    verification,
};

/// Binary orders of magnitude below the largest inflow at which inflow has no effect.
const NO_INFLOW: i32 = 2 * f32::TOP;

/// Limit of u in the farthest cells of a band, a thousandth of resolved values; above it, the band
/// is too short.
const CUT: f64 = 1e-3 * f32::KNOWN;

/// Threshold of u for checks; it includes the cells beside resolved ones.
const CHECKED: f64 = 0.1 * f32::KNOWN;

/// Margin on the residual limit, because residuals at the end change with the next band.
const MARGIN: f64 = 16.0;

/// Limit of u of resolved cells in units of the band; larger values are never beside an unknown.
const LARGEST: f32 = 1e35;

/// Steps of a band beyond the last ones in range in the previous band, absolute and relative.
const MORE: usize = 4;
const RESERVE: f64 = 1.1;

/// Steps up to which second visits of coarse levels save no cycle and take up to a third of the
/// time.
const STEEP: usize = 96;

/// Multiple for the sides of rectangles, to fill whole vectors.
const SIDES: usize = 16;

type Place = [u16; 2];

struct Bands<'a> {
    domain: &'a Domain,
    /// 0 in unresolved cells, [`BLOCKED`] in blocked ones.
    mantissas: Vec<f64>,
    /// Number of the last band, in unresolved cells.
    exponents: Vec<i32>,
    /// Resolved cells beside unresolved ones.
    edge: Vec<Place>,
}

#[derive(Default)]
struct Unknowns {
    /// Sorted by distance in steps from the inflow.
    places: Vec<Place>,
    /// Start of each distance in `places`.
    starts: Vec<usize>,
}

#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
struct Rectangle {
    col: usize,
    row: usize,
    width: usize,
    height: usize,
}

/// Computes u of every reachable cell from the cells in which `known` is above
/// [`KNOWN`](Real::KNOWN).
///
/// The memory of `levels` is reused.
pub(crate) fn solve(
    domain: &Domain,
    known: Store,
    levels: &mut Multigrid<f32>,
    cancellation: &Cancellation,
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
        levels.converge((FIRST_CHECK, SINGLE_CYCLES), cancellation, |levels| {
            levels.finish();
            levels.unload(1.0, &mut values);
            let check = verification::check_above_with(here.width, &values, &inverse, CHECKED);
            let excess = MARGIN * check.excess();
            (excess > 1.0 || !check.holds_where_reached()).then_some(excess)
        })?;
        let value = |at: Place| f64::from(values[here.index(at)]);
        let farthest = unknowns.places.iter().rposition(|&at| value(at) > CUT).unwrap_or(0);
        let reached = unknowns.starts.partition_point(|&start| start <= farthest);
        assert!(reached <= unknowns.starts.len() && unknowns.starts.len() <= steps);
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

    fn inflow(&self, top: i32) -> impl Iterator<Item = Place> {
        let least = top.saturating_sub(NO_INFLOW);
        self.edge.iter().copied().filter(move |&at| self.u(at).exponent > least)
    }

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

    fn rectangle(&self, unknowns: &Unknowns) -> Rectangle {
        let (width, height) = (self.domain.width(), self.domain.height());
        let (mut cols, mut rows) = ((width, 0), (height, 0));
        for at in &unknowns.places {
            let [col, row] = at.map(usize::from);
            cols = (cols.0.min(col), cols.1.max(col + 1));
            rows = (rows.0.min(row), rows.1.max(row + 1));
        }
        let fit = |(start, end): (usize, usize), most: usize| {
            assert!(start < end && end <= most);
            let side = (end + 2 - start).next_multiple_of(SIDES).min(most);
            (start.saturating_sub(1).min(most - side), side)
        };
        let ((col, width), (row, height)) = (fit(cols, width), fit(rows, height));
        assert!(col + width <= self.domain.width() && row + height <= self.domain.height());
        Rectangle { col, row, width, height }
    }

    /// Loads a band: `inverse` takes 1 / diagonal of its unknowns, `values` takes the adjacent
    /// resolved u.
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

    /// Resolves the unknowns whose `value` is well inside the range; returns false if there are
    /// none.
    fn resolve(&mut self, unknowns: &[Place], value: impl Fn(Place) -> f64, top: i32) -> bool {
        let before = self.edge.len();
        for &at in unknowns {
            let value = value(at);
            if value > f32::KNOWN {
                let (u, cell) = (Scaled::new(value, top - f32::TOP), self.index(at));
                assert_eq!(self.mantissas[cell], 0.0, "a band resolves a cell once");
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
        debug_assert!(self.contains(at));
        let Cell { col, row } = self.cell(at);
        row * self.width + col
    }
}
