//! Multigrid for maps on which u spans more than single precision holds, in bands of u from the target outwards.
//!
//! The unknowns of a band are cells that are not resolved yet; u of the resolved cells beside them is their inflow, scaled to the
//! top of the range. Unknowns that come out well inside the range are resolved, with the exponent of the band. The others are left
//! to the next band: their influence on resolved cells goes with the square of the ratio of both u, since a random walk has to get
//! there and back. For the same reason a band needs no cells in which u is below its range, so its equations are those of the
//! rectangle around the cells within a number of steps from the inflow, which the band before told.

use crate::cancellation::Cancellation;
use crate::cell::Cell;
use crate::domain::Domain;
use crate::error::SolveError;
use crate::multigrid::{FIRST_CHECK, Multigrid, SINGLE_CYCLES};
use crate::real::Real;
use crate::scaled::Scaled;
use crate::store::{BLOCKED, Store};
use crate::verification;

/// Binary orders of magnitude below the largest inflow at which inflow has no effect on a band.
const NO_INFLOW: i32 = 2 * f32::TOP;

/// u in the farthest cells of a band is at most this, a thousandth of what is resolved; else the band was cut too short.
const CUT: f64 = 1e-3 * f32::KNOWN;

/// Cells are checked in which u is above this, so that those beside resolved ones are.
const CHECKED: f64 = 0.1 * f32::KNOWN;

/// Residuals in a band are smaller by this factor than they must be, as those at its end change with the next band.
const MARGIN: f64 = 4.0;

/// u of resolved cells is at most this in a band's units; larger ones are not beside an unknown.
const LARGEST: f32 = 1e35;

/// Steps of a band as a multiple of those in which u fell out of range in the band before.
const RESERVE: f64 = 1.25;

/// The sides of rectangles are multiples of this, so that the levels of one serve for the next.
const SIDES: usize = 32;

/// u of the cells resolved so far, and the cells from which the next band begins.
struct Bands<'a> {
    domain: &'a Domain,
    /// 0 in cells that are not resolved; [`BLOCKED`] in blocked ones.
    mantissas: Vec<f64>,
    /// In cells that are not resolved the number of the last band they were in.
    exponents: Vec<i32>,
    /// Resolved cells beside others that are not.
    edge: Vec<usize>,
}

/// The unknowns of a band.
#[derive(Default)]
struct Unknowns {
    /// In order of their distance in steps from the inflow.
    cells: Vec<usize>,
    /// The end of each distance in `cells`.
    ends: Vec<usize>,
}

/// The part of the map that holds a band's unknowns and their neighbours.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
struct Rectangle {
    col: usize,
    row: usize,
    width: usize,
    height: usize,
}

/// u of every cell of `domain` that can be reached, from that of the cells in which `known` is above [`KNOWN`](Real::KNOWN).
pub(crate) fn solve(
    domain: &Domain,
    known: Store,
    cancellation: &Cancellation,
    cycled: &mut dyn FnMut(),
) -> Result<Store, SolveError> {
    let mut bands = Bands::new(domain, &known);
    drop(known);
    let mut levels = None;
    let mut shape = Rectangle::default();
    let (mut inverse, mut values) = (Vec::new(), Vec::new());
    let mut steps = usize::MAX;
    let mut number = 0;
    while let Some(top) = bands.edge.iter().map(|&cell| bands.exponents[cell]).max() {
        cancellation.check()?;
        number += 1;
        let unknowns = bands.unknowns(top, number, steps);
        let here = bands.rectangle(&unknowns);
        if levels.is_none() || (here.width, here.height) != (shape.width, shape.height) {
            // The memory of the other levels is freed first.
            drop(levels.take());
        }
        shape = here;
        let levels = levels.get_or_insert_with(|| Multigrid::new(here.width, here.height));
        bands.load(here, top, number, (&mut inverse, &mut values), levels);
        levels.converge((FIRST_CHECK, SINGLE_CYCLES), cancellation, |levels, checked| {
            cycled();
            if !checked {
                return None;
            }
            levels.finish();
            bands.read(here, number, levels, &mut values);
            let check = verification::check_above_with(here.width, &values, &inverse, CHECKED);
            let excess = MARGIN * check.excess();
            (excess > 1.0 || !check.holds_where_reached()).then_some(excess)
        })?;
        let value = |cell: usize| f64::from(values[here.index(domain, cell)]);
        let within =
            |&distance: &usize| unknowns.at(distance).iter().any(|&cell| value(cell) > CUT);
        let last = unknowns.ends.len() - 1;
        if unknowns.ends.len() == steps && within(&last) {
            steps = steps.saturating_mul(2);
            continue;
        }
        let reached = (0..=last).rev().find(within).unwrap_or(0);
        steps = (RESERVE * (reached + 2) as f64) as usize + 4;
        if !bands.resolve(&unknowns.cells, value, top) {
            break;
        }
    }
    Ok(Store::narrowest(bands.mantissas, bands.exponents))
}

impl<'a> Bands<'a> {
    fn new(domain: &'a Domain, known: &Store) -> Self {
        let cells = 0..domain.blocked().len();
        let (mantissas, exponents) = cells
            .clone()
            .map(|cell| {
                let (value, _) = known.raw(cell);
                let u = if value > f32::KNOWN { known.u(cell) } else { Scaled::ZERO };
                (if value < 0.0 { BLOCKED } else { u.mantissa }, u.exponent)
            })
            .unzip();
        let mut bands = Self { domain, mantissas, exponents, edge: cells.collect() };
        bands.keep_edge();
        bands
    }

