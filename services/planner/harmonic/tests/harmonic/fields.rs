//! Tests that full solves are right in every cell of every kind of map.

use crate::support::{
    Angles, CLEAR, Kind::*, Map, domain, leads_to_target, screened, solve, solve_near, solve_with,
    worst_residual,
};
use harmonic::{
    Cancellation, Cell, Domain, Field, Method, Screening, Settings, SolveError, Solver,
    solve_exactly,
};

/// Returns the screening length of coefficient `k`: u is the mean of the four neighbours over 1 + k.
fn length(k: f64) -> f64 {
    0.5 / k.sqrt()
}

fn assert_right(domain: &Domain, name: &str) -> Field {
    let (field, exact) = (solve(domain), solve_exactly(domain).expect("a field"));
    let residual = worst_residual(domain, &exact);
    assert!(residual < 1e-11, "{name}: the exact field itself is off by {residual}");
    assert!(leads_to_target(&field), "{name}: some cell does not lead to the target");
    let Angles { off, clear_max, .. } = Angles::between(&field, &exact, 5e-5);
    assert!(off <= 1e-3, "{name}: {off} of the directions are off by more than a degree");
    assert!(clear_max <= 1.0, "{name}: a clear direction is off by {clear_max} degrees");
    field
}

#[test]
fn directions_are_within_a_degree_of_the_reference_on_every_kind_of_map() {
    let maze = |corridor| Maze { corridor };
    let every = [
        Empty,
        Drums,
        Office,
        Trap,
        maze(1),
        maze(4),
        Serpentine { corridor: 3 },
        Noise { density: 0.3 },
    ];
    let screened = [Drums, Office, Trap, maze(4)];
    for (kinds, [width, height], seeds, k) in [
        (&every[..], [60, 75], 0..3, 0.0),
        // Large enough to solve coarse levels twice.
        (&every[..4], [100, 260], 1..2, 0.0),
        // With enough passages to factorise in slabs.
        (&[maze(1), maze(2), maze(4)], [170, 150], 2..3, 0.0),
        (&screened, [60, 75], 1..2, 0.002),
        (&screened, [60, 75], 1..2, 0.02),
        (&screened, [60, 75], 1..2, 0.5),
    ] {
        for (seed, &kind) in seeds.flat_map(|seed| kinds.iter().map(move |kind| (seed, kind))) {
            let name = format!("{kind:?}, {width} x {height}, seed {seed}, k = {k}");
            let domain = Map::generate(kind, width, height, seed).screened(length(k));
            let method = assert_right(&domain, &name).verification().method;
            assert!(width != 170 || method == Method::Multifrontal, "{name}: {method:?}");
        }
    }
}

#[test]
fn the_field_holds_down_to_ten_to_the_minus_twenty_thousand() {
    let map = Map::generate(Serpentine { corridor: 2 }, 40, 4200, 0);
    let least = assert_right(&map.domain(), "a serpentine of 4200 rows").log10_u_min();
    assert!(least < -20_000.0, "only down to 1e{least}");
}

#[test]
fn a_strip_of_one_cell_falls_as_its_difference_equation_does() {
    // u_i = (u_(i-1) + u_(i+1)) / (4 (1 + k)) has the decaying solution (a - sqrt(a^2 - 1))^i, a =
    // 2 (1 + k).
    for (k, at, tolerance) in [(0.0, 4000, 1e-6), (0.3, 300, 1e-3)] {
        let strip = domain(9000, 1, vec![false; 9000], Cell::new(0, 0));
        let a = 2.0 * (1.0 + k);
        let expected = at as f64 * (a - (a * a - 1.0_f64).sqrt()).log10();
        let found = solve(&screened(strip, length(k))).u(Cell::new(at, 0)).log10();
        assert!((found - expected).abs() < tolerance, "k = {k}: {found}, not {expected}");
    }
}

#[test]
fn invalid_domains_screenings_and_costs_are_refused_with_the_reason() {
    use SolveError::*;
    let at = Cell::new(0, 0);
    let refused = |width, height, blocked, at| Domain::new(width, height, blocked, at).unwrap_err();
    assert!(matches!(refused(0, 3, vec![], at), MapEmpty { .. }));
    assert!(matches!(refused(20_000, 1, vec![], at), MapTooLarge { .. }));
    assert!(matches!(refused(2, 2, vec![false; 3], at), WrongLength { .. }));
    assert!(matches!(refused(2, 2, vec![false; 4], Cell::new(2, 0)), Outside { .. }));
    assert!(matches!(refused(1, 1, vec![true], at), TargetBlocked { .. }));
    let valid = domain(2, 2, vec![false; 4], at);
    for length in [0.0, -3.0, 1e-4, f64::NAN] {
        let refused = valid.clone().with_screening(&Screening::cells(length));
        assert!(matches!(refused, Err(ScreeningLength { .. })), "{length}");
    }
    let valid = screened(valid, 9.0);
    let refused = |costs: Vec<f32>| valid.clone().with_costs(costs).unwrap_err();
    assert!(matches!(refused(vec![1.0; 3]), WrongLength { .. }));
    for wrong in [-1.0, f32::NAN, f32::INFINITY, 1e9] {
        assert!(matches!(refused(vec![1.0, wrong, 1.0, 1.0]), ScreeningLength { .. }), "{wrong}");
    }
}

