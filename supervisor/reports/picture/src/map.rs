//! Field of a bare map, for conversion to pixels: large, without text, cells as squares of whole
//! pixels if they fit.

use common::samples::FieldCell;
use glam::DVec2;

use super::{
    bands::{self, Bands, Levels},
    cells::Blocks,
    lattice::{self, Lattice},
    page::Px,
    streamlines,
};

/// Longest side, pixels.
const LARGEST: usize = 2368;
/// Cells per side below which a map is drawn smaller, to keep its lines visible.
const SMALL: usize = 100;
const SMALL_SIDE: usize = 1200;
const FRAME: f64 = 16.0;

const WALL: &str = "#1d2430";
const CUT_OFF: &str = "#c9ccd1";
const TARGET: &str = "#e4342b";

/// Colours from the target outwards.
static BANDS: bands::Style = bands::Style {
    budget: usize::MAX,
    finest: 1200,
    bands: 40.0,
    ramp: &[
        [255.0, 247.0, 214.0],
        [253.0, 226.0, 160.0],
        [190.0, 220.0, 170.0],
        [122.0, 199.0, 184.0],
        [84.0, 168.0, 194.0],
        [74.0, 132.0, 189.0],
        [84.0, 98.0, 172.0],
    ],
    stroke: "stroke=\"#fff\" stroke-width=\"1\" stroke-opacity=\"0.45\"",
};

const LINES: streamlines::Style = streamlines::Style {
    budget: usize::MAX,
    spacing: 20.0,
    least_cells: 0.4,
    colour: "#10233f",
    stroke: (1.0, 0.6, 0.8),
};

/// Field and map, row-major, the first row at the top.
pub struct FieldOnMap<'a> {
    pub size: (usize, usize),
    pub blocked: &'a [bool],
    /// E along columns and rows; log2 u is negative infinity where blocked or cut off.
    pub cells: &'a [FieldCell],
    pub target: (usize, usize),
}

#[derive(Clone, Copy, Eq, PartialEq)]
enum Kind {
    Reachable,
    CutOff,
    Blocked,
}

/// Draws an SVG whose units are pixels.
pub fn map_svg(map: &FieldOnMap<'_>) -> String {
    let lattice = Lattice::of_image(map.size, DVec2::splat(FRAME), cell_size(map.size));
    let bands = Bands::of(&lattice, map.cells, &BANDS)
        .map_or(String::new(), |bands| bands.layer() + &flat_cells(map, &lattice, bands.levels));
    let lines = streamlines::layer(&lattice, map.cells, &LINES);
    let kinds = Blocks { lattice: &lattice, side: 1, kinds: kinds(map) };
    // Anti-aliasing would show seams between neighbouring rectangles.
    let crisp = "shape-rendering=\"crispEdges\"";
    let cut_off = kinds.area(Kind::CutOff);
    let squares = [
        cut_off.element(&format!("fill=\"{CUT_OFF}\" {crisp}")),
        cut_off.element(&format!("fill=\"url(#hatch)\" {crisp}")),
        kinds.area(Kind::Blocked).element(&format!("fill=\"{WALL}\" {crisp}")),
    ]
    .concat();
    let (width, height) = (lattice.width, lattice.height);
    let sheet = [width, height].map(|side| (side + 2.0 * FRAME).ceil());
    let inside =
        format!("x=\"{FRAME}\" y=\"{FRAME}\" width=\"{}\" height=\"{}\"", Px(width), Px(height));
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{}\" height=\"{}\">\n\
         <defs><clipPath id=\"map\"><rect {inside}/></clipPath>{HATCH}</defs>\n\
         <rect width=\"100%\" height=\"100%\" fill=\"{WALL}\"/>\n\
         <g clip-path=\"url(#map)\">\n{bands}{squares}{lines}</g>\n{}</svg>\n",
        sheet[0],
        sheet[1],
        target(&lattice, map.target),
    )
}

const HATCH: &str = "<pattern id=\"hatch\" width=\"8\" height=\"8\" patternUnits=\"userSpaceOnUse\" \
     patternTransform=\"rotate(45)\"><path d=\"M0 0V8\" stroke=\"#8b9199\" stroke-width=\"3\"/></pattern>";

/// Returns a whole number of pixels, or the reciprocal of one, for sharp squares.
fn cell_size((cols, rows): (usize, usize)) -> f64 {
    let longest = cols.max(rows).max(1);
    let room = if longest < SMALL { SMALL_SIDE } else { LARGEST };
    if longest <= room { (room / longest) as f64 } else { 1.0 / longest.div_ceil(LARGEST) as f64 }
}

fn kinds(map: &FieldOnMap<'_>) -> Vec<Kind> {
    map.blocked
        .iter()
        .zip(map.cells)
        .map(|(&blocked, cell)| {
            if blocked {
                Kind::Blocked
            } else if cell.log2_u.is_finite() {
                Kind::Reachable
            } else {
                Kind::CutOff
            }
        })
        .collect()
}

