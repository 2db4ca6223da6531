//! Figures of the guide's page: paths on random maps, compared with NavFn's.
//!
//! `.ci/nav2-planners` prints them, with Nav2's code in the program NAV2_PLANNERS, else with a
//! wavefront of NavFn's costs. MAPS may be a folder of map_server maps. BOUND=1 searches the
//! clearest paths, SCREENING is the option.

use std::{
    cmp::Reverse,
    collections::{BTreeMap, BinaryHeap},
    io::{BufReader, Read as _, Write as _},
    process::{Child, ChildStdout, Command, Stdio},
    sync::Arc,
};

use glam::{DAffine2, DVec2};
use harmonic::Cancellation;
use ros2::{
    cdr::Cdr as _,
    msg::{Header, MapMetaData, OccupancyGrid},
};

use super::super::{
    costmap::{Body, Costmap},
    planning::{Planner, Reason},
};

pub const RESOLUTION_M: f64 = 0.05;
const RADIUS_M: f64 = 0.22;
/// Defaults of Nav2's parameter file.
const INFLATION_M: f64 = 0.7;
const SCALING: f64 = 3.0;

pub struct Random(u64);

impl Random {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        ((self.0 >> 33) as usize) % limit
    }
}

#[derive(Clone)]
pub struct Grid {
    pub width: usize,
    pub height: usize,
    pub occupied: Vec<bool>,
}

