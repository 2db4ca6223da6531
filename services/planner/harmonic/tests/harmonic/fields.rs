//! Tests that full solves are right in every cell of every kind of map.

use crate::support::{Angles, Kind, Map, Reference, follow};
use harmonic::{
    Cancellation, Cell, Domain, Field, Method, Screening, Settings, SolveError, Solver,
    solve_exactly,
};

fn solve(domain: &Domain) -> Field {
    Solver::default().solve(domain, &Cancellation::new()).expect("the map has a field")
}

/// Returns the screening of coefficient `k`: u is the mean of the four neighbours over 1 + k.
fn screening(k: f64) -> Screening {
    Screening::cells(0.5 / k.sqrt())
}

fn assert_right(map: &Map, name: &str) {
    let domain = map.domain().expect("a valid map");
    let field = solve(&domain);
    let reference = Reference::solve(&domain);
    assert!(
        reference.worst_residual < 1e-11,
        "{name}: the reference itself is off by {}",
        reference.worst_residual
    );
    assert_eq!(follow(&field), 1.0, "{name}: some cell does not lead to the target");
    let (off, worst) = reference.compare(&field);
    assert!(off <= 1e-3, "{name}: {off} of the directions are off by more than a degree");
    assert!(worst <= 1.0, "{name}: a clear direction is off by {worst} degrees");
}

#[test]
fn directions_are_within_a_degree_of_the_reference_on_every_kind_of_map() {
    for seed in 0..3 {
        for kind in [
            Kind::Empty,
            Kind::Drums,
            Kind::Office,
            Kind::Maze { corridor: 1 },
            Kind::Maze { corridor: 4 },
            Kind::Serpentine { corridor: 3 },
            Kind::Trap,
            Kind::Noise { density: 0.3 },
        ] {
            assert_right(&Map::generate(kind, 60, 75, seed), &format!("{kind:?}, seed {seed}"));
        }
    }
}

#[test]
fn directions_are_within_a_degree_on_maps_large_enough_to_solve_coarse_levels_twice() {
    for kind in [Kind::Empty, Kind::Drums, Kind::Office, Kind::Trap] {
        assert_right(&Map::generate(kind, 100, 260, 1), &format!("{kind:?} of 260 rows"));
    }
}

#[test]
fn directions_are_within_a_degree_in_mazes_with_enough_passages_to_factorise_in_slabs() {
    for corridor in [1, 2, 4] {
        let map = Map::generate(Kind::Maze { corridor }, 170, 150, 2);
        assert_eq!(
            solve(&map.domain().expect("a valid map")).verification().method,
            Method::Multifrontal
        );
        assert_right(&map, &format!("a maze with corridors of {corridor}"));
    }
}

#[test]
fn the_field_holds_down_to_ten_to_the_minus_twenty_thousand() {
    let map = Map::generate(Kind::Serpentine { corridor: 2 }, 40, 4200, 0);
    let field = solve(&map.domain().expect("a valid map"));
    assert!(field.log10_u_min() < -20_000.0, "only down to 1e{}", field.log10_u_min());
    assert_right(&map, "a serpentine of 4200 rows");
}

#[test]
fn a_strip_of_one_cell_falls_by_two_minus_root_three_a_cell() {
    // u_i = (u_(i-1) + u_(i+1)) / 4 has the decaying solution (2 - sqrt 3)^i.
    let domain = Domain::new(9000, 1, vec![false; 9000], Cell::new(0, 0)).expect("a valid map");
    let field = solve(&domain);
    let expected = 4000.0 * (2.0 - 3.0_f64.sqrt()).log10();
    assert!((field.u(Cell::new(4000, 0)).log10() - expected).abs() < 1e-6);
}

