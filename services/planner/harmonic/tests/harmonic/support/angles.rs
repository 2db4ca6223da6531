//! Angles between the directions of two fields.

use harmonic::{Cell, Field};

use super::{cells, reference::angle};

/// Angles in degrees, over the cells that can reach the target.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Angles {
    pub p99: f64,
    /// Share of angles above one degree.
    pub off: f64,
    /// Maximum away from saddle points.
    pub clear_max: f64,
}

/// Relative change of u to the next cell from which a direction is clear.
///
/// Nearer to a saddle point, a change of u by a thousandth turns the direction by degrees in any
/// solution.
pub(crate) const CLEAR: f64 = 2e-3;

impl Angles {
    /// Compares `field` with the `right` one, whose directions are clear where u changes by at least
    /// `clear` of itself between cells.
    pub(crate) fn between(field: &Field, right: &Field, clear: f64) -> Self {
        let mut angles = Vec::new();
        let mut clear_max = 0.0_f64;
        for cell in cells(right.width(), right.height()) {
            let Some(wanted) = right.direction(cell) else {
                continue;
            };
            let off = field.direction(cell).map_or(180.0, |it| angle(it, wanted));
            if steepness(right, cell) >= clear {
                clear_max = clear_max.max(off);
            }
            angles.push(off);
        }
        angles.sort_by(f64::total_cmp);
        let Some(last) = angles.len().checked_sub(1) else {
            return Self::default();
        };
        let p99 = angles[(last as f64 * 0.99) as usize];
        let off = angles.iter().filter(|angle| **angle > 1.0).count() as f64 / angles.len() as f64;
        Self { off, p99, clear_max }
    }
}

/// Returns |grad u| / u at a cell.
fn steepness(field: &Field, cell: Cell) -> f64 {
    let own = field.u(cell);
    // Beyond the first column or row, the number wraps to a cell outside the map, where u is zero.
    let u = |col: usize, row: usize| {
        field.u(Cell::new(col, row)).relative_to(own.exponent) / own.mantissa
    };
    let Cell { col, row } = cell;
    let across = u(col + 1, row) - u(col.wrapping_sub(1), row);
    let along = u(col, row + 1) - u(col, row.wrapping_sub(1));
    (0.5 * across).hypot(0.5 * along)
}
