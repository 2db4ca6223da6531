//! The paper's claims as conditions on medians, and whether they hold here.

use serde::Serialize;

use crate::{
    experiments::{
        experiment::TABLE,
        method::Method,
        result::{ExperimentResult, Spreads},
    },
    row::Row,
    statistics::Spread,
};

#[derive(Debug)]
struct Claim {
    experiment: &'static str,
    /// The claim as a condition.
    text: &'static str,
    figure: Figure,
    /// The least value of the figure.
    from: f64,
    /// The greatest value.
    to: f64,
}

#[derive(Clone, Copy, Debug)]
enum Figure {
    Arrival,
    Median(fn(&Spreads) -> Option<Spread>),
    /// A median divided by that of another experiment.
    Over(&'static str, fn(&Spreads) -> Option<Spread>),
}

/// The bound of a figure that must be below 1.
const LESS: f64 = 1.0 - 1e-9;
/// The bound of a figure that must be above 1.
const MORE: f64 = 1.0 + 1e-9;

macro_rules! claims {
    ($($experiment:literal: $text:literal, $figure:expr, $from:expr, $to:expr;)*) => {
        [$(Claim { experiment: $experiment, text: $text, figure: $figure, from: $from, to: $to }),*]
    };
}

/// "About half" is 0.4 to 0.6, "about 0.7" is 0.6 to 0.8; a deviation is minor up to a fifth of the path.
static CLAIMS: [Claim; 15] = claims! {
    "1a": "safety events: none", Figure::Median(|of| of.safety_events), 0.0, 0.0;
    "1a": "K is 1: a straight line", Figure::Median(|of| of.k), 0.9, 1.05;
    "1b": "there are safety events", Figure::Median(|of| of.safety_events), 1.0, f64::INFINITY;
    "1b": "path over that of 1a: minor deviation", Figure::Over("1a", |of| of.path_m), 0.9, 1.2;
    "2": "sonar unavailable more than half of the time", Figure::Median(|of| of.sonar_unavailable), 0.5, 1.0;
    "3": "time over that of 2: about half", Figure::Over("2", |of| of.time_s), 0.4, 0.6;
    "3": "wheel range over that of 2: less", Figure::Over("2", |of| of.wheel_range_rad_s), 0.0, LESS;
    "3": "clearance over that of 2: not less", Figure::Over("2", |of| of.clearance_m), 1.0, f64::INFINITY;
    "4-180": "arrives each time", Figure::Arrival, 1.0, 1.0;
    "4-90": "arrives each time", Figure::Arrival, 1.0, 1.0;
    "4-0": "arrives each time", Figure::Arrival, 1.0, 1.0;
    "5-modulated": "time over constant: about 0.7", Figure::Over("5-constant", |of| of.time_s), 0.6, 0.8;
    "5-modulated": "safety events over constant: fewer", Figure::Over("5-constant", |of| of.safety_events), 0.0, LESS;
    "5-modulated": "clearance over constant: more", Figure::Over("5-constant", |of| of.clearance_m), MORE, f64::INFINITY;
    "5-modulated": "wheel range over constant: less", Figure::Over("5-constant", |of| of.wheel_range_rad_s), 0.0, LESS;
};

/// A claim of the paper, and the figure of one method.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Expectation {
    pub experiment: &'static str,
    pub method: &'static str,
    /// The claim as a condition.
    pub claim: &'static str,
    pub found: f64,
    pub holds: bool,
}

/// Every claim whose figures are known.
pub fn expectations(rows: &[Row]) -> Vec<Expectation> {
    let of = |method: Method| {
        CLAIMS.iter().filter_map(move |claim| {
            let found = claim.figure.of(claim.experiment, method, rows)?;
            Some(Expectation {
                experiment: claim.experiment,
                method: method.as_str(),
                claim: claim.text,
                found,
                holds: (claim.from..=claim.to).contains(&found),
            })
        })
    };
    Method::ALL.into_iter().flat_map(of).collect()
}

impl Figure {
    fn of(self, experiment: &str, method: Method, rows: &[Row]) -> Option<f64> {
        let result = |name: &str| {
            let experiment = TABLE.iter().find(|experiment| experiment.name == name)?;
            ExperimentResult::of(experiment, method, rows)
        };
        let result_of_it = result(experiment)?;
        let median = |result: &ExperimentResult, pick: fn(&Spreads) -> Option<Spread>| {
            pick(&result.spreads).map(|spread| spread.median)
        };
        match self {
            Self::Arrival => Some(result_of_it.arrival.value),
            Self::Median(pick) => median(&result_of_it, pick),
            Self::Over(other, pick) => {
                let other = median(&result(other)?, pick).filter(|&value| value != 0.0)?;
                Some(median(&result_of_it, pick)? / other)
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
        for claim in &CLAIMS {
            assert!(is(claim.experiment), "{claim:?}");
            if let Figure::Over(other, _) = claim.figure {
                assert!(is(other), "{claim:?}");
            }
        }
    }
}
