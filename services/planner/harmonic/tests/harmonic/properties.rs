//! Tests on any map: an answer exists, every number is valid, and every reachable cell leads to the
//! target.

use crate::support::{Kind, Map, Reference, follow};
use harmonic::{Cancellation, Cell, Change, Domain, Field, Guidance, Screening, Settings, Solver};
use proptest::prelude::*;

/// Generates grids of up to 48 x 48 cells with any free target, any screening, with or without
/// costs.
fn any_domain() -> impl Strategy<Value = Domain> {
    // Lengths for screening coefficients of 0, of 0 .. 0.1 and of 0 .. 2.
    let screened = |most: f64| (0.0..most).prop_map(|k| Screening::cells(0.5 / k.sqrt()));
    let screening = prop_oneof![3 => Just(Screening::None), 1 => screened(0.1), 1 => screened(2.0)];
    (1_usize..48, 1_usize..48, 0.0..0.7, any::<u64>(), screening).prop_map(
        |(width, height, density, seed, screening)| {
            let mut random = crate::support::Random::new(seed);
            let target = Cell::new(random.below(width), random.below(height));
            let mut blocked: Vec<bool> =
                (0..width * height).map(|_| random.unit() < density).collect();
            blocked[target.row * width + target.col] = false;
            let domain = Domain::new(width, height, blocked, target).expect("a valid map");
            let domain = domain.with_screening(&screening).expect("a valid screening");
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
    let mut stack = vec![domain.target()];
    while let Some(cell) = stack.pop() {
        if domain.is_blocked(cell)
            || std::mem::replace(&mut seen[cell.row * width + cell.col], true)
        {
            continue;
        }
        stack.push(Cell::new(cell.col + 1, cell.row));
        stack.push(Cell::new(cell.col, cell.row + 1));
        stack.push(Cell::new(cell.col.wrapping_sub(1), cell.row));
        stack.push(Cell::new(cell.col, cell.row.wrapping_sub(1)));
    }
    seen
}

fn assert_sound(domain: &Domain, field: &Field) {
    let width = domain.width();
    for (index, reachable) in reachable(domain).into_iter().enumerate() {
        let cell = Cell::new(index % width, index / width);
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
    assert_eq!(follow(field), 1.0);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_grid_gets_a_field_that_leads_to_the_target_from_every_cell_that_can_reach_it(domain in any_domain()) {
        let field = Solver::default().solve(&domain, &Cancellation::new()).expect("a field");
        assert_sound(&domain, &field);
    }

    #[test]
    fn any_grid_is_within_a_degree_of_the_reference(domain in any_domain()) {
        let field = Solver::default().solve(&domain, &Cancellation::new()).expect("a field");
        let reference = Reference::solve(&domain);
        prop_assume!(reference.worst_residual < 1e-9);
        let (off, worst) = reference.compare(&field);
        // On a small map, a single cell on a saddle point exceeds the allowed share.
        let cells = off * field.verification().reachable as f64;
        assert!(off <= 1e-3 || cells < 2.5, "{cells} directions are off");
        assert!(worst <= 1.0, "a clear direction is {worst} degrees off");
    }
}

proptest! {
    // Each case solves and follows a map several times.
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_field_solved_after_any_changes_from_the_one_before_leads_to_the_target_from_every_cell_that_can_reach_it(
        seed in any::<u64>(),
        kind in prop_oneof![
            Just(Kind::Empty), Just(Kind::Drums), Just(Kind::Office), Just(Kind::Trap), Just(Kind::Maze { corridor: 1 }),
            Just(Kind::Maze { corridor: 5 }), Just(Kind::Maze { corridor: 16 }), Just(Kind::Serpentine { corridor: 8 }),
            Just(Kind::Noise { density: 0.2 })
        ],
        changes in prop::collection::vec((0_usize..150, 0_usize..150, any::<bool>()), 1..30),
    ) {
        let mut domain = Map::generate(kind, 150, 150, seed).domain().expect("a valid map");
        let mut solver = Solver::default();
        let mut field = solver.solve(&domain, &Cancellation::new()).expect("a field");
        for chunk in changes.chunks(3) {
            let chunk: Vec<Change> = chunk
                .iter()
                .map(|&(col, row, blocked)| Change { cell: Cell::new(col, row), blocked })
                .filter(|change| change.cell != domain.target())
                .collect();
            domain.apply(&chunk).expect("valid changes");
            field = solver.solve_near(&domain, &field, &Cancellation::new()).expect("a field");
            assert_sound(&domain, &field);
        }
    }
}

#[test]
fn a_set_up_that_was_patched_gives_the_same_field_bit_for_bit() {
    let mut map = Map::generate(Kind::Drums, 200, 170, 4);
    let mut solver = Solver::default();
    for step in 0..12 {
        map.fill(40 + 9 * step..43 + 9 * step, 60..64, step % 3 != 0);
        map.aim((30 + 5 * step, 100));
        let mut domain = map.domain().expect("a valid map");
        if step >= 4 {
            let mut costs = vec![1.0; 200 * 170];
            costs[step * 2000..][..2400].fill(3.0);
            domain = domain.with_screening(&Screening::cells(30.0)).expect("a valid screening");
            domain = domain.with_costs(costs).expect("valid costs");
        }
        let patched = solver.solve(&domain, &Cancellation::new()).expect("a field");
        let fresh = Solver::default().solve(&domain, &Cancellation::new()).expect("a field");
        assert_eq!(patched.verification(), fresh.verification());
        for index in 0..200 * 170 {
            let cell = Cell::new(index % 200, index / 200);
            assert_eq!(patched.u(cell), fresh.u(cell), "step {step}, {cell:?}");
        }
    }
}

#[test]
fn more_threads_give_the_same_field_and_verification() {
    let domain = Map::generate(Kind::Drums, 900, 800, 3).domain().expect("a valid map");
    let solve = |threads| {
        let threads = std::num::NonZeroUsize::new(threads).expect("at least one");
        Solver::new(Settings { threads, ..Settings::default() })
            .solve(&domain, &Cancellation::new())
            .expect("a field")
    };
    let (one, three) = (solve(1), solve(3));
    assert_eq!(one.verification(), three.verification());
    assert!(
        (0..900 * 800)
            .all(|i| one.u(Cell::new(i % 900, i / 900)) == three.u(Cell::new(i % 900, i / 900)))
    );
}

#[test]
fn starting_from_the_field_of_a_similar_map_gives_the_same_directions() {
    for length in [f64::INFINITY, 2.236] {
        let mut map = Map::generate(Kind::Office, 200, 200, 2);
        let domain = |map: &Map| {
            let domain = map.domain().expect("a valid map");
            domain.with_screening(&Screening::cells(length)).expect("a valid screening")
        };
        let mut solver = Solver::default();
        let before = solver.solve(&domain(&map), &Cancellation::new()).expect("a field");
        map.fill(90..96, 110..114, true);
        map.fill(20..23, 150..156, false);
        let domain = domain(&map);
        let near = solver.solve_near(&domain, &before, &Cancellation::new()).expect("a field");
        let fresh = Solver::default().solve(&domain, &Cancellation::new()).expect("a field");
        assert_sound(&domain, &near);
        for index in 0..200 * 200 {
            let cell = Cell::new(index % 200, index / 200);
            if let (Some(a), Some(b)) = (near.direction(cell), fresh.direction(cell)) {
                assert!(crate::support::angle(a, b) < 2.0, "{cell:?}: {a:?}, {b:?}");
            }
        }
    }
}
