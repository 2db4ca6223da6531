//! Updates in windows: after each, every cell still leads to the target, or the verdict says that a passage closed.
#![allow(
    clippy::expect_used,
    clippy::panic,
    reason = "helpers of tests may stop at the first broken promise"
)]

mod case;

use case::{Case, in_windows};
use harmonic::testing::{Kind, Map, Random, angle, follow};
use harmonic::{Cell, Change, Solver, Verdict};

/// A map is used for this many updates; every third starts from a full solve's field.
const MAPS: [(usize, usize); 5] = [(64, 60), (96, 60), (128, 60), (192, 80), (256, 60)];

/// Random insertions and removals on maps of one kind. After each, a walk from every cell arrives, or the verdict is that
/// a passage closed; and the field is blocked where the map is.
fn leads_on(kind: Kind) {
    let mut closed = 0;
    for (seed, (side, updates)) in (0..).zip(MAPS) {
        let base = Case::new(&Map::generate(kind, side, side, seed));
        let mut case = Case::new(&Map::generate(kind, side, side, seed));
        let mut random = Random::new(seed);
        for step in 0..updates {
            if step % 3 == 0 {
                (case.domain, case.field) = (base.domain.clone(), base.field.clone());
            }
            let changes = case.random_square(&mut random);
            if case.update(&changes) == Verdict::PassageClosed {
                closed += 1;
                case.field = case.full();
            } else {
                assert_eq!(
                    follow(&case.field),
                    1.0,
                    "{kind:?} of {side}, update {step}: {changes:?}"
                );
            }
            assert!(
                case.knows_the_map(),
                "{kind:?} of {side}, update {step}: {changes:?}"
            );
        }
    }
    let all: usize = MAPS.iter().map(|(_, updates)| updates).sum();
    assert!(
        closed * 2 < all,
        "{kind:?}: {closed} of {all} closed a passage"
    );
}

#[test]
fn after_every_update_each_cell_of_a_hall_leads_to_the_target() {
    leads_on(Kind::Empty);
}

#[test]
fn after_every_update_each_cell_among_drums_leads_to_the_target() {
    leads_on(Kind::Drums);
}

#[test]
fn after_every_update_each_cell_of_an_office_leads_to_the_target() {
    leads_on(Kind::Office);
}

#[test]
fn after_every_update_each_cell_around_a_trap_leads_to_the_target() {
    leads_on(Kind::Trap);
}

#[test]
fn after_every_update_each_cell_of_a_narrow_maze_leads_to_the_target() {
    leads_on(Kind::Maze { corridor: 1 });
    leads_on(Kind::Maze { corridor: 4 });
}

#[test]
fn after_every_update_each_cell_of_a_wide_maze_leads_to_the_target() {
    leads_on(Kind::Maze { corridor: 8 });
    leads_on(Kind::Maze { corridor: 16 });
}

#[test]
fn after_every_update_each_cell_of_a_serpentine_leads_to_the_target() {
    leads_on(Kind::Serpentine { corridor: 8 });
    leads_on(Kind::Serpentine { corridor: 24 });
}

#[test]
fn after_every_update_each_cell_of_a_map_of_noise_leads_to_the_target() {
    leads_on(Kind::Noise { density: 0.1 });
}

/// Two rooms, the target in the first, and a wall across the map with one door, closed cell by cell from a random side:
/// whenever no way is left, that is reported.
#[test]
fn a_door_closed_cell_by_cell_is_reported_when_the_last_cell_is() {
    let mut random = Random::new(5);
    let (mut narrowed, mut wakeups) = (0, 0);
    for door in [1, 2, 3, 5, 8] {
        for thick in [1, 2, 5] {
            for upright in [false, true] {
                for _ in 0..4 {
                    let rooms = Rooms::new(door, thick, upright, &mut random);
                    let mut case = Case::new(&rooms.map);
                    for (left, column) in rooms.columns.iter().enumerate().rev() {
                        let verdict = case.update(column);
                        if left == 0 {
                            assert_eq!(verdict, Verdict::PassageClosed, "{door} {thick} {upright}");
                            break;
                        }
                        narrowed += 1;
                        if verdict == Verdict::PassageClosed {
                            wakeups += 1;
                            case.field = case.full();
                        } else {
                            assert_eq!(follow(&case.field), 1.0, "{door} {thick} {upright}");
                        }
                    }
                }
            }
        }
    }
    assert!(wakeups * 6 <= narrowed, "{wakeups} of {narrowed}");
}

/// Two rooms joined by a door.
struct Rooms {
    map: Map,
    /// What closes the door, one column of cells through the wall after the other, the last first.
    columns: Vec<Vec<Change>>,
}

