//! Evenly spaced lines of E on any grid: B. Jobard, W. Lefer, "Creating evenly-spaced streamlines
//! of arbitrary density" (1997).

use common::samples::FieldCell;
use glam::DVec2;

use super::{
    lattice::{Lattice, around},
    page::{Path, ink},
};

pub(super) struct Style {
    /// Size limit of the lines, bytes; an irregular field gets sparser.
    pub budget: usize,
    /// Spacing of lines on the sheet.
    pub spacing: f64,
    /// Least spacing in cells; the field has no detail within a cell.
    pub least_cells: f64,
    pub colour: &'static str,
    /// Width on the sheet, and opacity of lines and arrowheads.
    pub stroke: (f64, f64, f64),
}

pub(super) const MISSION: Style = Style {
    budget: 100_000,
    spacing: 23.0,
    least_cells: 0.0,
    colour: ink::GUIDANCE,
    stroke: (0.8, 0.6, 0.75),
};

/// Distance to another line at which a line ends, in spacings.
const MERGED: f64 = 0.5;
/// In spacings.
const SHORTEST: f64 = 1.4;
/// Distance of arrowheads along a line, in spacings.
const ARROWS_APART: f64 = 6.0;
/// Cosine of the turn up to which a line is straight.
const STRAIGHT: f64 = 0.9985;
const ARROWHEAD: (f64, f64) = (2.3, 3.4);

pub(super) fn layer(lattice: &Lattice, cells: &[FieldCell], style: &Style) -> String {
    let cell = lattice.width / lattice.cols.max(1) as f64;
    let mut spacing = style.spacing.max(style.least_cells * cell);
    loop {
        let (mut lines, mut arrowheads) = (Path::default(), Path::default());
        for line in evenly_spaced(lattice, cells, spacing) {
            let on_sheet: Vec<DVec2> = line.iter().map(|&at| lattice.place(at)).collect();
            draw(&on_sheet, style.spacing, &mut lines, &mut arrowheads);
        }
        let whole = lattice.width.max(lattice.height);
        if lines.len() + arrowheads.len() <= style.budget || spacing > whole {
            return paint(&lines, &arrowheads, style);
        }
        spacing *= 1.5;
    }
}

fn paint(lines: &Path, arrowheads: &Path, style: &Style) -> String {
    let colour = style.colour;
    let (width, line_opacity, head_opacity) = style.stroke;
    lines.element(&format!(
        "fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\" stroke-opacity=\"{line_opacity}\" \
         stroke-linecap=\"round\" stroke-linejoin=\"round\""
    )) + &arrowheads.element(&format!("fill=\"{colour}\" fill-opacity=\"{head_opacity}\""))
}

/// Draws points only where the line bends, and arrowheads.
fn draw(line: &[DVec2], spacing: f64, lines: &mut Path, arrowheads: &mut Path) {
    let Some((&first, rest)) = line.split_first() else {
        return;
    };
    lines.move_to(first);
    let mut heading = DVec2::ZERO;
    let mut since_arrow = spacing * ARROWS_APART / 2.0;
    let mut from = first;
    for &to in rest {
        let step = (to - from).normalize_or_zero();
        if heading == DVec2::ZERO {
            heading = step;
        }
        if step.dot(heading) < STRAIGHT {
            lines.line_to(from);
            heading = step;
        }
        since_arrow += from.distance(to);
        if since_arrow >= spacing * ARROWS_APART {
            since_arrow = 0.0;
            arrowheads.polygon(arrowhead(to, step));
        }
        from = to;
    }
    lines.line_to(from);
}

pub(super) fn arrowhead(at: DVec2, heading: DVec2) -> [DVec2; 3] {
    let (width, length) = ARROWHEAD;
    let (ahead, aside) = (heading * length, heading.perp() * width);
    [at + ahead, at - ahead + aside, at - ahead - aside]
}

fn evenly_spaced(lattice: &Lattice, cells: &[FieldCell], spacing: f64) -> Vec<Vec<DVec2>> {
    let bins = [lattice.width, lattice.height].map(|side| (side / spacing) as usize + 2);
    let mut tracer = Tracer {
        lattice,
        cells,
        spacing: lattice.cols as f64 * spacing / lattice.width,
        drawn: vec![Vec::new(); bins[0] * bins[1]],
        bins,
    };

    let mut lines: Vec<Vec<DVec2>> = Vec::new();
    // Seeds all over the map serve unreached regions.
    for at in 0..bins[0] * bins[1] {
        let (col, row) = (at % bins[0], at / bins[0]);
        let seed = DVec2::new(col as f64, row as f64) * tracer.spacing;
        let mut seeded_from = lines.len();
        lines.extend(tracer.line_through(seed));
        // The next lines begin beside a drawn one.
        while let Some(line) = lines.get(seeded_from) {
            for seed in tracer.beside(line) {
                lines.extend(tracer.line_through(seed));
            }
            seeded_from += 1;
        }
    }
    lines
}