/// Draws cells beside a thin wall in a single colour; the other side's level sets would show
/// through.
fn flat_cells(map: &FieldOnMap<'_>, lattice: &Lattice, levels: Levels) -> String {
    if cell_size(map.size) < 2.0 {
        return String::new();
    }
    let colours: Vec<Option<u32>> = (0..map.cells.len())
        .map(|at| {
            is_beside_thin_wall(map, at, levels.step).then(|| levels.band(map.cells[at].log2_u))
        })
        .collect();
    let flat = Blocks { lattice, side: 1, kinds: colours };
    (0..=levels.count)
        .map(|nth| {
            flat.area(Some(nth))
                .element(&format!("fill=\"{}\" shape-rendering=\"crispEdges\"", levels.colour(nth)))
        })
        .collect()
}

/// Change of log2 u between cells this close without a wall between.
const OPEN: f64 = 8.0;

/// Returns whether a reachable cell and one across a blocked neighbour lie more than two bands
/// apart.
fn is_beside_thin_wall(map: &FieldOnMap<'_>, at: usize, step: f64) -> bool {
    let own = map.cells[at].log2_u;
    let (cols, rows) = map.size;
    let around = |at: usize| lattice::around([cols, rows], (at % cols, at / cols));
    let apart = OPEN.max(2.0 * step);
    own.is_finite()
        && around(at)
            .filter(|&wall| map.blocked[wall])
            .flat_map(around)
            .map(|across| map.cells[across].log2_u)
            .any(|across| across.is_finite() && f64::from((across - own).abs()) > apart)
}

fn target(lattice: &Lattice, (col, row): (usize, usize)) -> String {
    let at = lattice.place(DVec2::new(col as f64, row as f64));
    let (x, y) = (Px(at.x), Px(at.y));
    [(15.0, "#fff"), (12.5, TARGET), (8.5, "#fff"), (4.5, TARGET)]
        .map(|(radius, colour)| {
            format!("<circle cx=\"{x}\" cy=\"{y}\" r=\"{radius}\" fill=\"{colour}\"/>\n")
        })
        .concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longer_side_of_a_picture_is_900_to_2400_pixels_whatever_the_map() {
        for longest in [1, 10, 50, 99, 100, 604, 1184, 1185, 1674, 2368, 2369, 4096, 16_384] {
            let side = longest as f64 * cell_size((longest, 1));
            assert!((900.0..=2400.0).contains(&side), "{longest} became {side}");
        }
    }

    #[test]
    fn what_lies_beyond_a_thin_wall_does_not_shine_through() {
        // Two corridors of 100 cells, a wall of one cell between them, 600 powers of two apart.
        let log2_u = [0.0, f32::NEG_INFINITY, -600.0];
        let cells: Vec<FieldCell> = (0..300)
            .map(|at| FieldCell { log2_u: log2_u[at / 100], ..FieldCell::default() })
            .collect();
        let blocked: Vec<bool> = (0..300).map(|at| at / 100 == 1).collect();
        let svg = map_svg(&FieldOnMap {
            size: (100, 3),
            blocked: &blocked,
            cells: &cells,
            target: (0, 0),
        });
        assert!(svg.contains("<path d=\"M16 16h2300v23h-2300z\" fill=\"#fff7d6\""));
        assert!(svg.contains("<path d=\"M16 62h2300v23h-2300z\" fill=\"#5462ac\""));
    }

    #[test]
    fn a_wide_map_is_drawn_with_its_first_row_at_the_top() {
        // A map of 90 x 10 cells of 13 pixels: target left, wall in the first row, a cut-off cell
        // in the last.
        let size = (90, 10);
        let mut blocked = vec![false; 900];
        blocked[7] = true;
        let mut cells: Vec<FieldCell> = (0..900)
            .map(|at| FieldCell { ex: -1.0, ey: 0.0, log2_u: -((at % 90) as f32) })
            .collect();
        for hidden in [7, 819] {
            cells[hidden] = FieldCell { log2_u: f32::NEG_INFINITY, ..FieldCell::default() };
        }
        let svg = map_svg(&FieldOnMap { size, blocked: &blocked, cells: &cells, target: (0, 9) });
        assert!(svg.contains("width=\"1202\" height=\"162\""));
        assert!(svg.contains("<path d=\"M107 16h13v13h-13z\" fill=\"#1d2430\""));
        assert!(svg.contains("<path d=\"M133 133h13v13h-13z\" fill=\"#c9ccd1\""));
        assert!(svg.contains("cx=\"22.5\" cy=\"139.5\""));
        roxmltree::Document::parse(&svg).unwrap();
    }
}
