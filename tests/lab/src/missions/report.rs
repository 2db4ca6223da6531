//! The page of an evaluation: totals, paired differences, every failure with its picture and its own page.

use std::{
    fmt::{self, Write as _},
    path::Path,
};

use crate::missions::{
    latency::{self, Latency},
    page::{END, escaped, figure, head},
    results::Results,
    row::{Outcome, Row},
    runner::{self, Plan},
    totals::{Comparison, Totals},
};

/// The totals of every setting, and the differences of each from the first.
#[derive(Clone, Debug)]
pub struct Report {
    pub totals: Vec<Totals>,
    /// The comparisons of each setting but the first with the first.
    pub comparisons: Vec<Comparison>,
}

impl Report {
    pub fn new(plan: &Plan, rows: &[Row]) -> Self {
        let names: Vec<&str> = plan.settings.iter().map(|setting| &*setting.name).collect();
        let comparisons = names.iter().skip(1);
        Self {
            totals: names.iter().map(|name| Totals::of(name, rows)).collect(),
            comparisons: comparisons.map(|name| Comparison::of(names[0], name, rows)).collect(),
        }
    }
}

impl fmt::Display for Report {
    /// Write a table in text, with 95 % intervals.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for totals in &self.totals {
            writeln!(f, "{}: {} missions", totals.setting, totals.count)?;
            for (outcome, share) in Outcome::ALL.into_iter().zip(totals.shares) {
                if share.value > 0.0 || outcome == Outcome::Collision {
                    writeln!(f, "  {:<12} {share}", outcome.as_str())?;
                }
            }
            for (name, value, digits) in totals.metrics() {
                writeln!(f, "  {name:<26} {value:.digits$}")?;
            }
        }
        self.comparisons.iter().try_for_each(|comparison| writeln!(f, "{comparison}"))
    }
}

/// The page; pictures are beside it, as [`runner::picture`] says. `command` reproduces the results.
pub fn html(plan: &Plan, results: &Results, command: &str) -> String {
    let rows = results.rows.rows();
    let report = Report::new(plan, rows);
    let mut page = head("Evaluation");
    let _ = write!(
        page,
        "<h1>Evaluation</h1>\n<p><code>{}</code></p>\n<table><tr><th>setting</th><th>missions</th>",
        escaped(command)
    );
    for outcome in Outcome::ALL {
        let _ = write!(page, "<th>{}</th>", outcome.as_str());
    }
    page.push_str("<th>metrics of the successes</th></tr>\n");
    for totals in &report.totals {
        let _ = write!(page, "<tr><td>{}</td><td>{}</td>", escaped(&totals.setting), totals.count);
        for share in totals.shares {
            let _ = write!(page, "<td>{share}</td>");
        }
        let metrics: Vec<String> = totals
            .metrics()
            .map(|(name, value, digits)| format!("{name} {value:.digits$}"))
            .collect();
        let _ = writeln!(page, "<td>{}</td></tr>", metrics.join("<br>"));
    }
    page.push_str("</table>\n<p>Shares with Wilson's 95 % intervals.</p>\n");
    for comparison in &report.comparisons {
        let _ = writeln!(page, "<p>{}</p>", escaped(&comparison.to_string()));
    }
    add_latencies(&mut page, plan, results.latencies.rows());
    for outcome in Outcome::ALL.into_iter().skip(1) {
        let failures: Vec<&Row> = rows.iter().filter(|row| row.outcome == outcome).collect();
        if failures.is_empty() {
            continue;
        }
        let _ = writeln!(page, "<h2>{} ({})</h2>", outcome.as_str(), failures.len());
        for row in failures {
            let picture = runner::picture(row);
            let own_page = runner::page(&picture);
            let is_there = |file: &&Path| plan.directory.join(file).exists();
            let Row { world, seed, setting, reason, .. } = row;
            page.push_str(&figure(
                &format!("{world}, seed {seed}, {setting}: {reason}"),
                Some(&*picture).filter(is_there),
                Some(&*own_page).filter(is_there),
            ));
        }
    }
    page.push_str(END);
    page
}

/// Medians over the missions of each setting.
fn add_latencies(page: &mut String, plan: &Plan, latencies: &[Latency]) {
    if latencies.is_empty() {
        return;
    }
    page.push_str(
        "<h2>Latencies</h2>\n<p>Microseconds of this machine, medians over the missions; each mission is in <code>latencies.csv</code>.</p>\n\
<table><tr><th>setting</th><th>of a</th><th>median</th><th>99 %</th><th>longest</th></tr>\n",
    );
    for setting in &plan.settings {
        for (name, values) in latency::medians(&setting.name, latencies) {
            let _ = write!(page, "<tr><td>{}</td><td>{name}</td>", escaped(&setting.name));
            for value in values {
                let value = value.map_or(String::new(), |value| format!("{value:.0}"));
                let _ = write!(page, "<td>{value}</td>");
            }
            page.push_str("</tr>\n");
        }
    }
    page.push_str("</table>\n");
}
