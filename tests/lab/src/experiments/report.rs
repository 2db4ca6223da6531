//! The results of the experiments as text, as a page and as JSON objects.

use std::fmt::{self, Write as _};

use console::table::Table;
use serde_json::{Value, json};

use crate::{
    experiments::{
        claims::{Expectation, FIGURES, Findings, expectations},
        table::{Experiment, METHODS},
    },
    missions::{
        page::{END, escaped, figure, head},
        row::{Outcome, Row},
        runner::picture,
        statistics::{Spread, share},
    },
};

/// Findings and expectations of the experiments that were run.
#[derive(Debug)]
pub struct Report<'a> {
    rows: &'a [Row],
    experiments: &'a [&'static Experiment],
    findings: Vec<Findings<'a>>,
    expectations: Vec<Expectation>,
}

const COLUMNS: usize = 7 + FIGURES.len();

/// The median and the middle half, like `51.2 (48.0-55.1)`.
fn shown(spread: Option<Spread>, digits: usize) -> String {
    let Some(Spread { low, median, high }) = spread else {
        return "-".to_owned();
    };
    format!("{median:.digits$} ({low:.digits$}-{high:.digits$})")
}

fn titles() -> [&'static str; COLUMNS] {
    let first = ["experiment", "method", "arrived", "touched", "wrong place", "other", "paper, s"];
    std::array::from_fn(|column| match column.checked_sub(first.len()) {
        None => first[column],
        Some(figure) => FIGURES[figure].1,
    })
}

impl Findings<'_> {
    /// Missions that touched something, that ended in a wrong place, and those that ran out of time, gave up or failed.
    fn failures(&self) -> [usize; 3] {
        let [arrived, touched, wrong_place] =
            [Outcome::Success, Outcome::Collision, Outcome::WrongPlace].map(|it| self.count(it));
        [touched, wrong_place, self.rows.len() - arrived - touched - wrong_place]
    }

    fn cells(&self) -> [String; COLUMNS] {
        let [touched, wrong_place, others] = self.failures();
        let time = self.experiment.reported_time_s;
        let first = [
            self.experiment.name.to_owned(),
            self.method.to_owned(),
            format!("{}/{}", self.count(Outcome::Success), self.rows.len()),
            touched.to_string(),
            wrong_place.to_string(),
            others.to_string(),
            time.map_or("-".to_owned(), |time| format!("{time:.0}")),
        ];
        std::array::from_fn(|column| match column.checked_sub(first.len()) {
            None => first[column].clone(),
            Some(figure) => {
                let (_, _, digits, value) = FIGURES[figure];
                shown(self.spread(value), digits)
            }
        })
    }

    fn object(&self) -> Value {
        let arrived = self.count(Outcome::Success);
        let [touched, wrong_place, others] = self.failures();
        let arrival = share(arrived, self.rows.len());
        let mut object = json!({
            "count": self.rows.len(),
            "arrived": arrived,
            "arrival_interval": [arrival.low, arrival.high],
            "touched": touched,
            "wrong_place": wrong_place,
            "others": others,
        });
        for (key, _, _, value) in FIGURES {
            object[key] = json!(self.spread(value));
        }
        object
    }
}

impl<'a> Report<'a> {
    pub fn new(experiments: &'a [&'static Experiment], rows: &'a [Row]) -> Self {
        let findings = experiments.iter().flat_map(|experiment| {
            METHODS.iter().filter_map(|(method, _)| Findings::among(rows, experiment, method))
        });
        Self { rows, experiments, findings: findings.collect(), expectations: expectations(rows) }
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

    /// The page; pictures are beside it. `command` reproduces the results.
    pub fn html(&self, command: &str, pictured_seed: u64) -> String {
        let mut page = head("The paper's experiments");
        // Writing to a String cannot fail.
        let _ = write!(
            page,
            "<h1>The paper's experiments</h1>\n<p><code>{}</code></p>\n<p>Medians and, in brackets, the middle half of \
             the missions that arrived.</p>\n<table><tr><th>{}</th></tr>\n",
            escaped(command),
            titles().join("</th><th>")
        );
        for findings in &self.findings {
            let cells = findings.cells().map(|cell| escaped(&cell));
            let _ = writeln!(page, "<tr><td>{}</td></tr>", cells.join("</td><td>"));
        }
        page.push_str("</table>\n<table><tr><th>experiment</th><th>method</th><th>the paper says</th><th>found</th><th>holds</th></tr>\n");
        for expectation in &self.expectations {
            let Expectation { experiment, method, claim, found, holds } = expectation;
            let holds = if *holds { "yes" } else { "no" };
            let _ = writeln!(
                page,
                "<tr><td>{experiment}</td><td>{method}</td><td>{claim}</td><td>{found:.2}</td><td>{holds}</td></tr>"
            );
        }
        page.push_str("</table>\n");
        for experiment in self.experiments {
            let Experiment { name, title, reported, .. } = experiment;
            let _ = writeln!(page, "<h2>{name}: {title}</h2>\n<p>The paper: {reported}.</p>");
            let is_shown =
                |row: &&Row| row.seed == pictured_seed || row.outcome != Outcome::Success;
            let its = self.rows.iter().filter(|row| row.world == *name);
            for row in its.filter(is_shown) {
                let caption =
                    format!("{}, seed {}: {}", row.setting, row.seed, row.outcome.as_str());
                page.push_str(&figure(&caption, Some(&picture(row)), None));
            }
        }
        page.push_str(END);
        page
    }
}

impl fmt::Display for Report<'_> {
    /// The table, and the claims that hold.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut table = Table::new(titles());
        self.findings
            .iter()
            .for_each(|findings| table.row(findings.cells().each_ref().map(|cell| cell as _)));
        writeln!(f, "{table}medians and the middle half of the missions that arrived")?;
        for expectation in &self.expectations {
            let Expectation { experiment, method, claim, found, holds } = expectation;
            let holds = if *holds { "holds" } else { "does not hold" };
            writeln!(f, "{experiment}, {method}: {claim}: {found:.2}, {holds}")?;
        }
        Ok(())
    }
}
