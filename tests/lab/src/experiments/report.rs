//! The results of the experiments as text, as a page and as JSON objects.

use std::{
    fmt::Write as _,
    path::{Path, PathBuf},
};

use console::table::Table;
use serde::Serialize;
use serde_json::{Value, json};

use super::table::{Claim, Experiment, METHODS, claims};
use crate::{
    error::Result,
    missions::{
        page::Page,
        row::{Outcome, Row},
        runner::picture,
        statistics::{Spread, share},
    },
};

/// The figures of missions that arrived, with their digits.
const FIGURES: [(&str, usize); 7] = [
    ("time_s", 1),
    ("path_m", 2),
    ("k", 2),
    ("clearance_m", 2),
    ("safety_events", 0),
    ("sonar_unavailable", 2),
    ("wheel_range_rad_s", 2),
];
/// The missions of an experiment by one method.
struct Findings<'a> {
    experiment: &'a Experiment,
    method: &'static str,
    rows: Vec<&'a Row>,
}

impl Findings<'_> {
    fn count(&self, outcome: Outcome) -> usize {
        self.rows.iter().filter(|row| row.outcome == outcome).count()
    }

    /// The quartiles of a figure over the missions that arrived; none if none did.
    fn spread(&self, figure: &str) -> Option<Spread> {
        let arrived = self.rows.iter().filter(|row| row.is_success());
        Spread::of(arrived.filter_map(|row| row.number(figure)))
    }

    fn value(&self, figure: &str) -> Option<f64> {
        match figure {
            "arrived" => Some(share(self.count(Outcome::Success), self.rows.len()).value),
            _ => Some(self.spread(figure)?.median),
        }
    }

    /// Missions that arrived, that touched something, that ended in a wrong place, and those that ran out of time, gave up or
    /// failed.
    fn counts(&self) -> [usize; 4] {
        let [arrived, touched, wrong_place] =
            [Outcome::Success, Outcome::Collision, Outcome::WrongPlace].map(|it| self.count(it));
        [arrived, touched, wrong_place, self.rows.len() - arrived - touched - wrong_place]
    }

    fn add_to(&self, table: &mut Table<14>) {
        let [arrived, touched, wrong_place, others] = self.counts();
        let Experiment { name, reported_time_s, .. } = self.experiment;
        let arrived = format!("{arrived}/{}", self.rows.len());
        let paper = reported_time_s.map_or("-".to_owned(), |time| format!("{time:.0}"));
        // The median and the middle half, like `51.2 (48.0-55.1)`.
        let [time, path, k, clearance, events, sonar, wheels] =
            FIGURES.map(|(figure, digits)| match self.spread(figure) {
                None => "-".to_owned(),
                Some(Spread { low, median, high }) => {
                    format!("{median:.digits$} ({low:.digits$}-{high:.digits$})")
                }
            });
        table.row([
            name,
            &self.method,
            &arrived,
            &touched,
            &wrong_place,
            &others,
            &paper,
            &time,
            &path,
            &k,
            &clearance,
            &events,
            &sonar,
            &wheels,
        ]);
    }

    fn object(&self) -> Value {
        let [arrived, touched, wrong_place, others] = self.counts();
        let arrival = share(arrived, self.rows.len());
        let mut object = json!({
            "count": self.rows.len(),
            "arrived": arrived,
            "arrival_interval": [arrival.low, arrival.high],
            "touched": touched,
            "wrong_place": wrong_place,
            "others": others,
        });
        for (figure, ..) in FIGURES {
            object[figure] = json!(self.spread(figure));
        }
        object
    }
}

/// A claim of the paper, and the figure of one method.
#[derive(Serialize)]
struct Expectation {
    experiment: String,
    method: &'static str,
    claim: String,
    found: f64,
    holds: bool,
}

/// Findings and expectations of the experiments that were run.
pub struct Report<'a> {
    rows: &'a [Row],
    experiments: &'a [Experiment],
    findings: Vec<Findings<'a>>,
    expectations: Vec<Expectation>,
}