#[test]
fn invalid_domains_are_refused_with_the_reason() {
    let at = Cell::new(0, 0);
    assert!(matches!(Domain::new(0, 3, vec![], at), Err(SolveError::MapEmpty { .. })));
    assert!(matches!(Domain::new(20_000, 1, vec![], at), Err(SolveError::MapTooLarge { .. })));
    assert!(matches!(Domain::new(2, 2, vec![false; 3], at), Err(SolveError::WrongLength { .. })));
    assert!(matches!(
        Domain::new(2, 2, vec![false; 4], Cell::new(2, 0)),
        Err(SolveError::Outside { .. })
    ));
    assert!(matches!(Domain::new(1, 1, vec![true], at), Err(SolveError::TargetBlocked { .. })));
    for length in [0.0, -3.0, 1e-4, f64::NAN] {
        let domain = Domain::new(2, 2, vec![false; 4], at).expect("a valid map");
        assert!(
            matches!(
                domain.with_screening(&Screening::cells(length)),
                Err(SolveError::ScreeningLength { .. })
            ),
            "{length}"
        );
    }
}

#[test]
fn costs_are_refused_that_are_too_few_or_no_amounts() {
    let domain = Domain::new(2, 2, vec![false; 4], Cell::new(0, 0)).expect("a valid map");
    let domain = domain.with_screening(&Screening::cells(9.0)).expect("a valid screening");
    let refused = |costs: Vec<f32>| domain.clone().with_costs(costs).unwrap_err();
    assert!(matches!(refused(vec![1.0; 3]), SolveError::WrongLength { .. }));
    for wrong in [-1.0, f32::NAN, f32::INFINITY, 1e9] {
        assert!(matches!(refused(vec![1.0, wrong, 1.0, 1.0]), SolveError::ScreeningLength { .. }));
    }
}

