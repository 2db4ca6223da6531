//! The figures of the guide's page: paths on random maps, held against shortest ones and against those of a wavefront with NavFn's costs.
//!
//! `MAPS=200 cargo test -p firsthand-ros2 paths_on_random_maps -- --nocapture` prints them. MAPS may be a folder of maps of map_server.

use std::{cmp::Reverse, collections::BinaryHeap, sync::Arc, time::Instant};

use glam::{DAffine2, DVec2};
use harmonic::Cancellation;
use ros2::cdr::Writer;

use super::super::{
    costmap::{Body, Costmap},
    planning::{Planner, Reason},
};

pub(super) const RESOLUTION_M: f64 = 0.05;
const RADIUS_M: f64 = 0.22;
/// Nav2's defaults, as its parameter file has them.
const INFLATION_M: f64 = 0.7;
const SCALING: f64 = 3.0;

pub(super) struct Random(u64);

impl Random {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        ((self.0 >> 33) as usize) % limit
    }
}

#[derive(Clone)]
pub(super) struct Grid {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) occupied: Vec<bool>,
}

impl Grid {
    pub(super) fn new(width: usize, height: usize) -> Self {
        Self { width, height, occupied: vec![false; width * height] }
    }

    pub(super) fn fill(
        &mut self,
        [left, bottom]: [usize; 2],
        [width, height]: [usize; 2],
        value: bool,
    ) {
        for row in bottom..(bottom + height).min(self.height) {
            for col in left..(left + width).min(self.width) {
                self.occupied[row * self.width + col] = value;
            }
        }
    }

    /// Drums, boxes, rooms with doors, or corridors.
    fn random(seed: u64) -> Self {
        let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
        let side = 120 + random.below(280);
        let mut grid = Self::new(side, side);
        match seed % 4 {
            0 | 1 => {
                for _ in 0..side / 4 {
                    let size = [2 + random.below(16), 2 + random.below(16)];
                    grid.fill([random.below(side), random.below(side)], size, true);
                }
            }
            kind => {
                let room = if kind == 2 { 60 } else { 24 };
                let door = if kind == 2 { 16 } else { 18 };
                for wall in (room..side).step_by(room) {
                    grid.fill([wall, 0], [2, side], true);
                    grid.fill([0, wall], [side, 2], true);
                }
                for wall in (room..side).step_by(room) {
                    for along in (0..side).step_by(room) {
                        for is_upright in [true, false] {
                            if random.below(4) > 0 {
                                let at = along + 3 + random.below(room - door - 3);
                                let (corner, size) = if is_upright {
                                    ([wall, at], [2, door])
                                } else {
                                    ([at, wall], [door, 2])
                                };
                                grid.fill(corner, size, false);
                            }
                        }
                    }
                }
            }
        }
        grid
    }

    pub(super) fn message(&self) -> Vec<u8> {
        let mut writer = Writer::default();
        writer
            .header(0, "map")
            .time(0)
            .f32(RESOLUTION_M as f32)
            .u32(self.width as u32)
            .u32(self.height as u32);
        writer.pose([0.0; 3]).length(self.occupied.len());
        writer.raw(
            &self.occupied.iter().map(|&occupied| 100 * u8::from(occupied)).collect::<Vec<_>>(),
        );
        writer.take()
    }

    /// Costs of the cheapest way from `sources` to every cell, in cells; `cost` is that of a cell.
    fn front(&self, sources: &[usize], cost: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut found = vec![f64::INFINITY; self.occupied.len()];
        let mut waiting: BinaryHeap<_> =
            sources.iter().map(|&cell| (Reverse(0_u64), cell)).collect();
        sources.iter().for_each(|&cell| found[cell] = 0.0);
        let mut done = vec![false; found.len()];
        while let Some((_, cell)) = waiting.pop() {
            if std::mem::replace(&mut done[cell], true) {
                continue;
            }
            for next in self.beside(cell).into_iter().flatten() {
                let cost = cost(next);
                let at = |cell: Option<usize>| {
                    cell.map_or(
                        f64::INFINITY,
                        |cell| if done[cell] { found[cell] } else { f64::INFINITY },
                    )
                };
                let [east, west, north, south] = self.beside(next).map(at);
                let (across, along) = (east.min(west), north.min(south));
                let gap = (across - along).abs();
                let by = match gap < cost {
                    true => {
                        f64::midpoint(across, along) + 0.5 * (2.0 * cost * cost - gap * gap).sqrt()
                    }
                    false => across.min(along) + cost,
                };
                if by.is_finite() && by < found[next] {
                    found[next] = by;
                    waiting.push((Reverse((by * 1e6) as u64), next));
                }
            }
        }
        found
    }

