//! Latencies of a mission's ticks and solves. They have a table of their own, because they differ in every run.

use serde::{Deserialize, Serialize};
use summary::Summary;

use crate::missions::{
    row::Row,
    statistics::median,
    table::{Key, Record},
};

/// One mission's latencies, microseconds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Latency {
    pub world: String,
    pub seed: u64,
    pub setting: String,
    /// A tick, from the datagram in to the datagram out.
    pub tick_p50_us: Option<f64>,
    pub tick_p99_us: Option<f64>,
    pub tick_max_us: Option<f64>,
    pub full_solve_p50_us: Option<f64>,
    pub full_solve_p99_us: Option<f64>,
    pub full_solve_max_us: Option<f64>,
}

impl Latency {
    pub fn new(row: &Row, summary: &Summary) -> Self {
        let (world, seed, setting) = row.key();
        let Summary { tick_latency_us: tick, full_solve_us: full, .. } = summary;
        Self {
            world,
            seed,
            setting,
            tick_p50_us: tick.p50,
            tick_p99_us: tick.p99,
            tick_max_us: tick.max,
            full_solve_p50_us: full.p50,
            full_solve_p99_us: full.p99,
            full_solve_max_us: full.max,
        }
    }
}

impl Record for Latency {
    fn key(&self) -> Key {
        (self.world.clone(), self.seed, self.setting.clone())
    }
}

/// A line of the page: a duration's name, and the medians over the missions of median, 99 % and longest, microseconds.
pub type Line = (&'static str, [Option<f64>; 3]);

pub fn medians(setting: &str, latencies: &[Latency]) -> [Line; 2] {
    type Column = fn(&Latency) -> Option<f64>;
    let over = |column: Column| {
        let its = latencies.iter().filter(|it| it.setting == setting);
        median(its.filter_map(column))
    };
    [
        ("tick", [over(|it| it.tick_p50_us), over(|it| it.tick_p99_us), over(|it| it.tick_max_us)]),
        (
            "full solve",
            [
                over(|it| it.full_solve_p50_us),
                over(|it| it.full_solve_p99_us),
                over(|it| it.full_solve_max_us),
            ],
        ),
    ]
}