struct Tracer<'a> {
    lattice: &'a Lattice,
    cells: &'a [FieldCell],
    spacing: f64,
    /// Square bins of one spacing.
    drawn: Vec<Vec<DVec2>>,
    bins: [usize; 2],
}

impl Tracer<'_> {
    /// Returns a unit vector; `None` in a hazard and without guidance.
    fn direction(&self, at: DVec2) -> Option<DVec2> {
        let Lattice { cols, rows, .. } = *self.lattice;
        let last = DVec2::from([cols, rows].map(|cells| cells.saturating_sub(1) as f64));
        let e_at = |place: DVec2| {
            if !(place.cmpge(DVec2::ZERO) & place.cmple(last)).all() {
                return DVec2::ZERO;
            }
            let index = place.y as usize * cols + place.x as usize;
            self.cells.get(index).map_or(DVec2::ZERO, |cell| {
                let e = DVec2::new(cell.ex.into(), cell.ey.into());
                if e.is_finite() { e } else { DVec2::ZERO }
            })
        };
        if e_at(at.round()) == DVec2::ZERO {
            return None;
        }
        let low = at.floor();
        let part = at - low;
        let below = e_at(low).lerp(e_at(low + DVec2::X), part.x);
        let above = e_at(low + DVec2::Y).lerp(e_at(low + 1.0), part.x);
        below.lerp(above, part.y).try_normalize()
    }

    /// Returns `None` without room.
    fn line_through(&mut self, seed: DVec2) -> Option<Vec<DVec2>> {
        if self.is_crowded(seed, 0.98) || self.direction(seed).is_none() {
            return None;
        }
        let mut line = self.followed(seed, -1.0);
        line.reverse();
        line.push(seed);
        line.extend(self.followed(seed, 1.0));
        let length: f64 = line.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
        if length < SHORTEST * self.spacing {
            return None;
        }
        // Points a tenth of the spacing apart suffice.
        let mut kept: Option<DVec2> = None;
        for &point in &line {
            if kept.is_some_and(|kept| kept.distance(point) < 0.1 * self.spacing) {
                continue;
            }
            kept = Some(point);
            let bin = self.bin(point);
            if let Some(points) = self.drawn.get_mut(bin.1 * self.bins[0] + bin.0) {
                points.push(point);
            }
        }
        Some(line)
    }

    /// Follows E, or its reverse, until guidance ends or another line is near.
    fn followed(&self, seed: DVec2, sense: f64) -> Vec<DVec2> {
        // A step shorter than a cell cannot skip a wall.
        let step = (0.2 * self.spacing).min(0.9) * sense;
        assert!(step.abs() > 0.0);
        let most = (3.0 * self.lattice.longest() as f64 / step.abs()) as usize;
        let mut points = Vec::new();
        let mut at = seed;
        while points.len() < most {
            let next = self
                .direction(at)
                .and_then(|here| self.direction(at + here * (step / 2.0)))
                .map(|half_way| at + half_way * step);
            match next {
                // A sharper turn than a right angle means the target, or a ridge.
                Some(next) if self.turns_back(at, next) => break,
                Some(next) if !self.is_crowded(next, MERGED) => points.push(next),
                _ => break,
            }
            at = points[points.len() - 1];
        }
        points
    }

    fn turns_back(&self, at: DVec2, next: DVec2) -> bool {
        match (self.direction(at), self.direction(next)) {
            (Some(here), Some(there)) => here.dot(there) < 0.0,
            _ => true,
        }
    }

    fn beside(&self, line: &[DVec2]) -> Vec<DVec2> {
        line.iter()
            .step_by(4)
            .filter_map(|&at| Some((at, self.direction(at)?.perp() * self.spacing)))
            .flat_map(|(at, aside)| [at + aside, at - aside])
            .collect()
    }

    fn bin(&self, at: DVec2) -> (usize, usize) {
        let bin = at / self.spacing;
        (bin.x as usize, bin.y as usize)
    }

    fn is_crowded(&self, at: DVec2, share: f64) -> bool {
        let limit = share * self.spacing;
        around(self.bins, self.bin(at))
            .filter_map(|bin| self.drawn.get(bin))
            .flatten()
            .any(|point| point.distance_squared(at) < limit * limit)
    }
}