impl Grid {
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, occupied: vec![false; width * height] }
    }

    pub fn fill(&mut self, [left, bottom]: [usize; 2], [width, height]: [usize; 2], value: bool) {
        for row in bottom..(bottom + height).min(self.height) {
            for col in left..(left + width).min(self.width) {
                self.occupied[row * self.width + col] = value;
            }
        }
    }

    /// Makes drums, boxes, rooms with doors, or corridors.
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

    /// Makes a maze with exactly one path between any two of its rooms, which are 1 m wide
    /// including the wall.
    pub fn maze(seed: u64, side: usize) -> Self {
        const ROOM: usize = 20;
        let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
        let (mut grid, rooms) = (Self::new(side, side), side / ROOM);
        grid.fill([0, 0], [side, side], true);
        let (mut seen, mut trail) = (vec![false; rooms * rooms], vec![[0_usize, 0]]);
        seen[0] = true;
        grid.fill([2, 2], [ROOM - 4, ROOM - 4], false);
        while let Some(&[col, row]) = trail.last() {
            let beside = [
                [col + 1, row],
                [col, row + 1],
                [col.wrapping_sub(1), row],
                [col, row.wrapping_sub(1)],
            ];
            let fresh = |&[c, r]: &[usize; 2]| c < rooms && r < rooms && !seen[r * rooms + c];
            let open: Vec<_> = beside.into_iter().filter(fresh).collect();
            if open.is_empty() {
                trail.pop();
                continue;
            }
            let next = open[random.below(open.len())];
            let corner = [col.min(next[0]) * ROOM + 2, row.min(next[1]) * ROOM + 2];
            let size =
                [col.abs_diff(next[0]), row.abs_diff(next[1])].map(|by| by * ROOM + ROOM - 4);
            grid.fill(corner, size, false);
            seen[next[1] * rooms + next[0]] = true;
            trail.push(next);
        }
        grid
    }

    pub fn message(&self) -> Vec<u8> {
        self.message_of(self.occupied.iter().map(|&it| 100 * i8::from(it)).collect())
    }

    fn message_of(&self, data: Vec<i8>) -> Vec<u8> {
        let info = MapMetaData {
            resolution: RESOLUTION_M as f32,
            width: self.width as u32,
            height: self.height as u32,
            ..MapMetaData::default()
        };
        OccupancyGrid { header: Header::at(0, "map"), info, data }.encode()
    }

    /// Returns the least path cost from `sources` to every cell, in cells, given the `cost` per
    /// cell.
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
                    cell.filter(|&cell| done[cell]).map_or(f64::INFINITY, |cell| found[cell])
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

    fn place(&self, cell: usize) -> DVec2 {
        DVec2::new((cell % self.width) as f64, (cell / self.width) as f64)
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

    /// Descends a front from `from` as NavFn does: along bilinear gradients, and cell by cell
    /// beside blocked cells.
    fn descend(&self, front: &[f64], from: usize) -> Vec<DVec2> {
        let at = |col: i64, row: i64| {
            let is_inside =
                (0..self.width as i64).contains(&col) && (0..self.height as i64).contains(&row);
            if is_inside { front[row as usize * self.width + col as usize] } else { f64::INFINITY }
        };
        let slope = |col: i64, row: i64| {
            DVec2::new(at(col - 1, row) - at(col + 1, row), at(col, row - 1) - at(col, row + 1))
        };
        let mut way = vec![self.place(from)];
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

/// Returns a path's length, and its mean and least clearance at points a quarter of a cell apart,
/// all in cells.
fn judge(grid: &Grid, distances: &[f64], way: &[DVec2]) -> [f64; 3] {
    let (mut sum, mut count, mut least, mut next) = (0.0, 0.0, f64::INFINITY, 0.0);
    for pair in way.windows(2) {
        let long = pair[0].distance(pair[1]);
        while next <= long {
            let at = if long > 0.0 { pair[0].lerp(pair[1], next / long) } else { pair[0] };
            let clear = distances[at.y.round() as usize * grid.width + at.x.round() as usize];
            (sum, count, least) = (sum + clear.min(1e3), count + 1.0, clear.min(least));
            next += 0.25;
        }
        next -= long;
    }
    [length(way), sum / count, least]
}

/// Returns the 5 % quantile, the median, the 95 % quantile and the maximum.
fn shares(numbers: &[f64]) -> [f64; 4] {
    let mut numbers = numbers.to_vec();
    numbers.sort_by(f64::total_cmp);
    [0.05, 0.5, 0.95, 1.0].map(|share| numbers[((numbers.len() - 1) as f64 * share) as usize])
}

fn distances(grid: &Grid) -> Vec<f64> {
    let sources = (0..grid.occupied.len()).filter(|&cell| grid.occupied[cell]);
    let mut nearest: Vec<Option<usize>> = vec![None; grid.occupied.len()];
    let place = |cell| grid.place(cell);
    let mut waiting = BinaryHeap::new();
    sources.for_each(|cell| waiting.push((Reverse(0_u64), cell, cell)));
    while let Some((_, cell, source)) = waiting.pop() {
        if nearest[cell].is_none() {
            nearest[cell] = Some(source);
            for next in grid.beside(cell).into_iter().flatten() {
                let by = place(next).distance_squared(place(source)) as u64;
                waiting.push((Reverse(by), next, source));
            }
        }
    }
    let each = nearest.iter().enumerate();
    each.map(|(cell, near)| near.map_or(1e3, |near| place(cell).distance(place(near)))).collect()
}

/// Returns the costs of Nav2's inflation layer, `computeCost`.
fn inflated(distances: &[f64]) -> Vec<u8> {
    let cost = |&cells: &f64| match cells * RESOLUTION_M {
        _ if cells == 0.0 => 254,
        far if far <= RADIUS_M => 253,
        _ if cells > (INFLATION_M / RESOLUTION_M).floor() => 0,
        far => (252.0 * (-SCALING * (far - RADIUS_M)).exp()) as u8,
    };
    distances.iter().map(cost).collect()
}

/// Nav2's planners in another process.
struct Nav2 {
    child: Child,
    from: BufReader<ChildStdout>,
}

impl Nav2 {
    fn start() -> Option<Self> {
        let path = std::env::var_os("NAV2_PLANNERS")?;
        let started = Command::new(path).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn();
        let mut child = started.unwrap();
        let from = BufReader::new(child.stdout.take().unwrap());
        Some(Self { child, from })
    }

    /// Returns the paths and milliseconds of NavFn, Theta* and Smac 2D.
    fn plan(&mut self, grid: &Grid, costs: &[u8], ends: [usize; 2]) -> [(Vec<DVec2>, f64); 3] {
        let [from, to] = ends.map(|cell| [cell % grid.width, cell / grid.width]);
        let input = self.child.stdin.as_mut().unwrap();
        for number in [grid.width, grid.height, from[0], from[1], to[0], to[1]] {
            input.write_all(&(number as u32).to_ne_bytes()).unwrap();
        }
        input.write_all(costs).unwrap();
        [(); 3].map(|()| {
            let took = u64::from_ne_bytes(self.take());
            let count = u32::from_ne_bytes(self.take());
            let mut number = || f64::from(f32::from_ne_bytes(self.take()));
            let way = (0..count).map(|_| DVec2::new(number(), number())).collect();
            (way, took as f64 * 1e-6)
        })
    }

    fn take<const N: usize>(&mut self) -> [u8; N] {
        let mut bytes = [0; N];
        self.from.read_exact(&mut bytes).unwrap();
        bytes
    }
}

fn maps() -> Vec<Grid> {
    let named = std::env::var("MAPS").unwrap_or("40".to_owned());
    if let Ok(count) = named.parse() {
        return (0..count).map(Grid::random).collect();
    }
    let mut grids = Vec::new();
    for file in std::fs::read_dir(named).unwrap().map(|entry| entry.unwrap().path()) {
        if file.extension().is_some_and(|end| end == "pgm") {
            let map = maps::load(&file).unwrap();
            let grid = Grid { width: map.cols, height: map.rows, occupied: map.blocked };
            grids.extend(vec![grid; 20]);
        }
    }
    grids
}

impl Drop for Nav2 {
    fn drop(&mut self) {
        // The process ends with its input.
        drop(self.child.stdin.take());
        self.child.wait().unwrap();
    }
}

/// CPU time of this thread in milliseconds, independent of other load.
fn processor_ms() -> f64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    now.tv_sec as f64 * 1e3 + now.tv_nsec as f64 * 1e-6
}

fn named(name: &str) -> Option<f64> {
    std::env::var(name).ok().map(|text| text.parse().unwrap())
}

/// Paths of a planner relative to the reference: length, mean and least clearance, CPU time.
#[derive(Default)]
struct Judged {
    ratios: [Vec<f64>; 4],
    /// Pairs of places without a found path although one exists, and the reverse.
    false_no: usize,
    false_yes: usize,
}

impl Judged {
    fn add(&mut self, found: [f64; 3], reference: [f64; 3], times: [f64; 2]) {
        for part in 0..3 {
            self.ratios[part].push(found[part] / reference[part]);
        }
        self.ratios[3].push(times[0] / times[1]);
    }
}

/// Returns the clearest path at most 1.15 times as long as the reference, over wavefronts with
/// several distance-dependent costs.
fn clearest(
    grid: &Grid,
    distances: &[f64],
    blocked: &[bool],
    ends: [usize; 2],
    most: f64,
) -> [f64; 3] {
    let free = distances.iter().zip(blocked).filter(|it| !it.1);
    let widest = free.map(|it| *it.0).fold(0.0, f64::max);
    let ramp = |cells: f64, weight: f64, reach_m: f64| {
        let past = (cells * RESOLUTION_M - RADIUS_M).max(0.0);
        1.0 + weight * (1.0 - past / reach_m).max(0.0)
    };
    let judged = (0..10).map(|kind| {
        let cost = |cell: usize| match (blocked[cell], distances[cell]) {
            (true, _) => f64::INFINITY,
            (_, cells) => match kind {
                0 => ramp(cells, 10.0, 0.5),
                1 => ramp(cells, 10.0, 1.0),
                2 => ramp(cells, 10.0, 2.0),
                3 => ramp(cells, 50.0, 1.0),
                4 => 1.01 * widest - cells,
                5 => 1.2 * widest - cells,
                6 => cells.recip(),
                7 => cells.powf(-1.5),
                8 => cells.powi(-2),
                _ => cells.powi(-3),
            },
        };
        judge(grid, distances, &grid.descend(&grid.front(&[ends[1]], cost), ends[0]))
    });
    let short = judged.filter(|judged| judged[0] <= most);
    short.fold([0.0; 3], |best, judged| if judged[1] > best[1] { judged } else { best })
}

#[test]
fn paths_on_random_maps_exist_where_a_way_does_touch_nothing_and_are_short_and_clear() {
    let screening = named("SCREENING").unwrap_or(2.0);
    let alone = Body { radius_m: RADIUS_M, occupied: 99, enters_unknown: true };
    let inflated_map = Body { radius_m: 0.0, ..alone };
    let mut nav2 = Nav2::start();
    let mut table = BTreeMap::<&str, Judged>::new();
    let (mut pairs, mut none) = (0, 0);
    for (seed, grid) in (0_u64..).zip(maps()) {
        let map = Arc::new(Costmap::read(&grid.message()).unwrap());
        let (blocked, _) = map.blocked_and_costs(&alone, 1.0);
        // NavFn treats the outermost cells of a map as blocked.
        let inside = |cell: &usize| grid.beside(*cell).iter().all(Option::is_some);
        let free = (0..blocked.len()).filter(|&cell| !blocked[cell]);
        let free: Vec<usize> = free.filter(inside).collect();
        let mut random = Random(seed + 1);
        let mut any = || free[random.below(free.len())];
        let cells = [any(), any()];
        let place = |cell| grid.place(cell);
        let [from, to] =
            cells.map(|cell| DAffine2::from_translation(map.place.transform_point2(place(cell))));
        let plain = grid.front(&[cells[1]], |cell| if blocked[cell] { f64::INFINITY } else { 1.0 });
        let exists = plain[cells[0]].is_finite();
        (pairs, none) = (pairs + 1, none + usize::from(!exists));
        let distances = distances(&grid);
        let costs = inflated(&distances);
        let mut ways = vec![("shortest", vec![], 0.0)];
        if exists {
            ways[0].1 = grid.descend(&plain, cells[0]);
        }
        match &mut nav2 {
            Some(nav2) => {
                let names = ["NavFn", "Theta*", "Smac 2D"];
                let found = names.into_iter().zip(nav2.plan(&grid, &costs, cells));
                ways.extend(found.map(|(name, (way, took))| (name, way, took)));
            }
            None => {
                let began = processor_ms();
                let cost = |cell: usize| match costs[cell] {
                    253.. => f64::INFINITY,
                    cost => (50.0 + 0.8 * f64::from(cost)) / 50.0,
                };
                let front = grid.front(&[cells[1]], cost);
                let way = if exists { grid.descend(&front, cells[0]) } else { vec![] };
                ways.push(("NavFn", way, processor_ms() - began));
            }
        }
        // Values of a published costmap.
        let published = |&cost: &u8| match cost {
            254 => 100,
            253 => 99,
            0 => 0,
            cost => 1 + (97 * (u32::from(cost) - 1) / 251) as i8,
        };
        let values: Vec<i8> = costs.iter().map(published).collect();
        let mut changed = grid.clone();
        let away = |cell: &usize| cells.iter().all(|&end| place(end).distance(place(*cell)) > 12.0);
        let block = std::iter::repeat_with(any).find(away).unwrap();
        changed.fill([block % grid.width, block / grid.width], [3, 3], true);
        let changed_costs: Vec<i8> =
            inflated(&self::distances(&changed)).iter().map(published).collect();
        for (names, body, messages) in [
            (
                ["ours", "ours, map changed", "ours, same map"],
                alone,
                [grid.message(), changed.message()],
            ),
            (
                ["ours on costmap", "ours on costmap, map changed", "ours on costmap, same map"],
                inflated_map,
                [grid.message_of(values), changed.message_of(changed_costs)],
            ),
        ] {
            let maps = messages.map(|message| Arc::new(Costmap::read(&message).unwrap()));
            let mut planner = Planner::new(body, screening);
            for (name, map) in names.into_iter().zip([&maps[0], &maps[1], &maps[1]]) {
                let began = processor_ms();
                let planned = planner.plan(map, from, &[to], &Cancellation::default());
                let took = processor_ms() - began;
                let (blocked, _) = map.blocked_and_costs(&body, 1.0);
                let path = planned.unwrap_or_else(|failure| {
                    assert_eq!(failure.0, Reason::NoPath, "{seed}: {}", failure.1);
                    vec![]
                });
                let place = |&[x, y, _]: &[f64; 3]| DVec2::new(x, y);
                let way: Vec<DVec2> = path
                    .iter()
                    .map(|pose| map.place.inverse().transform_point2(place(pose)))
                    .collect();
                for at in &way {
                    let cell = map.cell_at(*at).unwrap();
                    assert!(!blocked[cell.row * grid.width + cell.col], "{seed}: {name} {at}");
                }
                ways.push((name, way, took));
            }
        }
        for (name, way, _) in ways.iter().filter(|it| !it.0.contains("map")) {
            let judged = table.entry(name).or_default();
            judged.false_no += usize::from(exists && way.is_empty());
            judged.false_yes += usize::from(!exists && !way.is_empty());
        }
        let navfn = &ways[1];
        if plain[cells[0]] < 20.0 || !exists || navfn.1.is_empty() {
            continue;
        }
        let reference = judge(&grid, &distances, &navfn.1);
        if named("BOUND").is_some() {
            let best = clearest(&grid, &distances, &blocked, cells, 1.15 * reference[0]);
            table.entry("clearest").or_default().add(best, reference, [0.0, 1.0]);
        }
        for (name, way, took) in ways.iter().filter(|it| !it.1.is_empty()) {
            let judged = table.entry(name).or_default();
            judged.add(judge(&grid, &distances, way), reference, [*took, navfn.2]);
        }
    }
    println!(
        "{pairs} pairs of places, {none} without a way; over NavFn's, median (5 %, 95 %, most):"
    );
    println!("planner,n,falsely none,length,mean clearance,least clearance,time");
    for (name, Judged { ratios, false_no, false_yes }) in &table {
        assert_eq!(*false_yes, 0, "{name}");
        print!("{name},{},{false_no}", ratios[0].len());
        for ratios in ratios {
            let [low, median, high, most] = shares(ratios);
            print!(",\"{median:.2} ({low:.2}, {high:.2}, {most:.2})\"");
        }
        println!();
    }
    for name in ["ours", "ours on costmap"] {
        let Judged { ratios, false_no, .. } = &table[name];
        assert_eq!(*false_no, 0);
        let [length, mean, ..] = ratios.each_ref().map(|ratios| shares(ratios)[1]);
        assert!(length < 1.1 && mean > 0.98, "{name}: {length} {mean}");
    }
}
