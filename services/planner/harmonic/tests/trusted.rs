//! Directions after updates: right everywhere where the map was solved whole, and in windows where the field says that they may
//! be trusted.
#![allow(
    clippy::expect_used,
    clippy::panic,
    reason = "helpers of tests may stop at the first broken promise"
)]

mod case;

use case::{Case, in_windows};
use harmonic::testing::{Angles, Kind, Map, Random, angle, exact, follow};
use harmonic::{Cancellation, Cell, Change, Field, Solver, Verdict};

/// Directions off those of `full` by more than ten degrees, of the cells that may be trusted; and how many those are.
fn untrue(case: &Case, full: &Field) -> (usize, usize) {
    let (mut untrue, mut trusted) = (0, 0);
    for row in 0..full.height() {
        for col in 0..full.width() {
            let cell = Cell::new(col, row);
            if let Some(right) = full.direction(cell).filter(|_| case.field.is_trusted(cell)) {
                trusted += 1;
                let off = case
                    .field
                    .direction(cell)
                    .map_or(180.0, |it| angle(it, right));
                untrue += usize::from(off > 10.0);
            }
        }
    }
    (untrue, trusted)
}

/// The share of trusted directions that are off by more than ten degrees after single changes on maps of each kind, and the
/// share of directions that are trusted.
fn trusted_after_single_changes(kinds: &[Kind]) -> (f64, f64) {
    let (mut untrue_cells, mut trusted_cells, mut cells) = (0, 0, 0);
    for (seed, (&kind, side)) in
        (100..).zip(kinds.iter().flat_map(|kind| [(kind, 160), (kind, 256)]))
    {
        let base = Case::new(&Map::generate(kind, side, side, seed));
        let mut case = Case::new(&Map::generate(kind, side, side, seed));
        let mut random = Random::new(seed);
        for _ in 0..20 {
            (case.domain, case.field) = (base.domain.clone(), base.field.clone());
            let changes = case.random_square(&mut random);
            if case.update(&changes) != Verdict::Provisional {
                continue;
            }
            let full = case.full();
            let (untrue, trusted) = untrue(&case, &full);
            untrue_cells += untrue;
            trusted_cells += trusted;
            cells += full.verification().reachable;
        }
    }
    let share = |part: usize, whole: usize| part as f64 / whole.max(1) as f64;
    (
        share(untrue_cells, trusted_cells),
        share(trusted_cells, cells),
    )
}

#[test]
fn in_wide_space_999_of_1000_directions_to_be_trusted_are_within_ten_degrees() {
    let wide = [Kind::Empty, Kind::Drums, Kind::Office, Kind::Trap];
    let (untrue, trusted) = trusted_after_single_changes(&wide);
    assert!(untrue <= 1e-3, "{untrue}");
    assert!(trusted > 0.2, "{trusted}");
}

#[test]
fn in_corridors_999_of_1000_directions_to_be_trusted_are_within_ten_degrees() {
    let narrow = [
        Kind::Maze { corridor: 1 },
        Kind::Maze { corridor: 4 },
        Kind::Maze { corridor: 8 },
        Kind::Maze { corridor: 16 },
        Kind::Serpentine { corridor: 8 },
        Kind::Serpentine { corridor: 24 },
    ];
    let (untrue, trusted) = trusted_after_single_changes(&narrow);
    assert!(untrue <= 1e-3, "{untrue}");
    assert!(trusted > 0.2, "{trusted}");
}

/// Two corridors `wide` cells wide that lead from the target's room to a hall.
fn corridors(wide: usize) -> Map {
    let mut map = Map::generate(Kind::Empty, 500, 256, 0);
    map.fill(80..240, 0..256, true);
    for row in [70, 180] {
        map.fill(80..240, row..row + wide, false);
    }
    map.aim((20, 128));
    map
}

/// A block of `size` in one of two corridors `wide` cells wide that feed a hall.
fn block_in_a_corridor(solver: Solver, wide: usize, size: (usize, usize)) -> (Case, Verdict) {
    let mut case = Case::with(solver, &corridors(wide));
    let (left, top) = (160, 70 + (wide - size.1) / 2);
    let cells = (top..top + size.1)
        .flat_map(|row| (left..left + size.0).map(move |col| Cell::new(col, row)));
    let changes: Vec<Change> = cells
        .map(|cell| Change {
            cell,
            blocked: true,
        })
        .collect();
    let verdict = case.update(&changes);
    (case, verdict)
}