impl<'a> Report<'a> {
    pub fn new(experiments: &'a [Experiment], rows: &'a [Row]) -> Result<Self> {
        let mut findings = Vec::new();
        for experiment in experiments {
            for (method, _) in METHODS {
                let is_its = |row: &&Row| row.world == experiment.name && row.setting == method;
                let rows: Vec<_> = rows.iter().filter(is_its).collect();
                if !rows.is_empty() {
                    findings.push(Findings { experiment, method, rows });
                }
            }
        }
        let claims = claims()?;
        let mut expectations = Vec::new();
        for (method, _) in METHODS {
            let value = |experiment: &String, figure: &str| {
                let is_its =
                    |it: &&Findings<'_>| it.experiment.name == *experiment && it.method == method;
                findings.iter().find(is_its)?.value(figure)
            };
            expectations.extend(claims.iter().filter_map(|claim| {
                let Claim { experiment, claim, figure, over, least, most } = claim;
                let mut found = value(experiment, figure)?;
                if let Some(over) = over {
                    found /= value(over, figure).filter(|&value| value != 0.0)?;
                }
                Some(Expectation {
                    experiment: experiment.clone(),
                    method,
                    claim: claim.clone(),
                    found,
                    holds: (*least..=*most).contains(&found),
                })
            }));
        }
        Ok(Self { rows, experiments, findings, expectations })
    }

    /// An object for each experiment: the paper's values, those of each method, and the claims that hold.
    pub fn objects(&self) -> impl Iterator<Item = Value> {
        self.experiments.iter().map(|experiment| {
            let Experiment { name, title, reported, reported_time_s, .. } = experiment;
            let claims: Vec<_> =
                self.expectations.iter().filter(|it| it.experiment == *name).collect();
            let mut object = json!({
                "experiment": name,
                "title": title,
                "reported": reported,
                "reported_time_s": reported_time_s,
                "expectations": claims,
            });
            for findings in self.findings.iter().filter(|it| it.experiment.name == *name) {
                object[findings.method] = findings.object();
            }
            object
        })
    }

    /// Write the page into `directory`; pictures are beside it. `command` reproduces the results.
    pub fn save_page(
        &self,
        directory: &Path,
        command: &str,
        pictured_seed: u64,
    ) -> Result<PathBuf> {
        let mut page = Page::new("The paper's experiments", command);
        page.table(&self.text());
        for Experiment { name, title, reported, .. } in self.experiments {
            page.heading(&format!("{name}: {title}"));
            page.text(&format!("The paper: {reported}."));
            for row in self.rows.iter().filter(|row| row.world == *name) {
                if row.seed == pictured_seed || !row.is_success() {
                    let Row { setting, seed, .. } = row;
                    let caption = format!("{setting}, seed {seed}: {}", row.outcome_name());
                    page.figure(&caption, directory, &picture(row));
                }
            }
        }
        page.save(directory)
    }

    /// The table, and the claims that hold.
    pub fn text(&self) -> String {
        let mut table = Table::new([
            "experiment",
            "method",
            "arrived",
            "touched",
            "wrong place",
            "other",
            "paper, s",
            "time, s",
            "path, m",
            "K",
            "clearance, m",
            "safety events",
            "sonar unavailable",
            "wheel range, rad/s",
        ]);
        self.findings.iter().for_each(|findings| findings.add_to(&mut table));
        let mut text = format!("{table}medians and the middle half of the missions that arrived\n");
        for Expectation { experiment, method, claim, found, holds } in &self.expectations {
            let holds = if *holds { "holds" } else { "does not hold" };
            let _ = writeln!(text, "{experiment}, {method}: {claim}: {found:.2}, {holds}");
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::table::named;

    #[test]
    fn every_claim_is_of_experiments_there_are() {
        let table = named(&[]).unwrap();
        let is = |name: &str| table.iter().any(|experiment| experiment.name == name);
        for Claim { experiment, figure, over, .. } in claims().unwrap() {
            assert!(is(&experiment) && over.as_deref().is_none_or(is), "{experiment}");
            let known = figure == "arrived" || FIGURES.iter().any(|it| it.0 == figure);
            assert!(known, "{figure}");
        }
    }
}