#[test]
fn a_field_leads_round_cells_that_cost_more_than_the_way_round() {
    // A band of expensive cells crosses the hall, with a gap at one side.
    let (n, target) = (80, Cell::new(40, 10));
    let dear = |i: usize| (36..44).contains(&(i / n)) && i % n < 55;
    for (cost, through_gap) in [(1.0, false), (8.0, true)] {
        let domain = Domain::new(n, n, vec![false; n * n], target).expect("a valid map");
        let domain = domain.with_screening(&Screening::cells(6.0)).expect("a valid screening");
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
    let domain = Domain::new(3, 3, vec![false; 9], Cell::new(1, 1)).expect("a valid map");
    assert_eq!(Solver::default().solve(&domain, &cancellation).err(), Some(SolveError::Cancelled));
}

#[test]
fn a_screened_strip_falls_as_its_difference_equation_does() {
    // u_i = (u_(i-1) + u_(i+1)) / (4 (1 + k)) has the decaying solution (a - sqrt(a^2 - 1))^i, a =
    // 2 (1 + k).
    let domain = Domain::new(600, 1, vec![false; 600], Cell::new(0, 0)).expect("a valid map");
    let domain = domain.with_screening(&screening(0.3)).expect("a valid screening");
    let a = 2.6_f64;
    let expected = 300.0 * (a - (a * a - 1.0).sqrt()).log10();
    assert!((solve(&domain).u(Cell::new(300, 0)).log10() - expected).abs() < 1e-3);
}

#[test]
fn in_a_disc_u_falls_like_the_logarithm_and_all_directions_lead_to_the_centre() {
    let (n, centre, radius) = (161_usize, 80.0, 75.0);
    let from_centre = |i: usize| ((i % n) as f64 - centre, (i / n) as f64 - centre);
    let blocked = (0..n * n).map(|i| from_centre(i).0.hypot(from_centre(i).1) >= radius).collect();
    let domain = Domain::new(n, n, blocked, Cell::new(80, 80)).expect("a valid map");
    let field = solve(&domain);
    let u = |r: usize| field.u(Cell::new(80 + r, 80)).relative_to(0);
    for r in [20, 30, 50] {
        let expected = (radius / r as f64).ln() / (radius / 10.0).ln();
        assert!((u(r) / u(10) / expected - 1.0).abs() < 0.01, "at {r}");
    }
    for i in 0..n * n {
        let (x, y) = from_centre(i);
        if (10.0..60.0).contains(&x.hypot(y)) {
            let direction = field.direction(Cell::new(i % n, i / n)).expect("free space");
            assert!(crate::support::angle(direction, [-x, -y]) < 1.5, "at {x}, {y}");
        }
    }
}

#[test]
fn screening_keeps_directions_within_a_degree_of_the_reference() {
    for k in [0.002, 0.02, 0.5] {
        for kind in [Kind::Drums, Kind::Office, Kind::Trap, Kind::Maze { corridor: 4 }] {
            let domain = Map::generate(kind, 60, 75, 1).domain().expect("a valid map");
            let domain = domain.with_screening(&screening(k)).expect("a valid screening");
            let (off, worst) = Reference::solve(&domain).compare(&solve(&domain));
            assert!(
                off <= 1e-3 && worst <= 1.0,
                "{kind:?}, k = {k}: {off} off, worst {worst} degrees"
            );
        }
    }
}

#[test]
fn a_wide_map_with_strong_screening_is_right_beyond_the_range_of_f64() {
    let map = Map::generate(Kind::Empty, 60, 800, 1);
    let domain = map.domain().expect("a valid map");
    let domain = domain.with_screening(&screening(5.0)).expect("a valid screening");
    let field = solve(&domain);
    assert!(field.log10_u_min() < -700.0, "only down to 1e{}", field.log10_u_min());
    assert_eq!(field.verification().method, Method::MultigridBands);
    assert_eq!(follow(&field), 1.0);
    let (off, worst) = Reference::solve(&domain).compare(&field);
    assert!(off <= 1e-3 && worst <= 1.0, "{off} off, worst {worst} degrees");
}

#[test]
fn a_hall_with_a_long_passage_one_cell_wide_is_not_factorised_and_right_in_the_passage_too() {
    let mut map = Map::generate(Kind::Empty, 260, 250, 0);
    // The hall has a passage along its rim, closed except for a door.
    for (columns, rows) in [(2..258, 2..6), (2..258, 244..248), (2..6, 2..248), (254..258, 2..248)]
    {
        map.fill(columns, rows, true);
    }
    map.fill(1..8, 120..140, false);
    let domain = map.domain().expect("a valid map");
    let domain = domain.with_screening(&Screening::cells(7.0)).expect("a valid screening");
    let field = solve(&domain);
    assert!(field.log10_u_min() < -200.0, "only down to 1e{}", field.log10_u_min());
    assert_eq!(field.verification().method, Method::MultigridAndMultifrontal);
    assert_eq!(follow(&field), 1.0);
    let (off, worst) = Reference::solve(&domain).compare(&field);
    assert!(off <= 1e-3 && worst <= 1.0, "{off} off, worst {worst} degrees");
    let again = Solver::default().solve_near(&domain, &field, &Cancellation::new()).unwrap();
    assert_eq!(again.verification().method, Method::MultigridAndMultifrontal);
}

#[test]
fn a_narrow_passage_beside_a_wide_one_is_right_where_its_far_end_takes_over() {
    // The narrow way loses 0.57 orders of magnitude per cell, the wide one 0.07. Beyond a certain
    // cell, the way back to the far end and around is better, by weights of 1e-400.
    let mut map = Map::generate(Kind::Empty, 1520, 25, 0);
    map.fill(15..1505, 21..22, true);
    map.fill(15..1505, 23..25, true);
    map.aim((5, 12));
    let domain = map.domain().expect("a valid map");
    let field = solve(&domain);
    assert_eq!(follow(&field), 1.0);
    let toward = |col: usize| field.direction(Cell::new(col, 22)).expect("a direction")[0].signum();
    assert_eq!((toward(100), toward(1400)), (-1.0, 1.0));
    let turn = (100..1400).find(|&col| toward(col) > 0.0).expect("a turning point");
    // Both ways cost the same where, roughly, 0.572 x = 0.0647 * 1500 + 0.572 (1490 - x).
    assert!((780..900).contains(&turn), "the way turns at column {turn}");
}

#[test]
fn double_precision_solves_what_fails_verification_in_single_precision_and_has_no_memory_to_be_factorised()
 {
    let noise = Kind::Noise { density: 0.198_829_310_110_751_3 };
    let domain = Map::generate(noise, 299, 261, 1236).domain().expect("a valid map");
    let mut solver = Solver::new(Settings { memory_limit: 16 << 20, ..Settings::default() });
    let field = solver.solve(&domain, &Cancellation::new()).expect("the map has a field");
    assert_eq!(field.verification().method, Method::MultigridDouble);
    assert_eq!(follow(&field), 1.0);
    let angles = Angles::between(&field, &solve_exactly(&domain).expect("a field"));
    assert!(angles.clear_max < 1.0, "{angles:?}");
}