/// The rim of such a window is narrow, so the ratio of u is nearly the same all along it, and yet the hall beyond is
/// another: what counts is how far the ratio is from one.
#[test]
fn a_block_in_one_of_two_corridors_leaves_no_trust_in_the_hall_they_feed_before_a_full_solve() {
    for (wide, size) in [(8, (3, 3)), (12, (3, 8))] {
        let (mut case, verdict) = block_in_a_corridor(in_windows(), wide, size);
        if verdict == Verdict::PassageClosed {
            assert_eq!(wide, 12, "the narrower block closes nothing");
            continue;
        }
        let full = case.full();
        let hall = |cell: Cell| cell.col > 250;
        let angles = Angles::between(&case.field, &full, hall);
        assert!(angles.over_10 > 0.2, "the block turns the hall: {angles:?}");
        let (untrue, trusted) = untrue(&case, &full);
        assert_eq!(untrue, 0, "of {trusted}");
    }
}

#[test]
fn a_map_solved_whole_by_every_update_is_right_in_the_hall_that_two_corridors_feed() {
    for (wide, size) in [(8, (3, 3)), (12, (3, 8))] {
        let (case, verdict) = block_in_a_corridor(Solver::default(), wide, size);
        assert_eq!(verdict, Verdict::Solved);
        let exact = exact(&case.domain).expect("a field");
        let angles = Angles::between(&case.field, &exact, |_| true);
        assert!(angles.clear_max < 1.0, "{angles:?}");
    }
}

/// Obstacles that appear and vanish, `updates` of them; the angles to the exact directions after the last.
fn appear_and_vanish(kind: Kind, side: usize, updates: usize) -> Angles {
    let mut case = Case::with(Solver::default(), &Map::generate(kind, side, side, 3));
    let mut random = Random::new(7);
    let mut there: Vec<Vec<Change>> = Vec::new();
    for step in 0..updates {
        let vanish = there.len() > 8 && random.unit() < 0.5;
        let changes = if vanish {
            let gone = there.swap_remove(random.below(there.len()));
            let free = |it: Change| Change {
                blocked: false,
                ..it
            };
            gone.into_iter().map(free).collect()
        } else {
            let at = (random.below(side), random.below(side));
            let mut square = case.square(at.0, at.1, 1 + random.below(5), true);
            square.retain(|change| !case.domain.is_blocked(change.cell));
            there.push(square.clone());
            square
        };
        assert_eq!(case.update(&changes), Verdict::Solved);
        assert_eq!(follow(&case.field), 1.0, "{kind:?}, update {step}");
    }
    let exact = exact(&case.domain).expect("a field");
    Angles::between(&case.field, &exact, |_| true)
}

#[test]
fn after_many_updates_of_a_map_solved_whole_all_directions_are_those_of_a_solve_from_scratch() {
    for kind in [Kind::Empty, Kind::Drums, Kind::Office] {
        let angles = appear_and_vanish(kind, 120, 150);
        assert!(angles.p99 < 0.1, "{kind:?}: {angles:?}");
        assert!(angles.clear_max < 1.0, "{kind:?}: {angles:?}");
    }
}

/// As a planner of a large map has it: each update in a window, behind it a full solve that starts from what there is.
#[test]
fn updates_in_windows_with_a_full_solve_behind_each_are_trusted_where_they_are_right() {
    for kind in [Kind::Empty, Kind::Drums, Kind::Office] {
        let mut case = Case::new(&Map::generate(kind, 200, 200, 5));
        let mut random = Random::new(11);
        let (mut untrue_cells, mut trusted_cells) = (0, 0);
        for step in 0..60 {
            let changes = case.random_square(&mut random);
            let verdict = case.update(&changes);
            let solved = case
                .solver
                .solve_near(&case.domain, &case.field, &Cancellation::new())
                .expect("a field");
            if verdict == Verdict::Provisional {
                let (untrue, trusted) = untrue(&case, &solved);
                untrue_cells += untrue;
                trusted_cells += trusted;
            }
            case.field = solved;
            assert_eq!(follow(&case.field), 1.0, "{kind:?}, update {step}");
        }
        assert!(
            untrue_cells * 1000 <= trusted_cells,
            "{kind:?}: {untrue_cells} of {trusted_cells}"
        );
        let exact = exact(&case.domain).expect("a field");
        let angles = Angles::between(&case.field, &exact, |_| true);
        assert!(angles.clear_max < 1.0, "{kind:?}: {angles:?}");
    }
}