    /// The neighbours of a cell that are not resolved.
    fn open(&self, cell: usize) -> impl Iterator<Item = usize> {
        let around = self.domain.neighbours(cell).into_iter().flatten();
        around.filter(|&cell| self.mantissas[cell] == 0.0)
    }

    /// Leaves those cells in the edge that belong there.
    fn keep_edge(&mut self) {
        let mut edge = std::mem::take(&mut self.edge);
        edge.retain(|&cell| self.mantissas[cell] > 0.0 && self.open(cell).next().is_some());
        self.edge = edge;
    }

    /// The cells of the edge from which there is inflow into a band.
    fn inflow(&self, top: i32) -> impl Iterator<Item = usize> {
        let counts = move |&cell: &usize| self.exponents[cell] > top.saturating_sub(NO_INFLOW);
        self.edge.iter().copied().filter(counts)
    }

    /// The cells within so many `steps` from the inflow, marked by the `number` of the band.
    fn unknowns(&mut self, top: i32, number: i32, steps: usize) -> Unknowns {
        let mut unknowns = Unknowns::default();
        let mut before: Vec<usize> = self.inflow(top).collect();
        while !before.is_empty() && unknowns.ends.len() < steps {
            let start = unknowns.cells.len();
            for &cell in &before {
                let around = self.domain.neighbours(cell).into_iter().flatten();
                for next in around {
                    if self.mantissas[next] == 0.0 && self.exponents[next] != number {
                        self.exponents[next] = number;
                        unknowns.cells.push(next);
                    }
                }
            }
            before.clear();
            before.extend_from_slice(&unknowns.cells[start..]);
            if !before.is_empty() {
                unknowns.ends.push(unknowns.cells.len());
            }
        }
        unknowns
    }

    /// The rectangle around the unknowns and their neighbours, extended to whole multiples of [`SIDES`] within the map.
    fn rectangle(&self, unknowns: &Unknowns) -> Rectangle {
        let (width, height) = (self.domain.width(), self.domain.height());
        let (mut cols, mut rows) = ((width, 0), (height, 0));
        for &cell in &unknowns.cells {
            let (col, row) = (cell % width, cell / width);
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

    /// Loads the equations of a band; `inverse` takes 1 / diagonal of its unknowns, `values` u of resolved cells.
    fn load(
        &self,
        here: Rectangle,
        top: i32,
        number: i32,
        (inverse, values): (&mut Vec<f32>, &mut Vec<f32>),
        levels: &mut Multigrid<f32>,
    ) {
        let reference = top - f32::TOP;
        inverse.clear();
        values.clear();
        for row in here.row..here.row + here.height {
            let start = row * self.domain.width() + here.col;
            for cell in start..start + here.width {
                let unknown = self.mantissas[cell] == 0.0 && self.exponents[cell] == number;
                let k = self.domain.screening_coefficient(cell);
                inverse.push(if unknown { (0.25 / (1.0 + k)) as f32 } else { 0.0 });
                let u = Scaled { mantissa: self.mantissas[cell], exponent: self.exponents[cell] };
                let value =
                    if u.mantissa > 0.0 { u.relative_to(reference) as f32 } else { BLOCKED as f32 };
                values.push(value.min(LARGEST));
            }
        }
        let inflow = self.inflow(top).flat_map(|from| {
            let u = Scaled { mantissa: self.mantissas[from], exponent: self.exponents[from] };
            let value = u.relative_to(reference) as f32;
            let marked = self.open(from).filter(|&to| self.exponents[to] == number);
            marked.map(move |to| (here.cell(self.domain, to), value))
        });
        let width = here.width;
        levels.load(|row| &inverse[row * width..(row + 1) * width], inflow);
    }

    /// Reads u of the unknowns of a band.
    fn read(&self, here: Rectangle, number: i32, levels: &Multigrid<f32>, values: &mut [f32]) {
        levels.unload(|row, found| {
            let start = (here.row + row) * self.domain.width() + here.col;
            let values = &mut values[row * here.width..][..here.width];
            for ((value, &found), cell) in values.iter_mut().zip(found).zip(start..) {
                if self.mantissas[cell] == 0.0 && self.exponents[cell] == number {
                    *value = found.max(0.0);
                }
            }
        });
    }

    /// Resolves the `cells` whose `value` is well inside the range; false if there is none.
    fn resolve(&mut self, cells: &[usize], value: impl Fn(usize) -> f64, top: i32) -> bool {
        let before = self.edge.len();
        for &cell in cells {
            let value = value(cell);
            if value > f32::KNOWN {
                let u = Scaled::new(value, top - f32::TOP);
                (self.mantissas[cell], self.exponents[cell]) = (u.mantissa, u.exponent);
                self.edge.push(cell);
            }
        }
        let resolved = self.edge.len() > before;
        self.keep_edge();
        resolved
    }
}

impl Unknowns {
    /// The cells at a distance.
    fn at(&self, distance: usize) -> &[usize] {
        let start = if distance == 0 { 0 } else { self.ends[distance - 1] };
        &self.cells[start..self.ends[distance]]
    }
}

impl Rectangle {
    /// The place in the rectangle of a cell of the map.
    fn cell(self, domain: &Domain, cell: usize) -> Cell {
        let width = domain.width();
        Cell::new(cell % width - self.col, cell / width - self.row)
    }

    /// Its index in the rectangle.
    fn index(self, domain: &Domain, cell: usize) -> usize {
        let Cell { col, row } = self.cell(domain, cell);
        row * self.width + col
    }
}
