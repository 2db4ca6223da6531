//! The page of an evaluation: totals, paired differences, every failure with its picture and its own page.

use std::fmt::{self, Write as _};

use crate::missions::{
    latency::{self, Latency},
    page::{END, escaped, head},
    results::Results,
    row::{Outcome, Row},
    runner::{self, Plan},
    totals::{Comparison, Totals},
};

/// The totals of every setting, and the differences of each from the first.
#[derive(Clone, Debug)]
pub struct Report {
    /// The totals in the order of the settings.
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
            for outcome in Outcome::ALL {
                if let Some(share) = totals.share(outcome)
                    && (share.value > 0.0 || outcome == Outcome::Collision)
                {
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

impl Totals {
    /// Name, value and digits of the figures besides the shares.
    fn metrics(&self) -> impl Iterator<Item = (&'static str, f64, usize)> {
        let metrics = [
            ("median time, s", self.median_time_s, 1),
            ("median K", self.median_k, 2),
            ("SPL", self.spl, 3),
            ("BARN score", self.barn_score, 3),
            ("median least clearance, m", self.median_clearance_m, 3),
            ("median p_o", self.median_p_o, 3),
            ("median f_ps, m2", self.median_f_ps_m2, 4),
            ("median f_vs, m/s2", self.median_f_vs_m_s2, 3),
            ("median share of looking", self.median_look_share, 3),
        ];
        let known = |(name, value, digits): (_, Option<f64>, _)| Some((name, value?, digits));
        metrics.into_iter().filter_map(known)
    }
}

/// The page; pictures are beside it, as [`Plan::picture`] says. `command` reproduces the results.
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
        for outcome in Outcome::ALL {
            let share = totals.share(outcome);
            let share = share.map_or(String::new(), |share| share.to_string());
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
            let _ = write!(
                page,
                "<figure><figcaption>{}, seed {}, {}: {}</figcaption>",
                escaped(&row.world),
                row.seed,
                escaped(&row.setting),
                escaped(&row.reason)
            );
            let picture = plan.picture(row);
            if let (true, Some(name)) = (picture.exists(), picture.file_name()) {
                let name = escaped(&name.to_string_lossy());
                let _ =
                    write!(page, "<img loading=\"lazy\" src=\"failures/{name}\" alt=\"{name}\">");
            }
            let own_page = runner::page(&picture);
            if let (true, Some(name)) = (own_page.exists(), own_page.file_name()) {
                let name = escaped(&name.to_string_lossy());
                let _ = write!(page, "<a href=\"failures/{name}\">its page</a>");
            }
            page.push_str("</figure>\n");
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