    fn beside(&self, cell: usize) -> [Option<usize>; 4] {
        let (col, row) = (cell % self.width, cell / self.width);
        [
            (col + 1 < self.width).then(|| cell + 1),
            (col > 0).then(|| cell - 1),
            (row + 1 < self.height).then(|| cell + self.width),
            (row > 0).then(|| cell - self.width),
        ]
    }

    /// Down a front from `from`, as NavFn's path: along bilinear gradients, and from cell to cell beside what is blocked.
    fn descend(&self, front: &[f64], from: usize) -> Vec<DVec2> {
        let place =
            |cell: usize| DVec2::new((cell % self.width) as f64, (cell / self.width) as f64);
        let at = |col: i64, row: i64| {
            let is_inside =
                (0..self.width as i64).contains(&col) && (0..self.height as i64).contains(&row);
            if is_inside { front[row as usize * self.width + col as usize] } else { f64::INFINITY }
        };
        let slope = |col: i64, row: i64| {
            DVec2::new(at(col - 1, row) - at(col + 1, row), at(col, row - 1) - at(col, row + 1))
        };
        let mut way = vec![place(from)];
        let mut here = way[0];
        for _ in 0..20 * self.width * self.height {
            let (col, row) = (here.x.round() as i64, here.y.round() as i64);
            if at(col, row) == 0.0 {
                break;
            }
            let low = here.floor();
            let (c, r, part) = (low.x as i64, low.y as i64, here - low);
            let ahead = slope(c, r)
                .lerp(slope(c + 1, r), part.x)
                .lerp(slope(c, r + 1).lerp(slope(c + 1, r + 1), part.x), part.y);
            let near = (c - 1..=c + 2).all(|c| (r - 1..=r + 2).all(|r| at(c, r).is_finite()));
            let next = here + 0.5 * ahead.normalize_or_zero();
            if near && at(next.x.round() as i64, next.y.round() as i64) <= at(col, row) {
                here = next;
            } else {
                let best = (-1..=1_i64).flat_map(|dc| (-1..=1_i64).map(move |dr| (dc, dr)));
                let best = best.filter(|&(dc, dr)| {
                    at(col + dc, row).is_finite() && at(col, row + dr).is_finite()
                });
                let steep = |&(dc, dr): &(i64, i64)| {
                    (at(col, row) - at(col + dc, row + dr)) / (dc as f64).hypot(dr as f64).max(0.5)
                };
                let (dc, dr) = best.max_by(|a, b| steep(a).total_cmp(&steep(b))).unwrap();
                here = DVec2::new((col + dc) as f64, (row + dr) as f64);
            }
            way.push(here);
        }
        way
    }
}

fn length(way: &[DVec2]) -> f64 {
    way.windows(2).map(|pair| pair[0].distance(pair[1])).sum()
}

/// Mean and least distance of a way in cells from what is occupied.
fn clearance(grid: &Grid, distances: &[f64], way: &[DVec2]) -> [f64; 2] {
    let at =
        |at: &DVec2| distances[at.y.round() as usize * grid.width + at.x.round() as usize].min(1e3);
    let all: Vec<_> = way.iter().map(at).collect();
    [all.iter().sum::<f64>() / all.len() as f64, all.iter().copied().fold(f64::INFINITY, f64::min)]
}

fn median(numbers: &mut [f64]) -> [f64; 4] {
    numbers.sort_by(f64::total_cmp);
    [0.05, 0.5, 0.95, 1.0].map(|share| numbers[((numbers.len() - 1) as f64 * share) as usize])
}

fn maps() -> Vec<Grid> {
    let named = std::env::var("MAPS").unwrap_or("40".to_owned());
    if let Ok(count) = named.parse() {
        return (0..count).map(Grid::random).collect();
    }
    let folder = named;
    let mut grids = Vec::new();
    for file in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        if file.extension().is_some_and(|end| end == "pgm") {
            let bytes = std::fs::read(&file).unwrap();
            let (mut at, mut words) = (0, Vec::new());
            while words.len() < 4 {
                let end =
                    at + bytes[at..].iter().position(|byte| byte.is_ascii_whitespace()).unwrap();
                if bytes[at] == b'#' {
                    at += bytes[at..].iter().position(|&byte| byte == b'\n').unwrap() + 1;
                    continue;
                }
                words.push(String::from_utf8_lossy(&bytes[at..end]).into_owned());
                at = end + 1;
            }
            let (width, height) = (words[1].parse().unwrap(), words[2].parse().unwrap());
            let occupied = bytes[at..].iter().map(|&grey| grey < 210).collect();
            for _ in 0..20 {
                grids.push(Grid { width, height, occupied: Vec::clone(&occupied) });
            }
        }
    }
    grids
}

