//! Generated maps: typical places of a ground robot, and those that break solvers.

use std::ops::Range;

use super::random::Random;
use harmonic::{Cell, Domain};

use super::{around, cells, domain, screened};

use Kind::*;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Kind {
    /// Outer walls only.
    Empty,
    /// Round obstacles over a fifth of the floor.
    Drums,
    /// Eight by eight rooms joined by doors.
    Office,
    /// Spanning tree of corridors of this width, with a twentieth of the walls opened again.
    Maze { corridor: usize },
    /// Corridor of this width, folded over the whole map.
    Serpentine { corridor: usize },
    /// Corridor of this width, wound from the rim to the middle.
    Spiral { corridor: usize },
    /// Rooms of `side` cells, joined by doors of this width.
    Rooms { side: usize, door: usize },
    /// U-shaped wall that opens away from the target.
    Trap,
    /// Cells blocked with this probability: islands, pockets, diagonal leaks.
    Noise { density: f64 },
}

#[derive(Clone, Debug)]
pub(crate) struct Map {
    pub width: usize,
    pub height: usize,
    pub blocked: Vec<bool>,
    /// Free cell.
    pub target: Cell,
}

impl Map {
    /// Generates a map with a blocked rim and a free target.
    pub(crate) fn generate(kind: Kind, width: usize, height: usize, seed: u64) -> Self {
        let random = &mut Random::new(seed);
        let mut map =
            Self { width, height, blocked: vec![false; width * height], target: Cell::new(0, 0) };
        let wanted = match kind {
            Empty | Noise { .. } => (width / 3, height / 4),
            Drums | Office => (width / 6, height / 5),
            Maze { corridor: side }
            | Serpentine { corridor: side }
            | Spiral { corridor: side }
            | Rooms { side, .. } => (1 + side / 2, 1 + side / 2),
            Trap => (width * 9 / 10, height / 2),
        };
        match kind {
            Empty => {}
            Drums => map.drums(random),
            Office => map.office(random),
            Maze { corridor } => map.maze(corridor, random),
            Serpentine { corridor } => map.serpentine(corridor),
            Spiral { corridor } => map.spiral(corridor),
            Rooms { side, door } => map.rooms(side, door, random),
            Trap => map.trap(),
            Noise { density } => map.blocked.fill_with(|| random.unit() < density),
        }
        map.block_rim();
        map.aim(wanted);
        map
    }

    pub(crate) fn domain(&self) -> Domain {
        domain(self.width, self.height, self.blocked.clone(), self.target)
    }

    /// Returns the domain with a screening length in cells.
    pub(crate) fn screened(&self, length: f64) -> Domain {
        screened(self.domain(), length)
    }

    pub(crate) fn fill(&mut self, cols: Range<usize>, rows: Range<usize>, blocked: bool) {
        for row in rows.start..rows.end.min(self.height) {
            for col in cols.start..cols.end.min(self.width) {
                self.blocked[row * self.width + col] = blocked;
            }
        }
    }

    pub(crate) fn block_rim(&mut self) {
        for (index, blocked) in self.blocked.iter_mut().enumerate() {
            *blocked |= around(self.width, self.height, index).contains(&None);
        }
    }

    /// Puts the target on the free cell nearest to `wanted`.
    pub(crate) fn aim(&mut self, wanted: (usize, usize)) {
        let cells = cells(self.width, self.height).zip(&self.blocked);
        let free = cells.filter(|(_, blocked)| !**blocked).map(|(cell, _)| cell);
        let nearest = free.min_by_key(|cell| {
            cell.col.abs_diff(wanted.0).pow(2) + cell.row.abs_diff(wanted.1).pow(2)
        });
        self.target = nearest.expect("a free cell");
    }

    fn drums(&mut self, random: &mut Random) {
        let largest = (self.width.min(self.height) as f64 / 24.0).max(1.5);
        let mut covered = 0;
        while covered * 5 < self.blocked.len() {
            let radius = random.between(0.3, 1.0) * largest;
            let centre =
                (random.between(0.0, self.width as f64), random.between(0.0, self.height as f64));
            let range = |c: f64, end: usize| {
                (c - radius).max(0.0) as usize..((c + radius) as usize + 2).min(end)
            };
            for row in range(centre.1, self.height) {
                for col in range(centre.0, self.width) {
                    let cell = &mut self.blocked[row * self.width + col];
                    if !*cell && (col as f64 - centre.0).hypot(row as f64 - centre.1) < radius {
                        *cell = true;
                        covered += 1;
                    }
                }
            }
        }
    }

    fn office(&mut self, random: &mut Random) {
        const ROOMS: usize = 8;
        let (wide, high) = (self.width / ROOMS, self.height / ROOMS);
        if wide < 6 || high < 6 {
            return;
        }
        let wall = if wide.min(high) >= 24 { 2 } else { 1 };
        for i in 1..ROOMS {
            self.fill(0..self.width, i * high..i * high + wall, true);
            self.fill(i * wide..i * wide + wall, 0..self.height, true);
        }
        for (a, b) in spanning_tree(ROOMS, ROOMS, 0.2, random) {
            let room = if a.0 == b.0 { wide } else { high };
            let door = (room / 8).max(2);
            let at = wall + random.below(room - wall - door);
            self.open_door((a, b), (wide, high), wall, at..at + door);
        }
    }

