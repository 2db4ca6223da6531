//! Tests that solves from the previous field give the directions of a solve from scratch.

use crate::support::{
    Angles, CLEAR, Kind::*, Map, Random, block, leads_to_target, solve_near, solve_with,
};
use harmonic::{Change, Domain, Field, Solver, solve_exactly};

struct Case {
    solver: Solver,
    domain: Domain,
    field: Field,
}

impl Case {
    fn new(domain: Domain) -> Self {
        let mut solver = Solver::default();
        let field = solve_with(&mut solver, &domain);
        Self { solver, domain, field }
    }

    fn change(&mut self, changes: &[Change]) {
        self.domain.apply(changes).expect("valid changes");
        self.field = solve_near(&mut self.solver, &self.domain, &self.field);
    }

    fn angles(&self) -> Angles {
        Angles::between(&self.field, &solve_exactly(&self.domain).expect("a field"), CLEAR)
    }
}

/// A blocked cell in one corridor turns all directions of the hall.
#[test]
fn after_a_block_in_one_of_two_corridors_the_directions_in_the_hall_that_they_feed_are_right() {
    for (wide, size) in [(8, (3, 3)), (12, (3, 8))] {
        let mut map = Map::generate(Empty, 500, 256, 0);
        map.fill(80..240, 0..256, true);
        for row in [70, 180] {
            map.fill(80..240, row..row + wide, false);
        }
        map.aim((20, 128));
        let mut case = Case::new(map.domain());
        case.change(&block(&case.domain, (160, 70 + (wide - size.1) / 2), size));
        let angles = case.angles();
        assert!(angles.clear_max < 1.0, "{angles:?}");
    }
}

#[test]
fn after_many_changes_every_cell_leads_to_the_target_and_all_directions_are_right() {
    let unscreened = [Empty, Drums, Office].map(|kind| (kind, f64::INFINITY));
    for (kind, length) in unscreened.into_iter().chain([(Office, 2.236)]) {
        let side = 120;
        let mut case = Case::new(Map::generate(kind, side, side, 3).screened(length));
        let mut random = Random::new(7);
        let mut there: Vec<Vec<Change>> = Vec::new();
        for step in 0..150 {
            if there.len() > 8 && random.unit() < 0.5 {
                let mut gone = there.swap_remove(random.below(there.len()));
                gone.iter_mut().for_each(|change| change.blocked = false);
                case.change(&gone);
            } else {
                let at = (random.below(side), random.below(side));
                let side = 1 + random.below(5);
                let square = block(&case.domain, at, (side, side));
                case.change(&square);
                there.push(square);
            }
            assert!(leads_to_target(&case.field), "{kind:?}, change {step}");
        }
        let angles = case.angles();
        assert!(angles.p99 < 0.1, "{kind:?}: {angles:?}");
        assert!(angles.clear_max < 1.0, "{kind:?}: {angles:?}");
    }
}
