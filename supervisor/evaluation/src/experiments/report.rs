//! The results of the experiments as text, as a page and as JSON objects.

use std::fmt::{self, Write as _};

use serde_json::{Map, Value, json};

use crate::{
    experiments::{
        expectation::{Expectation, expectations},
        experiment::Experiment,
        method::Method,
        result::{ExperimentResult, Spreads},
    },
    page::{END, escaped, head},
    row::{Outcome, Row},
    runner::picture,
    statistics::Spread,
};

/// Results and expectations of the experiments that were run.
#[derive(Debug)]
pub struct Report<'a> {
    rows: &'a [Row],
    results: Vec<(&'static Experiment, Vec<ExperimentResult>)>,
    expectations: Vec<Expectation>,
}

/// A column of measured values: title, value, digits.
type Column = (&'static str, fn(&Spreads) -> Option<Spread>, usize);

const COLUMNS: [Column; 7] = [
    ("time, s", |of| of.time_s, 1),
    ("path, m", |of| of.path_m, 2),
    ("K", |of| of.k, 2),
    ("clearance, m", |of| of.clearance_m, 2),
    ("safety events", |of| of.safety_events, 0),
    ("sonar unavailable", |of| of.sonar_unavailable, 2),
    ("wheel range, rad/s", |of| of.wheel_range_rad_s, 2),
];

/// The median and the middle half, like `51.2 (48.0-55.1)`.
fn shown(spread: Option<Spread>, digits: usize) -> String {
    let Some(Spread { low, median, high }) = spread else {
        return "-".to_owned();
    };
    format!("{median:.digits$} ({low:.digits$}-{high:.digits$})")
}

/// Title and cells of every column of a result.
fn cells(experiment: &Experiment, result: &ExperimentResult) -> Vec<(&'static str, String)> {
    let time = experiment.reported_time_s;
    let first = [
        ("experiment", experiment.name.to_owned()),
        ("method", result.method.as_str().to_owned()),
        ("arrived", format!("{}/{}", result.arrived, result.count)),
        ("touched", result.touched.to_string()),
        ("wrong place", result.wrong_place.to_string()),
        ("other", result.others.to_string()),
        ("paper, s", time.map_or("-".to_owned(), |time| format!("{time:.0}"))),
    ];
    let measured =
        COLUMNS.iter().map(|(title, pick, digits)| (*title, shown(pick(&result.spreads), *digits)));
    first.into_iter().chain(measured).collect()
}

impl<'a> Report<'a> {
    pub fn new(experiments: &[&'static Experiment], rows: &'a [Row]) -> Self {
        let results = experiments.iter().map(|&experiment| {
            let by = |method| ExperimentResult::of(experiment, method, rows);
            (experiment, Method::ALL.into_iter().filter_map(by).collect())
        });
        Self { rows, results: results.collect(), expectations: expectations(rows) }
    }

    fn lines(&self) -> impl Iterator<Item = Vec<(&'static str, String)>> {
        let results = self.results.iter();
        results.flat_map(|(experiment, results)| {
            results.iter().map(|result| cells(experiment, result))
        })
    }

    /// An object for each experiment: the paper's values, those of each method, and the claims that hold.
    pub fn objects(&self) -> Vec<Value> {
        let of = |(experiment, results): &(&'static Experiment, Vec<ExperimentResult>)| {
            let mut object = Map::new();
            object.insert("experiment".to_owned(), json!(experiment.name));
            object.insert("title".to_owned(), json!(experiment.title));
            object.insert("reported".to_owned(), json!(experiment.reported));
            object.insert("reported_time_s".to_owned(), json!(experiment.reported_time_s));
            for result in results {
                let interval = [result.arrival.low, result.arrival.high];
                let mut found = json!(result.spreads);
                found["count"] = json!(result.count);
                found["arrived"] = json!(result.arrived);
                found["arrival_interval"] = json!(interval);
                found["touched"] = json!(result.touched);
                found["wrong_place"] = json!(result.wrong_place);
                found["others"] = json!(result.others);
                object.insert(result.method.as_str().to_owned(), found);
            }
            let its = self.expectations.iter();
            let its: Vec<_> =
                its.filter(|expectation| expectation.experiment == experiment.name).collect();
            object.insert("expectations".to_owned(), json!(its));
            Value::Object(object)
        };
        self.results.iter().map(of).collect()
    }

    /// The page; pictures are beside it. `command` reproduces the results.
    pub fn html(&self, command: &str, pictured_seed: u64) -> String {
        let mut page = head("The paper's experiments");
        // Writing to a String cannot fail.
        let _ = write!(
            page,
            "<h1>The paper's experiments</h1>\n<p><code>{}</code></p>\n<p>Medians and, in brackets, the middle half of \
             the missions that arrived.</p>\n<table>",
            escaped(command)
        );
        for (number, line) in self.lines().enumerate() {
            if number == 0 {
                page.push_str("<tr>");
                for (title, _) in &line {
                    let _ = write!(page, "<th>{title}</th>");
                }
                page.push_str("</tr>\n");
            }
            page.push_str("<tr>");
            for (_, cell) in &line {
                let _ = write!(page, "<td>{}</td>", escaped(cell));
            }
            page.push_str("</tr>\n");
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
        for (experiment, _) in &self.results {
            let _ = writeln!(
                page,
                "<h2>{}: {}</h2>\n<p>The paper: {}.</p>",
                experiment.name, experiment.title, experiment.reported
            );
            let is_shown =
                |row: &&Row| row.seed == pictured_seed || row.outcome != Outcome::Success;
            let its = self.rows.iter().filter(|row| row.world == experiment.name);
            for row in its.filter(is_shown) {
                let file = picture(row);
                let file = escaped(&file.to_string_lossy());
                let _ = writeln!(
                    page,
                    "<figure><figcaption>{}, seed {}: {}</figcaption><img loading=\"lazy\" src=\"{file}\" alt=\"{file}\"></figure>",
                    row.setting,
                    row.seed,
                    row.outcome.as_str()
                );
            }
        }
        page.push_str(END);
        page
    }
}

impl fmt::Display for Report<'_> {
    /// The table, and the claims that hold.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lines: Vec<_> = self.lines().collect();
        let Some(first) = lines.first() else {
            return Ok(());
        };
        let titles: Vec<_> = first.iter().map(|(title, _)| (*title).to_owned()).collect();
        let rows = lines.iter().map(|line| line.iter().map(|(_, cell)| cell.clone()).collect());
        let table: Vec<Vec<String>> = [titles].into_iter().chain(rows).collect();
        let width = |column: usize| table.iter().map(|row| row[column].len()).max();
        let widths: Vec<usize> = (0..first.len()).filter_map(width).collect();
        for row in &table {
            let padded = row.iter().zip(&widths);
            let padded: Vec<_> = padded.map(|(cell, width)| format!("{cell:<width$}")).collect();
            writeln!(f, "{}", padded.join("  ").trim_end())?;
        }
        writeln!(f, "medians and the middle half of the missions that arrived")?;
        for expectation in &self.expectations {
            let holds = if expectation.holds { "holds" } else { "does not hold" };
            writeln!(
                f,
                "{}, {}: {}: {:.2}, {holds}",
                expectation.experiment, expectation.method, expectation.claim, expectation.found
            )?;
        }
        Ok(())
    }
}
