//! Tests on any map: an answer exists, every number is valid, and every reachable cell leads to the
//! target.

use crate::support::{
    Angles, Kind::*, Map, Random, around, cells, domain, leads_to_target, screened, solve,
    solve_near, solve_with, worst_residual,
};
use harmonic::{Cell, Change, Domain, Field, Guidance, Settings, Solver, solve_exactly};
use proptest::prelude::*;

/// Generates grids of up to 48 x 48 cells with any free target, any screening, with or without
/// costs.
fn any_domain() -> impl Strategy<Value = Domain> {
    // Lengths for screening coefficients of 0, of 0 .. 0.1 and of 0 .. 2.
    let length = |most: f64| (0.0..most).prop_map(|k| 0.5 / k.sqrt());
    let length = prop_oneof![3 => Just(f64::INFINITY), 1 => length(0.1), 1 => length(2.0)];
    (1_usize..48, 1_usize..48, 0.0..0.7, any::<u64>(), length).prop_map(
        |(width, height, density, seed, length)| {
            let mut random = Random::new(seed);
            let target = Cell::new(random.below(width), random.below(height));
            let mut blocked: Vec<bool> =
                (0..width * height).map(|_| random.unit() < density).collect();
            blocked[target.row * width + target.col] = false;
            let domain = screened(domain(width, height, blocked, target), length);
            if seed % 2 == 0 {
                return domain;
            }
            let costs = (0..width * height).map(|_| 5.0 * random.unit() as f32).collect();
            domain.with_costs(costs).expect("valid costs")
        },
    )
}

fn reachable(domain: &Domain) -> Vec<bool> {
    let (width, height) = (domain.width(), domain.height());
    let mut seen = vec![false; width * height];
    let mut stack = vec![domain.target().row * width + domain.target().col];
    while let Some(cell) = stack.pop() {
        if !domain.blocked()[cell] && !std::mem::replace(&mut seen[cell], true) {
            stack.extend(around(width, height, cell).into_iter().flatten());
        }
    }
    seen
}

/// Asserts that two fields have the same numbers in every cell.
fn assert_same(a: &Field, b: &Field, name: &str) {
    assert_eq!(a.verification(), b.verification(), "{name}");
    for cell in cells(a.width(), a.height()) {
        assert_eq!(a.u(cell), b.u(cell), "{name}, {cell:?}");
    }
}

fn assert_sound(domain: &Domain, field: &Field) {
    for (cell, reachable) in cells(domain.width(), domain.height()).zip(reachable(domain)) {
        assert_eq!(field.is_reachable(cell), reachable, "{cell:?}");
        assert_eq!(field.is_blocked(cell), domain.is_blocked(cell), "{cell:?}");
        for offset in [0.0, 0.49, -0.3] {
            match field.guidance(cell.col as f64 + offset, cell.row as f64 - offset) {
                Guidance::Along(d) | Guidance::WayOut(d) => {
                    assert!((d[0].hypot(d[1]) - 1.0).abs() < 1e-9, "{cell:?}: {d:?}");
                }
                Guidance::AtTarget => assert_eq!(cell, domain.target()),
                Guidance::Unreachable => assert!(!reachable, "{cell:?}"),
            }
        }
    }
    assert!(leads_to_target(field));
}

fn cases(cases: u32) -> ProptestConfig {
    ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(cases(400))]

    #[test]
    fn any_grid_gets_a_field_that_leads_to_the_target_from_every_cell_that_can_reach_it(domain in any_domain()) {
        let field = solve(&domain);
        assert_sound(&domain, &field);
        let exact = solve_exactly(&domain).expect("a field");
        prop_assume!(worst_residual(&domain, &exact) < 1e-9);
        let Angles { off, clear_max, .. } = Angles::between(&field, &exact, 5e-5);
        // On a small map, a single cell on a saddle point exceeds the allowed share.
        let cells = off * field.verification().reachable as f64;
        assert!(off <= 1e-3 || cells < 2.5, "{cells} directions are off");
        assert!(clear_max <= 1.0, "a clear direction is {clear_max} degrees off");
    }
}

proptest! {
    // Each case solves and follows a map several times.
    #![proptest_config(cases(30))]

    #[test]
    fn a_field_solved_after_any_changes_from_the_one_before_leads_to_the_target_from_every_cell_that_can_reach_it(
        seed in any::<u64>(),
        kind in prop::sample::select(vec![
            Empty, Drums, Office, Trap, Maze { corridor: 1 }, Maze { corridor: 5 },
            Maze { corridor: 16 }, Serpentine { corridor: 8 }, Noise { density: 0.2 }
        ]),
        changes in prop::collection::vec((0_usize..150, 0_usize..150, any::<bool>()), 1..30),
    ) {
        let mut domain = Map::generate(kind, 150, 150, seed).domain();
        let mut solver = Solver::default();
        let mut field = solve_with(&mut solver, &domain);
        for chunk in changes.chunks(3) {
            let chunk: Vec<Change> = chunk
                .iter()
                .map(|&(col, row, blocked)| Change { cell: Cell::new(col, row), blocked })
                .filter(|change| change.cell != domain.target())
                .collect();
            domain.apply(&chunk).expect("valid changes");
            field = solve_near(&mut solver, &domain, &field);
            assert_sound(&domain, &field);
        }
    }
}

#[test]
fn a_set_up_that_was_patched_gives_the_same_field_bit_for_bit() {
    let mut map = Map::generate(Drums, 200, 170, 4);
    let mut solver = Solver::default();
    for step in 0..12 {
        map.fill(40 + 9 * step..43 + 9 * step, 60..64, step % 3 != 0);
        map.aim((30 + 5 * step, 100));
        let mut domain = map.domain();
        if step >= 4 {
            let mut costs = vec![1.0; 200 * 170];
            costs[step * 2000..][..2400].fill(3.0);
            domain = map.screened(30.0).with_costs(costs).expect("valid costs");
        }
        let patched = solve_with(&mut solver, &domain);
        assert_same(&patched, &solve(&domain), &format!("step {step}"));
    }
}

#[test]
fn more_threads_give_the_same_field_and_verification() {
    let domain = Map::generate(Drums, 900, 800, 3).domain();
    let solve = |threads| {
        let threads = std::num::NonZeroUsize::new(threads).expect("at least one");
        solve_with(&mut Solver::new(Settings { threads, ..Settings::default() }), &domain)
    };
    assert_same(&solve(1), &solve(3), "three threads");
}