#[test]
fn paths_on_random_maps_exist_where_a_way_does_touch_nothing_and_are_short_and_clear() {
    let screening: f64 = std::env::var("SCREENING").map_or(0.5, |text| text.parse().unwrap());
    let body = Body { radius_m: RADIUS_M, occupied: 99, enters_unknown: true };
    let (mut lengths, mut to_navfn, mut clears, mut leasts, mut times, mut again) =
        (vec![], vec![], vec![], vec![], vec![], vec![]);
    let (mut navfn_lengths, mut navfn_times) = (vec![], vec![]);
    let (mut bare, mut bare_least) = (vec![], vec![]);
    let (mut false_no, mut none) = (0, 0);
    for (seed, grid) in (0_u64..).zip(maps()) {
        let map = Arc::new(Costmap::read(&grid.message()).unwrap());
        let blocked = map.blocked(&body);
        let free: Vec<usize> = (0..blocked.len()).filter(|&cell| !blocked[cell]).collect();
        let mut random = Random(seed + 1);
        let cells = [free[random.below(free.len())], free[random.below(free.len())]];
        let place =
            |cell: usize| DVec2::new((cell % grid.width) as f64, (cell / grid.width) as f64);
        let [from, to] =
            cells.map(|cell| DAffine2::from_translation(map.place.transform_point2(place(cell))));
        let plain = grid.front(&[cells[1]], |cell| if blocked[cell] { f64::INFINITY } else { 1.0 });
        let mut planner = Planner::new(body, screening);
        let began = Instant::now();
        let planned = planner.plan(&map, from, &[to], &Cancellation::default());
        let took = began.elapsed().as_secs_f64() * 1e3;
        let exists = plain[cells[0]].is_finite();
        let path = match planned {
            Ok(path) => path,
            Err(failure) => {
                assert_eq!(failure.0, Reason::NoPath, "{seed}: {}", failure.1);
                false_no += usize::from(exists);
                none += 1;
                continue;
            }
        };
        assert!(exists, "{seed}");
        times.push(took);
        let began = Instant::now();
        planner.plan(&map, from, &[to], &Cancellation::default()).unwrap();
        again.push(began.elapsed().as_secs_f64() * 1e3);
        let way: Vec<DVec2> = path
            .iter()
            .map(|&[x, y, _]| map.place.inverse().transform_point2(DVec2::new(x, y)))
            .collect();
        for at in &way {
            let cell = map.cell_at(*at).unwrap();
            assert!(!blocked[cell.row * grid.width + cell.col], "{seed}: {at}");
        }
        let sources: Vec<usize> = (0..blocked.len()).filter(|&cell| grid.occupied[cell]).collect();
        let distances = grid.front(&sources, |_| 1.0);
        let began = Instant::now();
        let cost = |cell: usize| {
            let past = distances[cell] * RESOLUTION_M - RADIUS_M;
            let cost =
                if past + RADIUS_M > INFLATION_M { 0.0 } else { 252.0 * (-SCALING * past).exp() };
            if blocked[cell] { f64::INFINITY } else { (50.0 + 0.8 * cost) / 50.0 }
        };
        let navfn = grid.descend(&grid.front(&[cells[1]], cost), cells[0]);
        navfn_times.push(began.elapsed().as_secs_f64() * 1e3);
        if plain[cells[0]] < 20.0 {
            continue;
        }
        lengths.push(length(&way) / plain[cells[0]]);
        navfn_lengths.push(length(&navfn) / plain[cells[0]]);
        to_navfn.push(length(&way) / length(&navfn));
        let shortest = grid.descend(&plain, cells[0]);
        bare.push(
            clearance(&grid, &distances, &way)[0] / clearance(&grid, &distances, &shortest)[0],
        );
        bare_least.push(
            clearance(&grid, &distances, &way)[1] / clearance(&grid, &distances, &shortest)[1],
        );
        let ([mean, least], [of_mean, of_least]) =
            (clearance(&grid, &distances, &way), clearance(&grid, &distances, &navfn));
        clears.push(mean / of_mean);
        leasts.push(least / of_least);
    }
    println!(
        "{} paths, {none} without a way, {false_no} of them falsely; 5 %, median, 95 % and most:",
        times.len()
    );
    println!(
        "length over the shortest {:.3?}, NavFn's {:.3?}, over NavFn's {:.3?}",
        median(&mut lengths),
        median(&mut navfn_lengths),
        median(&mut to_navfn)
    );
    println!(
        "mean clearance over NavFn's {:.2?}, least {:.2?}",
        median(&mut clears),
        median(&mut leasts)
    );
    println!(
        "mean clearance over that of a wavefront without costs {:.2?}, least {:.2?}",
        median(&mut bare),
        median(&mut bare_least)
    );
    println!(
        "ms: {:.2?}, the same goal again {:.2?}, the wavefront {:.2?}",
        median(&mut times),
        median(&mut again),
        median(&mut navfn_times)
    );
    assert_eq!(false_no, 0);
    assert!(
        median(&mut lengths)[1] < 1.1
            && median(&mut lengths)[2] < 1.25
            && median(&mut bare)[1] > 1.1
    );
}
