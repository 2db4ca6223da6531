//! Tables of experiments and claims. The paper omits its worlds' dimensions; the shipped missions
//! choose them.

use console::missions;
use serde::Deserialize;

use crate::{
    error::{Result, refuse},
    missions::trial::{Trial, swept_m},
};

/// Place of the drum that is unknown without sensing. A robot without sensing touches unknown
/// objects on its path; the other drums' field leads away from this one.
const UNKNOWN_AT_M: [f64; 2] = [2.3, -1.7];

/// Methods of the experiments, with assignments: the paper's with its dead reckoning (21).
pub const METHODS: [(&str, &[&str]); 2] = [
    (PAPER, &["method='paper'", "dead_reckoning.integration='euler'"]),
    ("evidential", &["method='evidential'"]),
];
const PAPER: &str = "paper";

#[derive(Deserialize)]
pub struct Experiment {
    pub name: String,
    pub title: String,
    pub reported: String,
    pub reported_time_s: Option<f64>,
    mission: String,
    change: Option<String>,
    /// Whether only the paper's method can run it: the default method has no constant speed.
    paper_only: bool,
}

/// Claim of the paper about the median of a figure, or the share that `arrived`.
///
/// "About half" is 0.4 to 0.6, "about 0.7" is 0.6 to 0.8. A minor deviation is up to a fifth of the
/// path.
#[derive(Deserialize)]
pub struct Claim {
    pub experiment: String,
    pub claim: String,
    pub figure: String,
    pub over: Option<String>,
    pub least: f64,
    pub most: f64,
}

pub fn claims() -> csv::Result<Vec<Claim>> {
    crate::rows(include_str!("claims.csv").as_bytes())
}

pub fn named(names: &[String]) -> Result<Vec<Experiment>> {
    let mut table: Vec<Experiment> = crate::rows(include_str!("table.csv").as_bytes())?;
    if let Some(name) = names.iter().find(|name| !table.iter().any(|it| it.name == **name)) {
        let known: Vec<_> = table.into_iter().map(|it| it.name).collect();
        let known = known.join(", ");
        let unknown = format!("unknown experiment {name:?}; give some of {known}");
        return refuse("unknown-experiment", unknown);
    }
    table.retain(|it| names.is_empty() || names.contains(&it.name));
    Ok(table)
}

impl Experiment {
    pub fn is_run_by(&self, method: &str) -> bool {
        method == PAPER || !self.paper_only
    }

    pub fn trial(&self) -> Result<Trial> {
        let mut mission = missions::load(&self.mission, self.change.as_slice())?;
        mission.name = self.name.clone();
        mission.description = self.title.clone();
        if !mission.sensing {
            mission.known = mission.world.clone();
            mission.known.drums.retain(|drum| drum.at.to_array() != UNKNOWN_AT_M);
        }
        let swept_m = swept_m(&mission);
        let trial = Trial::of_mission(mission, swept_m);
        let unsolvable = || {
            format!(
                "experiment {}: the target is unreachable; change the obstacles of its mission",
                self.name
            )
        };
        Ok(trial.ok_or_else(unsolvable)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_experiment_3_knows_anything_and_it_alone_does_not_sense() {
        for experiment in named(&[]).unwrap() {
            let mission = experiment.trial().unwrap().mission;
            let knows = !mission.known.is_empty();
            let is_third = experiment.name == "3";
            assert_eq!((knows, !mission.sensing), (is_third, is_third));
        }
        let third = named(&["3".to_owned()]).unwrap()[0].trial().unwrap().mission;
        let unknown = third.world.drums.len() - third.known.drums.len();
        assert_eq!(unknown, 1, "its map is partial");
    }
}