impl Rooms {
    fn new(door: usize, thick: usize, upright: bool, random: &mut Random) -> Self {
        let (long, short) = (200, 120);
        let (width, height) = if upright {
            (long, short)
        } else {
            (short, long)
        };
        let wall = 30 + random.below(140);
        let first = 1 + random.below(short - 2 - door);
        let mut map = Map::generate(Kind::Empty, width, height, 0);
        // Along the long side, then across it.
        let mut fill = |along: std::ops::Range<usize>, across: std::ops::Range<usize>, blocked| {
            if upright {
                map.fill(along, across, blocked);
            } else {
                map.fill(across, along, blocked);
            }
        };
        fill(wall..wall + thick, 0..short, true);
        fill(wall..wall + thick, first..first + door, false);
        let cell = |along: usize, across: usize| {
            if upright {
                Cell::new(along, across)
            } else {
                Cell::new(across, along)
            }
        };
        let mut columns: Vec<Vec<Change>> = (first..first + door)
            .map(|across| {
                let cells = (wall..wall + thick).map(|along| cell(along, across));
                cells
                    .map(|cell| Change {
                        cell,
                        blocked: true,
                    })
                    .collect()
            })
            .collect();
        if random.unit() < 0.5 {
            columns.reverse();
        }
        let target = cell(
            if random.unit() < 0.5 { 8 } else { 20 },
            random.below(short),
        );
        map.aim((target.col, target.row));
        Self { map, columns }
    }
}

#[test]
fn every_closed_doorway_is_reported() {
    for seed in 0..3 {
        let map = Map::generate(Kind::Office, 256, 256, seed);
        let base = Case::new(&map);
        let mut doors = 0;
        // Doors lie in the walls between rooms of 32 cells: runs of free cells along a wall's row.
        for wall in 1..8 {
            let row = wall * 32;
            let mut col = 1;
            while col < 255 {
                let len = (col..255)
                    .take_while(|&c| !base.domain.is_blocked(Cell::new(c, row)))
                    .count();
                if (2..8).contains(&len) {
                    let mut case = Case {
                        solver: in_windows(),
                        reference: Solver::default(),
                        domain: base.domain.clone(),
                        field: base.field.clone(),
                    };
                    let before = case.field.is_reachable(Cell::new(col, row));
                    let changes: Vec<Change> = (col..col + len)
                        .flat_map(|c| [Cell::new(c, row), Cell::new(c, row + 1)])
                        .map(|cell| Change {
                            cell,
                            blocked: true,
                        })
                        .collect();
                    let verdict = case.update(&changes);
                    // Unless another door of the same two rooms lets u flow on, all beyond it is cut off or led
                    // another way.
                    if before && follow_full_differs(&mut case) {
                        assert_eq!(
                            verdict,
                            Verdict::PassageClosed,
                            "seed {seed}, door at {col},{row}"
                        );
                        doors += 1;
                    }
                }
                col += len.max(1);
            }
        }
        assert!(doors > 5, "only {doors} doors closed anything");
    }
}

/// Whether the map after the update cuts off or turns around a region the field before it served.
fn follow_full_differs(case: &mut Case) -> bool {
    let full = case.full();
    let (mut unreached, mut turned) = (0, 0);
    for row in (0..256).step_by(2) {
        for col in (0..256).step_by(2) {
            let cell = Cell::new(col, row);
            let now = full.is_reachable(cell);
            unreached += usize::from(case.field.is_reachable(cell) && !now);
            if let (Some(a), Some(b)) = (case.field.direction(cell), full.direction(cell)) {
                turned += usize::from(angle(a, b) > 120.0);
            }
        }
    }
    unreached + turned > 100
}

#[test]
fn an_update_that_changes_nothing_leaves_the_field_as_it_is() {
    let mut case = Case::new(&Map::generate(Kind::Drums, 200, 200, 1));
    let before = case.field.direction(Cell::new(150, 150));
    assert_eq!(case.update(&[]), Verdict::Solved);
    let same = case.domain.is_blocked(Cell::new(99, 99));
    assert_eq!(
        case.update(&[Change {
            cell: Cell::new(99, 99),
            blocked: same
        }]),
        Verdict::Solved
    );
    assert_eq!(case.field.direction(Cell::new(150, 150)), before);
}

#[test]
fn changes_one_beside_the_other_are_updated_together_without_a_full_solve_between() {
    let mut map = Map::generate(Kind::Empty, 500, 400, 0);
    map.aim((400, 200));
    let mut case = Case::new(&map);
    // A wall that grows cell by cell, as a sonar would see it.
    for step in 0..40 {
        let verdict = case.update(&case.square(200, 150 + 2 * step, 2, true));
        assert_ne!(verdict, Verdict::PassageClosed, "step {step}");
        assert_eq!(follow(&case.field), 1.0, "step {step}");
    }
    // And one elsewhere, in a window of its own.
    let _ = case.update(&case.square(300, 80, 3, true));
    assert_eq!(follow(&case.field), 1.0);
}

/// A later patch may lie on the way by which paths regain the height they lose in an earlier one.
#[test]
fn many_updates_in_windows_without_a_full_solve_between_leave_no_cycle_or_say_that_a_passage_closed()
 {
    for seed in 0..2 {
        for kind in [Kind::Empty, Kind::Drums, Kind::Office] {
            let mut case = Case::new(&Map::generate(kind, 320, 320, seed));
            let mut random = Random::new(seed);
            for step in 0..20 {
                let changes = case.random_square(&mut random);
                if case.update(&changes) == Verdict::PassageClosed {
                    break;
                }
                assert_eq!(
                    follow(&case.field),
                    1.0,
                    "{kind:?}, seed {seed}, update {step}"
                );
            }
        }
    }
}
