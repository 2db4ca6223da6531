//! The findings of an experiment by one method, and the paper's claims as conditions on them.

use std::ops::RangeInclusive;

use serde::Serialize;

use crate::{
    experiments::table::{Experiment, METHODS, TABLE},
    missions::{
        row::{Outcome, Row},
        statistics::{Spread, share},
    },
};

/// A figure of missions that arrived: its key, its title, its digits and its value of a mission.
pub type Figure = (&'static str, &'static str, usize, fn(&Row) -> Option<f64>);

pub const FIGURES: [Figure; 7] = [
    (TIME, "time, s", 1, |row| Some(row.time_s)),
    (PATH, "path, m", 2, |row| Some(row.path_m)),
    (K, "K", 2, |row| Some(row.k)),
    (CLEARANCE, "clearance, m", 2, |row| row.min_clearance_m),
    (SAFETY_EVENTS, "safety events", 0, |row| Some(row.safety_events as f64)),
    (SONAR_UNAVAILABLE, "sonar unavailable", 2, |row| row.sonar_unavailable_share),
    (WHEEL_RANGE, "wheel range, rad/s", 2, |row| row.wheel_range_rad_s),
];
const TIME: &str = "time_s";
const PATH: &str = "path_m";
const K: &str = "k";
const CLEARANCE: &str = "clearance_m";
const SAFETY_EVENTS: &str = "safety_events";
const SONAR_UNAVAILABLE: &str = "sonar_unavailable";
const WHEEL_RANGE: &str = "wheel_range_rad_s";

#[derive(Debug)]
pub struct Findings<'a> {
    pub experiment: &'static Experiment,
    pub method: &'static str,
    pub rows: Vec<&'a Row>,
}

impl<'a> Findings<'a> {
    /// Those among `rows`; none if there is none.
    pub fn among(
        rows: &'a [Row],
        experiment: &'static Experiment,
        method: &'static str,
    ) -> Option<Self> {
        let is_its = |row: &&Row| row.world == experiment.name && row.setting == method;
        let rows: Vec<_> = rows.iter().filter(is_its).collect();
        (!rows.is_empty()).then_some(Self { experiment, method, rows })
    }

    pub fn count(&self, outcome: Outcome) -> usize {
        self.rows.iter().filter(|row| row.outcome == outcome).count()
    }

    /// The quartiles of a figure over the missions that arrived; none if none did.
    pub fn spread(&self, value: fn(&Row) -> Option<f64>) -> Option<Spread> {
        let arrived = self.rows.iter().filter(|row| row.outcome == Outcome::Success);
        Spread::of(arrived.filter_map(|row| value(row)))
    }

    fn median(&self, key: &str) -> Option<f64> {
        let (.., value) = FIGURES.iter().find(|figure| figure.0 == key)?;
        Some(self.spread(*value)?.median)
    }
}

#[derive(Debug)]
enum Found {
    Arrival,
    Median(&'static str),
    /// The median of a figure divided by that of another experiment.
    Over(&'static str, &'static str),
}

/// The experiment, its claim as a condition, what it is about, and the range in which that holds.
type Claim = (&'static str, &'static str, Found, RangeInclusive<f64>);

/// The bound of a figure that must be below 1, and of one that must be above.
const LESS: f64 = 1.0 - 1e-9;
const MORE: f64 = 1.0 + 1e-9;
const ANY: f64 = f64::INFINITY;

/// "About half" is 0.4 to 0.6, "about 0.7" is 0.6 to 0.8; a deviation is minor up to a fifth of the path.
#[rustfmt::skip]
static CLAIMS: [Claim; 15] = [
    ("1a", "safety events: none", Found::Median(SAFETY_EVENTS), 0.0..=0.0),
    ("1a", "K is 1: a straight line", Found::Median(K), 0.9..=1.05),
    ("1b", "there are safety events", Found::Median(SAFETY_EVENTS), 1.0..=ANY),
    ("1b", "path over that of 1a: minor deviation", Found::Over("1a", PATH), 0.9..=1.2),
    ("2", "sonar unavailable more than half of the time", Found::Median(SONAR_UNAVAILABLE), 0.5..=1.0),
    ("3", "time over that of 2: about half", Found::Over("2", TIME), 0.4..=0.6),
    ("3", "wheel range over that of 2: less", Found::Over("2", WHEEL_RANGE), 0.0..=LESS),
    ("3", "clearance over that of 2: not less", Found::Over("2", CLEARANCE), 1.0..=ANY),
    ("4-180", "arrives each time", Found::Arrival, 1.0..=1.0),
    ("4-90", "arrives each time", Found::Arrival, 1.0..=1.0),
    ("4-0", "arrives each time", Found::Arrival, 1.0..=1.0),
    ("5-modulated", "time over constant: about 0.7", Found::Over("5-constant", TIME), 0.6..=0.8),
    ("5-modulated", "safety events over constant: fewer", Found::Over("5-constant", SAFETY_EVENTS), 0.0..=LESS),
    ("5-modulated", "clearance over constant: more", Found::Over("5-constant", CLEARANCE), MORE..=ANY),
    ("5-modulated", "wheel range over constant: less", Found::Over("5-constant", WHEEL_RANGE), 0.0..=LESS),
];

/// A claim of the paper, and the figure of one method.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Expectation {
    pub experiment: &'static str,
    pub method: &'static str,
    pub claim: &'static str,
    pub found: f64,
    pub holds: bool,
}

pub fn expectations(rows: &[Row]) -> Vec<Expectation> {
    let by = |(method, _): (&'static str, _)| {
        CLAIMS.iter().filter_map(move |(experiment, claim, about, range)| {
            let found = about.value(experiment, method, rows)?;
            let holds = range.contains(&found);
            Some(Expectation { experiment, method, claim, found, holds })
        })
    };
    METHODS.into_iter().flat_map(by).collect()
}

impl Found {
    fn value(&self, experiment: &str, method: &'static str, rows: &[Row]) -> Option<f64> {
        let findings = |name: &str| {
            let experiment = TABLE.iter().find(|experiment| experiment.name == name)?;
            Findings::among(rows, experiment, method)
        };
        let its = findings(experiment)?;
        match self {
            Self::Arrival => Some(share(its.count(Outcome::Success), its.rows.len()).value),
            Self::Median(key) => its.median(key),
            Self::Over(other, key) => {
                let other = findings(other)?.median(key).filter(|&value| value != 0.0)?;
                Some(its.median(key)? / other)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_claim_is_of_experiments_there_are() {
        let is = |name: &str| TABLE.iter().any(|experiment| experiment.name == name);
        for (experiment, _, about, _) in &CLAIMS {
            let other = if let Found::Over(other, _) = about { other } else { experiment };
            assert!(is(experiment) && is(other), "{experiment}: {about:?}");
        }
    }
}
