//! What became of one experiment by one method.

use serde::Serialize;

use crate::{
    experiments::{experiment::Experiment, method::Method},
    row::{Outcome, Row},
    statistics::{Estimate, Spread, share},
};

/// Over the seeds. Spreads are over the missions that arrived; none where none did.
#[derive(Clone, Debug)]
pub struct ExperimentResult {
    /// The method.
    pub method: Method,
    /// Missions.
    pub count: usize,
    /// Those that arrived, by the ground truth.
    pub arrived: usize,
    /// Those that touched something.
    pub touched: usize,
    /// Those that stopped elsewhere: by dead reckoning they were at the target.
    pub wrong_place: usize,
    /// Those that ended otherwise: out of time, gave up, failed.
    pub others: usize,
    /// Share that arrived.
    pub arrival: Estimate,
    /// What was measured.
    pub spreads: Spreads,
}

/// What was measured on the missions that arrived: quartiles.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Spreads {
    /// Mission time until the arrival, seconds.
    pub time_s: Option<Spread>,
    /// Driven, metres.
    pub path_m: Option<Spread>,
    /// K: the path over the straight distance.
    pub k: Option<Spread>,
    /// Least clearance on the way, metres.
    pub clearance_m: Option<Spread>,
    /// Range samples that put a hazard on the map.
    pub safety_events: Option<Spread>,
    /// Share of the ticks in which the sonar gave no distance.
    pub sonar_unavailable: Option<Spread>,
    /// The greatest commanded speed of either wheel less the least one, rad/s.
    pub wheel_range_rad_s: Option<Spread>,
}

impl ExperimentResult {
    /// Of the rows of `experiment` by `method`; none if there are none.
    #[must_use]
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
