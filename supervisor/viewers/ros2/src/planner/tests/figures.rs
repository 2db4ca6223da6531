//! Paths on random maps, compared with NavFn's, as on the guide's page of results.
//!
//! `.ci/nav2-planners` prints them, with Nav2's code in the program NAV2_PLANNERS. Without it, the
//! shortest paths replace NavFn's. MAPS may be a folder of map_server maps. BOUND=1 adds the
//! clearest paths.

use std::{
    cmp::Reverse,
    collections::{BTreeMap, BinaryHeap, VecDeque},
    env,
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

struct Random(u64);

impl Random {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        ((self.0 >> 33) as usize) % limit
    }
}

#[derive(Clone)]
pub struct Grid {
    width: usize,
    height: usize,
    occupied: Vec<bool>,
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

    /// Makes boxes, rooms with doors, or corridors.
    fn random(seed: u64) -> Self {
        let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
        let side = 120 + random.below(280);
        let mut grid = Self::new(side, side);
        let [room, door] = match seed % 4 {
            2 => [60, 16],
            3 => [24, 18],
            _ => {
                for _ in 0..side / 4 {
                    let size = [2 + random.below(16), 2 + random.below(16)];
                    grid.fill([random.below(side), random.below(side)], size, true);
                }
                return grid;
            }
        };
        for wall in (room..side).step_by(room) {
            grid.fill([wall, 0], [2, side], true);
            grid.fill([0, wall], [side, 2], true);
        }
        for wall in (room..side).step_by(room) {
            for along in (0..side).step_by(room) {
                for is_upright in [true, false] {
                    if random.below(4) > 0 {
                        let at = along + 3 + random.below(room - door - 3);
                        let (mut corner, mut size) = ([wall, at], [2, door]);
                        if !is_upright {
                            corner.reverse();
                            size.reverse();
                        }
                        grid.fill(corner, size, false);
                    }
                }
            }
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

    fn at(&self, cell: usize) -> [usize; 2] {
        [cell % self.width, cell / self.width]
    }

    fn place(&self, cell: usize) -> DVec2 {
        self.at(cell).map(|it| it as f64).into()
    }

    fn beside(&self, cell: usize, by: usize) -> impl Iterator<Item = [usize; 2]> {
        let [col, row] = self.at(cell);
        let rows = row.saturating_sub(by)..self.height.min(row + by + 1);
        let cols = col.saturating_sub(by)..self.width.min(col + by + 1);
        rows.flat_map(move |row| cols.clone().map(move |col| [col, row]))
    }

    /// Returns the distance of every cell from an occupied one, in cells.
    fn distances(&self) -> Vec<f64> {
        let mut found = vec![1e3; self.occupied.len()];
        let sources = (0..found.len()).filter(|&cell| self.occupied[cell]);
        let mut waiting: VecDeque<_> = sources.map(|cell| (0.0, cell, cell)).collect();
        while let Some((by, cell, source)) = waiting.pop_front() {
            if by < found[cell] {
                found[cell] = by;
                for [col, row] in self.beside(cell, 1) {
                    let next = row * self.width + col;
                    waiting.push_back((
                        self.place(next).distance(self.place(source)),
                        next,
                        source,
                    ));
                }
            }
        }
        found
    }

    /// Returns the cheapest way in steps to sixteen cells around, or none, given the cost per cell.
    fn cheapest(&self, [from, to]: [usize; 2], cost: impl Fn(usize) -> f64) -> Vec<DVec2> {
        let costs: Vec<f64> = (0..self.occupied.len()).map(cost).collect();
        let (mut paid, mut next) = (vec![u64::MAX; costs.len()], vec![to; costs.len()]);
        paid[to] = 0;
        let mut waiting = BinaryHeap::from([(Reverse(0), to)]);
        while let Some((Reverse(so_far), cell)) = waiting.pop() {
            if so_far > paid[cell] {
                continue;
            }
            let [col, row] = self.at(cell);
            for [c, r] in self.beside(cell, 2) {
                let (across, along) = (c.abs_diff(col), r.abs_diff(row));
                let passed = (c.min(col)..=c.max(col))
                    .flat_map(|c| (r.min(row)..=r.max(row)).map(move |r| (c, r)))
                    .map(|(c, r)| costs[r * self.width + c]);
                let mean = passed.sum::<f64>() / ((across + 1) * (along + 1)) as f64;
                let step = (mean * (across as f64).hypot(along as f64) * 1e6) as u64;
                let (there, paid_there) = (r * self.width + c, so_far.saturating_add(step));
                if paid_there < paid[there] {
                    (paid[there], next[there]) = (paid_there, cell);
                    waiting.push((Reverse(paid_there), there));
                }
            }
        }
        let onward = |&cell: &usize| (cell != to).then(|| next[cell]);
        let way = std::iter::successors((paid[from] < u64::MAX).then_some(from), onward);
        way.map(|cell| self.place(cell)).collect()
    }
}

/// Returns a path's length, and its mean and least clearance, in cells.
fn judge(grid: &Grid, distances: &[f64], way: &[DVec2]) -> [f64; 3] {
    let (mut sum, mut count, mut least, mut length) = (0.0, 0.0, f64::INFINITY, 0.0);
    for pair in way.windows(2) {
        let long = pair[0].distance(pair[1]);
        let steps = (4.0 * long).ceil();
        for step in 0..steps as usize {
            let at = pair[0].lerp(pair[1], step as f64 / steps).round();
            let clear = distances[at.y as usize * grid.width + at.x as usize];
            (sum, count, least) =
                (sum + clear * long / steps, count + long / steps, clear.min(least));
        }
        length += long;
    }
    [length, sum / count, least]
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

/// Returns the values of a published costmap.
fn published(costs: &[u8]) -> Vec<i8> {
    let value = |&cost: &u8| match cost {
        254 => 100,
        253 => 99,
        0 => 0,
        cost => 1 + (97 * (u32::from(cost) - 1) / 251) as i8,
    };
    costs.iter().map(value).collect()
}

/// Nav2's planners in another process, which ends with its input.
struct Nav2 {
    child: Child,
    from: BufReader<ChildStdout>,
}

impl Nav2 {
    fn start() -> Option<Self> {
        let path = env::var_os("NAV2_PLANNERS")?;
        let started = Command::new(path).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn();
        let mut child = started.unwrap();
        let from = BufReader::new(child.stdout.take().unwrap());
        Some(Self { child, from })
    }

    /// Returns the paths and milliseconds of NavFn, Theta* and Smac 2D.
    fn plan(&mut self, grid: &Grid, costs: &[u8], ends: [usize; 2]) -> [(Vec<DVec2>, f64); 3] {
        let [from, to] = ends.map(|cell| grid.at(cell));
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
    let named = env::var("MAPS").unwrap_or("12".to_owned());
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

/// CPU time of this thread in milliseconds, independent of other load.
fn processor_ms() -> f64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    now.tv_sec as f64 * 1e3 + now.tv_nsec as f64 * 1e-6
}

/// Returns the clearest path at most as long as `most`, over several distance-dependent costs.
fn clearest(
    grid: &Grid,
    distances: &[f64],
    blocked: &[bool],
    ends: [usize; 2],
    most: f64,
) -> Vec<DVec2> {
    let free = distances.iter().zip(blocked).filter(|it| !it.1);
    let widest = free.map(|it| *it.0).fold(0.0, f64::max);
    let cost = |kind: usize, cells: f64| match kind {
        0..4 => {
            let [weight, reach_m] = [[10.0, 0.5], [10.0, 1.0], [10.0, 2.0], [50.0, 1.0]][kind];
            let past = (cells * RESOLUTION_M - RADIUS_M).max(0.0);
            1.0 + weight * (1.0 - past / reach_m).max(0.0)
        }
        4..6 => [1.01, 1.2][kind - 4] * widest - cells,
        _ => cells.powf([-1.0, -1.5, -2.0, -3.0][kind - 6]),
    };
    let ways = (0..10).map(|kind| {
        let cost =
            |cell: usize| if blocked[cell] { f64::INFINITY } else { cost(kind, distances[cell]) };
        grid.cheapest(ends, cost)
    });
    let judged = ways.map(|way| (judge(grid, distances, &way), way));
    let short = judged.filter(|it| it.0[0] <= most);
    short.max_by(|a, b| a.0[1].total_cmp(&b.0[1])).map_or(vec![], |it| it.1)
}

#[test]
fn paths_on_random_maps_exist_where_a_way_does_touch_nothing_and_are_short_and_clear() {
    let alone = Body { radius_m: RADIUS_M, occupied: 99, enters_unknown: true };
    let mut nav2 = Nav2::start();
    let (mut pairs, mut ratios) = (0, BTreeMap::<&str, [Vec<f64>; 4]>::new());
    for (seed, grid) in (0_u64..).zip(maps()) {
        let map = Costmap::read(&grid.message()).unwrap();
        let (blocked, _) = map.blocked_and_costs(&alone, 1.0);
        // NavFn treats the outermost cells of a map as blocked.
        let is_free = |&cell: &usize| !blocked[cell] && grid.beside(cell, 1).count() == 9;
        let free: Vec<usize> = (0..blocked.len()).filter(is_free).collect();
        let mut random = Random(seed + 1);
        let mut any = || free[random.below(free.len())];
        let ends = [any(), any()];
        let [from, to] = ends
            .map(|cell| DAffine2::from_translation(map.place.transform_point2(grid.place(cell))));
        let shortest = grid.cheapest(ends, |cell| if blocked[cell] { f64::INFINITY } else { 1.0 });
        let distances = grid.distances();
        let mut ways = vec![("shortest", shortest.clone(), 0.0)];
        if let Some(nav2) = &mut nav2 {
            let found = nav2.plan(&grid, &inflated(&distances), ends);
            let names = ["NavFn", "Theta*", "Smac 2D"];
            ways.extend(names.into_iter().zip(found).map(|(name, (way, took))| (name, way, took)));
        }
        let mut changed = grid.clone();
        let is_away = |cell: &usize| {
            ends.iter().all(|&end| grid.place(end).distance(grid.place(*cell)) > 12.0)
        };
        let block = std::iter::repeat_with(any).find(is_away).unwrap();
        changed.fill(grid.at(block), [3, 3], true);
        let costmap_of = |grid: &Grid| grid.message_of(published(&inflated(&grid.distances())));
        for (names, radius_m, messages) in [
            (["ours", "ours, map changed"], RADIUS_M, [grid.message(), changed.message()]),
            (
                ["ours on costmap", "ours on costmap, map changed"],
                0.0,
                [costmap_of(&grid), costmap_of(&changed)],
            ),
        ] {
            let body = Body { radius_m, ..alone };
            let mut planner = Planner::new(body, 2.0);
            for (name, message) in names.into_iter().zip(messages) {
                let map = Arc::new(Costmap::read(&message).unwrap());
                let began = processor_ms();
                let planned = planner.plan(&map, from, &[to], &Cancellation::default());
                let took = processor_ms() - began;
                let path = planned.unwrap_or_else(|failure| {
                    assert_eq!(failure.0, Reason::NoPath, "{seed}: {}", failure.1);
                    vec![]
                });
                let (blocked, _) = map.blocked_and_costs(&body, 1.0);
                let cells = map.place.inverse();
                let at = |pose| cells.transform_point2(super::point(pose));
                let way: Vec<DVec2> = path.iter().map(at).collect();
                for at in &way {
                    let cell = map.cell_at(*at).unwrap();
                    assert!(!blocked[cell.row * grid.width + cell.col], "{seed}: {name} {at}");
                }
                let is_same_map = !name.contains("changed");
                let is_right = way.is_empty() == shortest.is_empty();
                assert!(!is_same_map || is_right, "{seed}: {name} has {} poses", way.len());
                ways.push((name, way, took));
            }
        }
        pairs += usize::from(!shortest.is_empty());
        let (_, way, reference_took) = &ways[usize::from(nav2.is_some())];
        let (reference, reference_took) = (judge(&grid, &distances, way), *reference_took);
        if way.is_empty() || judge(&grid, &distances, &shortest)[0] < 20.0 {
            continue;
        }
        if env::var_os("BOUND").is_some() {
            let way = clearest(&grid, &distances, &blocked, ends, 1.15 * reference[0]);
            ways.push(("clearest", way, 0.0));
        }
        for (name, way, took) in ways.iter().filter(|it| !it.1.is_empty()) {
            let [length, mean, least] = judge(&grid, &distances, way);
            let of = [
                length / reference[0],
                mean / reference[1],
                least / reference[2],
                took / reference_took,
            ];
            let table = ratios.entry(name).or_default();
            table.iter_mut().zip(of).for_each(|(all, one)| all.push(one));
        }
    }
    println!("{pairs} pairs of places with a way; over the reference, median (5 %, 95 %):");
    println!("planner,n,length,mean clearance,least clearance,time");
    for (name, ratios) in &mut ratios {
        print!("{name},{}", ratios[0].len());
        for ratios in &mut *ratios {
            ratios.sort_by(f64::total_cmp);
            let [low, median, high] =
                [0.05, 0.5, 0.95].map(|share| ratios[((ratios.len() - 1) as f64 * share) as usize]);
            print!(",\"{median:.2} ({low:.2}, {high:.2})\"");
        }
        println!();
        let [length, mean] = [0, 1].map(|part| ratios[part][(ratios[part].len() - 1) / 2]);
        let is_good = length < 1.2 && mean > 1.0;
        assert!(is_good || !name.starts_with("ours"), "{name}: {length} {mean}");
    }
}
