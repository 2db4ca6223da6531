//! Updates. In windows: after each, every cell still leads to the target, or the verdict says that a passage closed, and
//! directions are right where the field says that they may be trusted.
#![allow(
    clippy::expect_used,
    clippy::panic,
    reason = "helpers of tests may stop at the first broken promise"
)]

use harmonic::testing::{Angles, Kind, Map, Random, angle, exact, follow};
use harmonic::{Cancellation, Cell, Change, Domain, Field, Settings, Solver, Verdict};

/// A solver that updates in windows on maps of any size.
fn in_windows() -> Solver {
    Solver::new(Settings {
        whole_up_to: 0,
        ..Settings::default()
    })
}

struct Case {
    solver: Solver,
    /// For full solves to compare with.
    reference: Solver,
    domain: Domain,
    field: Field,
}

impl Case {
    fn new(map: &Map) -> Self {
        Self::with(in_windows(), map)
    }

    fn with(mut solver: Solver, map: &Map) -> Self {
        let domain = map.domain().expect("a valid map");
        let field = solver
            .solve(&domain, &Cancellation::new())
            .expect("the map has a field");
        Self {
            solver,
            reference: Solver::default(),
            domain,
            field,
        }
    }

    fn update(&mut self, changes: &[Change]) -> Verdict {
        self.solver
            .update(
                &mut self.domain,
                &mut self.field,
                changes,
                &Cancellation::new(),
            )
            .expect("a valid update")
    }

    fn full(&mut self) -> Field {
        self.reference
            .solve(&self.domain, &Cancellation::new())
            .expect("the map has a field")
    }

    /// Sets a square of cells but the target, as far as it lies inside the map's rim.
    fn square(&self, col: usize, row: usize, side: usize, blocked: bool) -> Vec<Change> {
        let (right, bottom) = (self.domain.width() - 1, self.domain.height() - 1);
        let cells = (row.max(1)..(row + side).min(bottom)).flat_map(|row| {
            (col.max(1)..(col + side).min(right)).map(move |col| Cell::new(col, row))
        });
        cells
            .filter(|&cell| cell != self.domain.target())
            .map(|cell| Change { cell, blocked })
            .collect()
    }

    /// A square of up to five cells a side anywhere, more often put down than taken away.
    fn random_square(&self, random: &mut Random) -> Vec<Change> {
        let at = (
            random.below(self.domain.width()),
            random.below(self.domain.height()),
        );
        self.square(at.0, at.1, 1 + random.below(5), random.unit() < 0.6)
    }

    /// Whether the field is blocked where the map is, and nowhere else.
    fn knows_the_map(&self) -> bool {
        let width = self.domain.width();
        let cell = |index: usize| Cell::new(index % width, index / width);
        let mut map = self.domain.blocked().iter().enumerate();
        map.all(|(index, &blocked)| self.field.is_blocked(cell(index)) == blocked)
    }
}

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
    for seed in 0..LONG_SEEDS {
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

const LONG_SEEDS: u64 = 2;
