//! THE table of experiments. The paper gives no dimensions of its worlds; the shipped missions choose them.

use common::mission::Mission;
use console::missions::{self, LookupError};
use thiserror::Error;

use crate::missions::trial::{BodySize, Trial};

/// Free ground on both sides of the body in the narrowest passage of a world, metres.
const MARGIN_M: f64 = 0.05;
/// Experiment 3: the drum at this place is not known, metres. A robot without sensing touches unknown things on its path; the
/// field of the other drums does not lead past this one.
const UNKNOWN_AT_M: (f64, f64) = (2.3, -1.7);

/// The methods by which experiments are carried out, with their assignments: the paper's with its dead reckoning, (21).
pub const METHODS: [(&str, &[&str]); 2] = [
    (PAPER, &["method='paper'", "dead_reckoning.integration='euler'"]),
    ("evidential", &["method='evidential'"]),
];
const PAPER: &str = "paper";

/// An experiment of section V.B of the paper.
#[derive(Debug)]
pub struct Experiment {
    /// The number in the paper, and the variant.
    pub name: &'static str,
    pub title: &'static str,
    pub reported: &'static str,
    pub reported_time_s: Option<f64>,
    /// The shipped mission that the experiment changes.
    mission: &'static str,
    change: fn(&mut Mission),
    /// Whether only the paper's method can do it.
    of_paper_only: bool,
}

#[derive(Debug, Error)]
pub enum ExperimentError {
    #[error("no experiment is called {name:?}; give some of {}", names())]
    Unknown { name: String },
    #[error(transparent)]
    Mission(#[from] LookupError),
    #[error(
        "experiment {name}: the robot cannot get to the target; change the obstacles of its mission"
    )]
    Unsolvable { name: &'static str },
}

fn names() -> String {
    let names: Vec<_> = TABLE.iter().map(|experiment| experiment.name).collect();
    names.join(", ")
}

/// An unchanged mission by both methods, without a time of the paper.
const PLAIN: Experiment = Experiment {
    name: "",
    title: "",
    reported: "",
    reported_time_s: None,
    mission: "",
    change: |_| {},
    of_paper_only: false,
};

/// Every experiment, in the paper's order.
pub static TABLE: [Experiment; 9] = [
    Experiment {
        name: "1a",
        title: "open passage, heading 0",
        reported: "a straight line, no safety event",
        mission: "passage",
        ..PLAIN
    },
    Experiment {
        name: "1b",
        title: "open passage, heading 90",
        reported: "false registrations block 50 % of the passage; minor deviation",
        mission: "passage",
        change: |mission| mission.start.heading_deg = 90.0,
        ..PLAIN
    },
    Experiment {
        name: "2",
        title: "obstacle course, sensor-based",
        reported: "almost 60 s; sonar unavailable more than 50 % of the time",
        reported_time_s: Some(60.0),
        mission: "obstacle-course",
        ..PLAIN
    },
    Experiment {
        name: "3",
        title: "obstacle course, partial a-priori map, no sensing",
        reported: "30 s; good clearance; dynamic range of the wheels less than in 2",
        reported_time_s: Some(30.0),
        mission: "obstacle-course",
        change: |mission| {
            mission.sensing = false;
            mission.known = mission.world.clone();
            let drums = &mut mission.known.drums;
            drums.retain(|drum| (drum.at.x, drum.at.y) != UNKNOWN_AT_M);
        },
        ..PLAIN
    },
    Experiment {
        name: "4-180",
        title: "U trap, heading 180",
        reported: "arrives",
        mission: "trap",
        change: |mission| mission.start.heading_deg = 180.0,
        ..PLAIN
    },
    Experiment {
        name: "4-90",
        title: "U trap, heading 90",
        reported: "arrives",
        mission: "trap",
        change: |mission| mission.start.heading_deg = 90.0,
        ..PLAIN
    },
    Experiment {
        name: "4-0",
        title: "U trap, heading 0",
        reported: "arrives",
        mission: "trap",
        ..PLAIN
    },
    Experiment {
        name: "5-constant",
        title: "one drum, constant speed",
        reported: "35 s",
        reported_time_s: Some(35.0),
        mission: "one-drum",
        change: |mission| mission.controller.modulated = false,
        // The default method has no constant speed.
        of_paper_only: true,
    },
    Experiment {
        name: "5-modulated",
        title: "one drum, modulated speed",
        reported: "25 s; fewer safety events, more clearance, less dynamic range than constant",
        reported_time_s: Some(25.0),
        mission: "one-drum",
        ..PLAIN
    },
];

impl Experiment {
    pub fn is_run_by(&self, method: &str) -> bool {
        method == PAPER || !self.of_paper_only
    }

    /// The mission of the experiment, without the method.
    fn mission(&self) -> Result<Mission, LookupError> {
        let mut mission = missions::load(self.mission, &[])?;
        mission.name = self.name.to_owned();
        mission.description = self.title.to_owned();
        (self.change)(&mut mission);
        Ok(mission)
    }

    /// The experiment as a trial of the evaluation.
    pub fn trial(&self) -> Result<Trial, ExperimentError> {
        let mission = self.mission()?;
        let body = BodySize { radius_m: mission.body().radius_m, margin_m: MARGIN_M };
        let trial = Trial::of_mission(self.name.to_owned(), mission, &body);
        trial.ok_or(ExperimentError::Unsolvable { name: self.name })
    }
}

/// The experiments of these names in the order of the table; all without names.
pub fn named(names: &[String]) -> Result<Vec<&'static Experiment>, ExperimentError> {
    let is_known = |name: &String| TABLE.iter().any(|experiment| experiment.name == name);
    if let Some(name) = names.iter().find(|name| !is_known(name)) {
        return Err(ExperimentError::Unknown { name: name.clone() });
    }
    let asked = |experiment: &&Experiment| {
        names.is_empty() || names.iter().any(|name| name == experiment.name)
    };
    Ok(TABLE.iter().filter(asked).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_experiment_can_be_crossed_and_by_the_papers_method_the_field_is_as_printed() {
        for experiment in &TABLE {
            let mut mission = experiment.trial().unwrap().mission;
            mission.method = common::mission::Method::Paper;
            assert_eq!(mission.screening_length_m(), None, "{}", experiment.name);
        }
    }

    #[test]
    fn only_experiment_3_knows_anything_and_it_alone_does_not_sense() {
        for experiment in &TABLE {
            let mission = experiment.mission().unwrap();
            let knows = !mission.known.is_empty();
            let is_third = experiment.name == "3";
            assert_eq!((knows, !mission.sensing), (is_third, is_third));
        }
        let third = named(&["3".to_owned()]).unwrap()[0].mission().unwrap();
        let unknown = third.world.drums.len() - third.known.drums.len();
        assert_eq!(unknown, 1, "its map is partial");
    }

    #[test]
    fn an_unknown_experiment_is_answered_with_those_there_are() {
        let error = named(&["6".to_owned()]).unwrap_err().to_string();
        assert!(error.contains("5-modulated"), "{error}");
        assert_eq!(named(&[]).unwrap().len(), TABLE.len());
    }
}