    /// Frees a part of the wall between two rooms, counted from a corner of the second.
    fn open_door(&mut self, (a, b): Pair, room: (usize, usize), wall: usize, door: Range<usize>) {
        let (col, row) = (a.0.max(b.0) * room.0, a.1.max(b.1) * room.1);
        if a.0 == b.0 {
            self.fill(col + door.start..col + door.end, row..row + wall, false);
        } else {
            self.fill(col..col + wall, row + door.start..row + door.end, false);
        }
    }

    /// Returns the columns and rows of squares of this side that fit, with walls of one cell.
    fn squares(&self, side: usize) -> (usize, usize) {
        let count = |cells: usize| cells.saturating_sub(1) / (side + 1);
        (count(self.width), count(self.height))
    }

    /// Frees only the squares in `pairs`, each pair joined by an opening of the same width.
    fn carve(&mut self, side: usize, pairs: impl IntoIterator<Item = Pair>) {
        let pitch = side + 1;
        self.fill(0..self.width, 0..self.height, true);
        for (a, b) in pairs {
            let (left, right) = (a.0.min(b.0) * pitch + 1, a.0.max(b.0) * pitch + 1);
            let (top, bottom) = (a.1.min(b.1) * pitch + 1, a.1.max(b.1) * pitch + 1);
            self.fill(left..right + side, top..bottom + side, false);
        }
    }

    fn maze(&mut self, corridor: usize, random: &mut Random) {
        let (wide, high) = self.squares(corridor);
        self.carve(corridor, spanning_tree(wide, high, 0.05, random));
    }

    fn spiral(&mut self, corridor: usize) {
        let (wide, high) = self.squares(corridor);
        let (mut at, mut step, mut turns) = ((0_usize, 0_usize), (1_isize, 0_isize), 0);
        let mut seen = vec![false; wide * high];
        let mut pairs = Vec::new();
        while turns < 2 {
            seen[at.1 * wide + at.0] = true;
            let next = (at.0.wrapping_add_signed(step.0), at.1.wrapping_add_signed(step.1));
            if next.0 < wide && next.1 < high && !seen[next.1 * wide + next.0] {
                pairs.push((at, next));
                (at, turns) = (next, 0);
            } else {
                (step, turns) = ((-step.1, step.0), turns + 1);
            }
        }
        self.carve(corridor, pairs);
    }

    fn rooms(&mut self, side: usize, door: usize, random: &mut Random) {
        let ((wide, high), pitch) = (self.squares(side), side + 1);
        let rooms = (0..wide * high).map(|room| (room % wide, room / wide));
        self.carve(side, rooms.map(|room| (room, room)));
        for pair in spanning_tree(wide, high, 0.5, random) {
            let at = 1 + random.below(side - door + 1);
            self.open_door(pair, (pitch, pitch), 1, at..at + door);
        }
    }

    fn serpentine(&mut self, corridor: usize) {
        for (turn, row) in (corridor + 1..self.height - 1).step_by(corridor + 1).enumerate() {
            self.fill(0..self.width, row..row + 1, true);
            let left = if turn % 2 == 0 { self.width - 1 - corridor } else { 1 };
            self.fill(left..left + corridor, row..row + 1, false);
        }
    }

    fn trap(&mut self) {
        let wall = (self.width / 64).max(2);
        let (left, right) = (self.width / 4, self.width * 3 / 4);
        let (top, bottom) = (self.height / 4, self.height * 3 / 4);
        self.fill(left..right, top..top + wall, true);
        self.fill(left..right, bottom..bottom + wall, true);
        self.fill(right..right + wall, top..bottom + wall, true);
    }
}

/// Two neighbouring rooms, or one room twice, by column and row.
type Pair = ((usize, usize), (usize, usize));

/// Returns a random spanning tree of rooms joined by doors, plus each other pair with probability
/// `more`.
fn spanning_tree(wide: usize, high: usize, more: f64, random: &mut Random) -> Vec<Pair> {
    let mut seen = vec![false; wide * high];
    let place = |room: usize| (room % wide, room / wide);
    let mut doors = Vec::new();
    let mut path = vec![0];
    seen[0] = true;
    while let Some(&room) = path.last() {
        let beside = around(wide, high, room).into_iter().flatten();
        let open: Vec<usize> = beside.filter(|&next| !seen[next]).collect();
        if open.is_empty() {
            path.pop();
        } else {
            let next = open[random.below(open.len())];
            seen[next] = true;
            doors.push((place(room), place(next)));
            path.push(next);
        }
    }
    for row in 0..high {
        for col in 0..wide {
            for next in [(col + 1, row), (col, row + 1)] {
                if next.0 < wide && next.1 < high && random.unit() < more {
                    doors.push(((col, row), next));
                }
            }
        }
    }
    doors
}