#[test]
fn a_field_leads_round_cells_that_cost_more_than_the_way_round() {
    // A band of expensive cells crosses the hall, with a gap at one side.
    let (n, target) = (80, Cell::new(40, 10));
    let dear = |i: usize| (36..44).contains(&(i / n)) && i % n < 55;
    for (cost, through_gap) in [(1.0, false), (8.0, true)] {
        let domain = screened(domain(n, n, vec![false; n * n], target), 6.0);
        let costs = (0..n * n).map(|i| if dear(i) { cost } else { 1.0 }).collect();
        let field = solve(&domain.with_costs(costs).expect("valid costs"));
        let path = field.path(Cell::new(40, 70)).expect("a path");
        let across = path.iter().find(|at| at[1] < 40.0).expect("the band is crossed");
        assert_eq!(across[0] > 54.0, through_gap, "{across:?}");
    }
}

#[test]
fn a_cancelled_solve_says_so() {
    let cancellation = Cancellation::new();
    cancellation.clone().cancel();
    let domain = domain(3, 3, vec![false; 9], Cell::new(1, 1));
    assert_eq!(Solver::default().solve(&domain, &cancellation).err(), Some(SolveError::Cancelled));
}

#[test]
fn a_wide_map_with_strong_screening_is_right_beyond_the_range_of_f64() {
    let domain = Map::generate(Empty, 60, 800, 1).screened(length(5.0));
    let field = assert_right(&domain, "a wide map");
    assert!(field.log10_u_min() < -700.0, "only down to 1e{}", field.log10_u_min());
    assert_eq!(field.verification().method, Method::MultigridBands);
}

#[test]
fn a_hall_with_a_long_passage_one_cell_wide_is_not_factorised_and_right_in_the_passage_too() {
    let mut map = Map::generate(Empty, 260, 250, 0);
    // The hall has a passage along its rim, closed except for a door.
    map.fill(2..258, 2..248, true);
    map.fill(6..254, 6..244, false);
    map.fill(1..8, 120..140, false);
    let domain = map.screened(7.0);
    let field = assert_right(&domain, "a hall");
    assert!(field.log10_u_min() < -200.0, "only down to 1e{}", field.log10_u_min());
    let again = solve_near(&mut Solver::default(), &domain, &field);
    for field in [field, again] {
        assert_eq!(field.verification().method, Method::MultigridAndMultifrontal);
    }
}

#[test]
fn a_narrow_passage_beside_a_wide_one_is_right_where_its_far_end_takes_over() {
    // The narrow way loses 0.57 orders of magnitude per cell, the wide one 0.07. Beyond a certain
    // cell, the way back to the far end and around is better, by weights of 1e-400.
    let mut map = Map::generate(Empty, 1520, 25, 0);
    map.fill(15..1505, 21..22, true);
    map.fill(15..1505, 23..25, true);
    map.aim((5, 12));
    let field = solve(&map.domain());
    assert!(leads_to_target(&field));
    let toward = |col: usize| field.direction(Cell::new(col, 22)).expect("a direction")[0].signum();
    assert_eq!((toward(100), toward(1400)), (-1.0, 1.0));
    let turn = (100..1400).find(|&col| toward(col) > 0.0).expect("a turning point");
    // Both ways cost the same where, roughly, 0.572 x = 0.0647 * 1500 + 0.572 (1490 - x).
    assert!((780..900).contains(&turn), "the way turns at column {turn}");
}

#[test]
fn double_precision_solves_what_fails_verification_in_single_precision_and_has_no_memory_to_be_factorised()
 {
    let noise = Noise { density: 0.198_829_310_110_751_3 };
    let domain = Map::generate(noise, 299, 261, 1236).domain();
    let mut solver = Solver::new(Settings { memory_limit: 16 << 20, ..Settings::default() });
    let field = solve_with(&mut solver, &domain);
    assert_eq!(field.verification().method, Method::MultigridDouble);
    assert!(leads_to_target(&field));
    let angles = Angles::between(&field, &solve_exactly(&domain).expect("a field"), CLEAR);
    assert!(angles.clear_max < 1.0, "{angles:?}");
}

/// The coarse equations decide how much each cycle gains.
#[test]
fn open_maps_converge_within_a_few_cycles() {
    for (kind, length, most) in [
        (Empty, f64::INFINITY, 4),
        (Drums, f64::INFINITY, 8),
        (Office, f64::INFINITY, 25),
        (Drums, 20.0, 8),
        (Noise { density: 0.1 }, f64::INFINITY, 20),
    ] {
        let domain = Map::generate(kind, 301, 233, 1).screened(length);
        let mut solver = Solver::default();
        solve_with(&mut solver, &domain);
        let cycles = solver.cycles();
        assert!(cycles <= most, "{kind:?}, {length}: {cycles} cycles");
    }
}
