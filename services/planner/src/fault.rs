//! Injected fault of the planner: a wrong field.

use harmonic::{Cell, Field, Scaled};

/// Overwrites u so that every reachable cell leads to `summit`, in cell units.
///
/// u halves per cell of distance, through walls too. The verification of the field stays.
pub(crate) fn lead_astray(field: &mut Field, summit: [f64; 2]) {
    field.overwrite(|Cell { col, row }| {
        let away = (col as f64 - summit[0]).hypot(row as f64 - summit[1]);
        Scaled::new((-away.fract()).exp2(), -(away as i32))
    });
}
