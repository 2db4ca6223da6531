//! The result of one experiment by one method.

use serde::Serialize;

use crate::{
    experiments::{experiment::Experiment, method::Method},
    row::{Outcome, Row},
    statistics::{Estimate, Spread, share},
};

/// The result over all seeds. Spreads are over the missions that arrived; none if none did.
#[derive(Clone, Debug)]
pub struct ExperimentResult {
    pub method: Method,
    pub count: usize,
    /// Missions that arrived, by the ground truth.
    pub arrived: usize,
    pub touched: usize,
    /// Missions that ended elsewhere, at the target only by dead reckoning.
    pub wrong_place: usize,
    /// Missions that ran out of time, gave up or failed.
    pub others: usize,
    pub arrival: Estimate,
    pub spreads: Spreads,
}

/// Quartiles over the missions that arrived.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Spreads {
    /// Mission time until the arrival, seconds.
    pub time_s: Option<Spread>,
    pub path_m: Option<Spread>,
    /// K: path divided by straight distance.
    pub k: Option<Spread>,
    pub clearance_m: Option<Spread>,
    /// Range samples that put a hazard on the map.
    pub safety_events: Option<Spread>,
    /// Share of the ticks in which the sonar gave no distance.
    pub sonar_unavailable: Option<Spread>,
    /// The greatest commanded speed of either wheel less the least one, rad/s.
    pub wheel_range_rad_s: Option<Spread>,
}

impl ExperimentResult {
    /// The result of `experiment` by `method` from its rows; none without rows.
    pub fn of(experiment: &Experiment, method: Method, rows: &[Row]) -> Option<Self> {
        let is_its = |row: &&Row| row.world == experiment.name && row.setting == method.as_str();
        let rows: Vec<&Row> = rows.iter().filter(is_its).collect();
        let ended = |outcome| rows.iter().filter(|row| row.outcome == outcome).count();
        let [arrived, touched, wrong_place] =
            [Outcome::Success, Outcome::Collision, Outcome::WrongPlace].map(ended);
        let spread = |value: fn(&Row) -> Option<f64>| {
            let all = rows.iter().filter(|row| row.outcome == Outcome::Success);
            Spread::of(all.filter_map(|row| value(row)))
        };
        (!rows.is_empty()).then(|| Self {
            method,
            count: rows.len(),
            arrived,
            touched,
            wrong_place,
            others: rows.len() - arrived - touched - wrong_place,
            arrival: share(arrived, rows.len()),
            spreads: Spreads {
                time_s: spread(|row| Some(row.time_s)),
                path_m: spread(|row| Some(row.path_m)),
                k: spread(|row| Some(row.k)),
                clearance_m: spread(|row| row.min_clearance_m),
                safety_events: spread(|row| Some(row.safety_events as f64)),
                sonar_unavailable: spread(|row| row.sonar_unavailable_share),
                wheel_range_rad_s: spread(|row| row.wheel_range_rad_s),
            },
        })
    }
}
