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

#[cfg(test)]
mod tests {
    use harmonic::{Cancellation, Domain, Guidance, Solver};

    use super::*;

    #[test]
    fn a_field_led_astray_leads_to_the_summit_from_everywhere_until_it_is_solved_again() {
        let domain = Domain::new(30, 20, vec![false; 600], Cell::new(25, 10)).unwrap();
        let mut solver = Solver::default();
        let mut field = solver.solve(&domain, &Cancellation::new()).unwrap();
        lead_astray(&mut field, [6.0, 7.0]);
        for (col, row) in [(2.0, 3.0), (20.0, 7.0), (7.0, 18.0)] {
            let Guidance::Along([x, y]) = field.guidance(col, row) else {
                panic!("no guidance at ({col}, {row})");
            };
            assert!(x * (6.0 - col) + y * (7.0 - row) > 0.0, "({x}, {y}) at ({col}, {row})");
        }
        let field = solver.solve(&domain, &Cancellation::new()).unwrap();
        assert!(matches!(field.guidance(20.0, 10.0), Guidance::Along([x, _]) if x > 0.9));
    }
}
