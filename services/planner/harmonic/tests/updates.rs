//! Local updates: after each, every cell still leads to the target, or the verdict says that a passage closed.
#![allow(
    clippy::expect_used,
    clippy::panic,
    reason = "helpers of tests may stop at the first broken promise"
)]

use harmonic::testing::{Kind, Map, Random, angle, follow};
use harmonic::{Cancellation, Cell, Change, Domain, Field, Solver, Verdict};

struct Case {
    solver: Solver,
    /// For full solves to compare with.
    reference: Solver,
    domain: Domain,
    field: Field,
}

impl Case {
    fn new(map: &Map) -> Self {
        let domain = map.domain().expect("a valid map");
        let mut solver = Solver::default();
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

    /// How many cells up to `around` cells from `changes` can reach the target, and how many directions there are more than
    /// `degrees` off those of `full`.
    fn off(&self, full: &Field, changes: &[Change], around: usize, degrees: f64) -> (usize, usize) {
        let (Some(first), Some(last)) = (changes.first(), changes.last()) else {
            return (0, 0);
        };
        let (mut all, mut off) = (0, 0);
        for row in first.cell.row.saturating_sub(around)..=last.cell.row + around {
            for col in first.cell.col.saturating_sub(around)..=last.cell.col + around {
                let cell = Cell::new(col, row);
                all += usize::from(full.is_reachable(cell));
                off += match (self.field.direction(cell), full.direction(cell)) {
                    (Some(a), Some(b)) => usize::from(angle(a, b) > degrees),
                    (a, b) => usize::from(a.is_some() != b.is_some()),
                };
            }
        }
        (all, off)
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

/// The smallest window reaches this far around a change.
const WINDOW: usize = 24;

/// Cases of one verdict, and how well directions around the change agree with those of a full solve.
#[derive(Debug, Default)]
struct Count {
    cases: usize,
    /// Cases with more than three cells off within 8 of the change: a saddle point that moves by a hair turns a cell or two
    /// by any angle.
    off_near: usize,
    /// Cases with more than one cell in a hundred off within two thirds of the window.
    off: usize,
    /// Cells of all windows, and those off: the other side of a wall may be stale.
    cells: usize,
    cells_off: usize,
}

impl Count {
    fn add(&mut self, case: &mut Case, changes: &[Change], degrees: f64) {
        let full = case.full();
        let off = |around| case.off(&full, changes, around, degrees);
        let ((_, near), (some, some_off), (all, all_off)) =
            (off(8), off(WINDOW * 2 / 3), off(WINDOW));
        self.cases += 1;
        self.off_near += usize::from(near > 3);
        self.off += usize::from(some_off * 100 > some);
        self.cells += all;
        self.cells_off += all_off;
    }

    /// At most one in `many` is off, be it cases or cells.
    fn assert_right(&self, many: usize) {
        assert!(self.off_near * many <= self.cases, "{self:?}");
        assert!(self.off * many <= self.cases, "{self:?}");
        assert!(self.cells_off * many <= self.cells, "{self:?}");
    }
}

/// Single changes on maps of each kind: those after which the field is accurate, and those for which a full solve was advised.
fn single_changes(kinds: &[Kind], degrees: f64) -> [Count; 2] {
    let mut counts = [Count::default(), Count::default()];
    for (seed, (&kind, side)) in
        (100..).zip(kinds.iter().flat_map(|kind| [(kind, 160), (kind, 256)]))
    {
        let base = Case::new(&Map::generate(kind, side, side, seed));
        let mut case = Case::new(&Map::generate(kind, side, side, seed));
        let mut random = Random::new(seed);
        for _ in 0..70 {
            (case.domain, case.field) = (base.domain.clone(), base.field.clone());
            let changes = case.random_square(&mut random);
            let count = match case.update(&changes) {
                Verdict::Accurate => &mut counts[0],
                Verdict::FullSolveAdvised => &mut counts[1],
                Verdict::PassageClosed => continue,
            };
            count.add(&mut case, &changes, degrees);
        }
    }
    counts
}

#[test]
fn around_a_change_directions_called_accurate_are_within_a_degree_of_a_full_solve_in_99_of_100_cases()
 {
    let wide = [Kind::Empty, Kind::Drums, Kind::Office, Kind::Trap];
    let [accurate, _] = single_changes(&wide, 1.0);
    assert!(accurate.cases > 300, "{accurate:?}");
    accurate.assert_right(100);
}

#[test]
fn in_corridors_directions_called_accurate_are_within_a_degree_in_99_of_100_cases() {
    let narrow = [
        Kind::Maze { corridor: 1 },
        Kind::Maze { corridor: 4 },
        Kind::Maze { corridor: 8 },
        Kind::Maze { corridor: 16 },
        Kind::Serpentine { corridor: 8 },
        Kind::Serpentine { corridor: 24 },
    ];
    let [accurate, _] = single_changes(&narrow, 1.0);
    assert!(accurate.cases > 500, "{accurate:?}");
    accurate.assert_right(100);
}

#[test]
fn where_a_full_solve_is_advised_directions_are_within_ten_degrees_in_9_of_10_cases() {
    let kinds = [Kind::Empty, Kind::Drums, Kind::Office, Kind::Trap];
    let [_, advised] = single_changes(&kinds, 10.0);
    assert!(advised.cases > 50, "{advised:?}");
    advised.assert_right(10);
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
                        solver: Solver::default(),
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
    assert_eq!(case.update(&[]), Verdict::Accurate);
    let same = case.domain.is_blocked(Cell::new(99, 99));
    assert_eq!(
        case.update(&[Change {
            cell: Cell::new(99, 99),
            blocked: same
        }]),
        Verdict::Accurate
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
