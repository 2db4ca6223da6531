//! Tests of the guidance at any position of a solved map.

use crate::support::{
    Kind::{self, *},
    Map, Random, angle, cells, solve,
};
use harmonic::{Cell, Domain, Field, Guidance::*};

fn generated(kind: Kind, seed: u64) -> (Domain, Field) {
    let domain = Map::generate(kind, 40, 30, seed).domain();
    let field = solve(&domain);
    (domain, field)
}

fn cell_at([col, row]: [f64; 2]) -> Cell {
    Cell::new(col.round() as usize, row.round() as usize)
}

const KINDS: [Kind; 5] =
    [Drums, Maze { corridor: 1 }, Maze { corridor: 3 }, Trap, Noise { density: 0.35 }];

#[test]
fn following_the_guidance_from_anywhere_arrives_without_entering_a_blocked_cell() {
    for (seed, kind) in (0..).zip(KINDS) {
        let (domain, field) = generated(kind, seed);
        let mut random = Random::new(seed);
        let mut walks = 0;
        while walks < 60 {
            let start = [random.between(0.0, 39.0), random.between(0.0, 29.0)];
            let (mut at, mut steps) = (start, 0);
            while let Along(d) = field.guidance(at[0], at[1]) {
                at = [at[0] + 0.02 * d[0], at[1] + 0.02 * d[1]];
                steps += 1;
                assert!(steps < 200_000, "{kind:?}: no arrival from {start:?}, stuck at {at:?}");
                assert!(!domain.is_blocked(cell_at(at)), "{kind:?} {at:?}");
            }
            if steps > 0 {
                walks += 1;
                let end = field.guidance(at[0], at[1]);
                assert_eq!(end, AtTarget, "{kind:?}: at {at:?}, from {start:?}");
            }
        }
    }
}

#[test]
fn the_path_from_every_cell_ends_at_the_target_and_touches_no_blocked_cell() {
    for (seed, kind) in (0..).zip(KINDS) {
        let (domain, field) = generated(kind, seed);
        let target = [domain.target().col as f64, domain.target().row as f64];
        for start in cells(domain.width(), domain.height()) {
            let path = field.path(start);
            assert_eq!(path.is_some(), field.is_reachable(start), "{kind:?} {start:?}");
            let path = path.unwrap_or(vec![target]);
            assert_eq!(path.last(), Some(&target), "{kind:?} {start:?}");
            for pair in path.windows(2) {
                for part in 0..8 {
                    let at = [0, 1]
                        .map(|i| pair[0][i] + f64::from(part) / 8.0 * (pair[1][i] - pair[0][i]));
                    let is_blocked = domain.is_blocked(cell_at(at));
                    assert!(!is_blocked, "{kind:?} {pair:?} from {start:?}");
                }
            }
        }
    }
}

#[test]
fn guidance_never_points_into_a_wall_it_touches() {
    for (seed, kind) in (7..).zip(KINDS) {
        let (domain, field) = generated(kind, seed);
        let mut random = Random::new(3);
        // The rim is blocked, so a reachable cell has four neighbours.
        for cell in cells(domain.width(), domain.height()).filter(|&it| field.is_reachable(it)) {
            let (col, row) = (cell.col as f64, cell.row as f64);
            for (dc, dr) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)] {
                if !domain.is_blocked(Cell::new((col + dc) as usize, (row + dr) as usize)) {
                    continue;
                }
                let along = random.between(-0.499, 0.499);
                let at = [col + 0.499_999_9 * dc + along * dr, row + 0.499_999_9 * dr + along * dc];
                if let Along(d) = field.guidance(at[0], at[1]) {
                    // Under the saddle rule, the direction may lean towards the centre line of the
                    // cell, but never outwards.
                    assert!(
                        d[0] * dc + d[1] * dr < 1e-4,
                        "{kind:?}: {d:?} into the wall at {at:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn guidance_is_continuous_across_cell_borders_in_open_space() {
    let (domain, field) = generated(Drums, 5);
    let mut random = Random::new(11);
    let mut compared = 0;
    for _ in 0..20_000 {
        let (col, row) = (2 + random.below(35), 2 + random.below(25));
        if domain.is_blocked(Cell::new(col, row)) || domain.is_blocked(Cell::new(col + 1, row)) {
            continue;
        }
        // The positions lie just left and right of a cell border and of a line of centres.
        for border in [col as f64 + 0.5, col as f64] {
            let y = row as f64 + random.between(-0.49, 0.49);
            let (a, b) = (field.guidance(border - 1e-7, y), field.guidance(border + 1e-7, y));
            if let (Along(a), Along(b)) = (a, b) {
                compared += 1;
                assert!(angle(a, b) < 0.5, "a jump of {} degrees at ({border}, {y})", angle(a, b));
            }
        }
    }
    assert!(compared > 10_000);
}

#[test]
fn at_a_saddle_point_the_better_neighbour_decides() {
    // The target is behind a wall, mirrored about row 4. At the middle of the wall, the gradient
    // along it is zero by symmetry and that across it points away.
    let mut map = Map::generate(Empty, 13, 9, 0);
    map.fill(7..8, 2..7, true);
    map.aim((10, 4));
    let field = solve(&map.domain());
    for col in 1..7 {
        assert!(
            matches!(field.guidance(col as f64, 4.0), Along(d) if d[0].hypot(d[1]) > 0.999),
            "{col}"
        );
    }
}

#[test]
fn every_position_gets_its_typed_answer() {
    let mut map = Map::generate(Empty, 12, 12, 0);
    map.fill(6..12, 0..12, true);
    map.fill(8..10, 4..6, false);
    map.aim((2, 2));
    let field = solve(&map.domain());
    assert_eq!(field.guidance(2.4, 1.7), AtTarget);
    assert_eq!(field.guidance(8.0, 5.0), Unreachable);
    assert_eq!(field.guidance(f64::NAN, 5.0), Unreachable);
    assert_eq!(field.guidance(6.2, 5.0), WayOut([-1.0, 0.0]));
    assert!(matches!(field.guidance(-1e300, 3.0), WayOut(d) if d[0] > 0.99));
    assert!(matches!(field.guidance(11.0, 11.0), WayOut(d) if d[0] < 0.0));
}

#[test]
fn the_direction_of_a_cell_is_the_guidance_at_its_centre_and_the_policy_of_its_row() {
    let large = (Noise { density: 0.12 }, 200, 200);
    for (kind, width, height) in KINDS.map(|kind| (kind, 60, 45)).into_iter().chain([large]) {
        let field = solve(&Map::generate(kind, width, height, 3).domain());
        for row in 0..height {
            let mut policies = Vec::new();
            field.policy_of_row(row, |policy| policies.push(policy));
            assert_eq!(policies.len(), width);
            for (col, policy) in policies.iter().enumerate() {
                let at_centre = match field.guidance(col as f64, row as f64) {
                    Along(direction) => Some(direction),
                    _ => None,
                };
                let cell = Cell::new(col, row);
                let direction = field.direction(cell);
                assert_eq!(direction, at_centre, "{kind:?} {cell:?}");
                let direction = direction.unwrap_or_default();
                let off = [0, 1].map(|axis| (direction[axis] - policy.direction[axis]).abs());
                assert!(off[0] < 1e-12 && off[1] < 1e-12, "{kind:?} {cell:?}: {off:?}");
                assert_eq!(policy.log2_u, field.u(cell).log2(), "{kind:?} {cell:?}");
            }
        }
    }
}
