//! The result of each setting over all its missions, the differences of two settings on the same missions, and the page with every
//! failure, its picture and its own page.

use std::{collections::BTreeMap, fmt::Write as _, path::PathBuf};

use serde_json::{Value, json};

use crate::{
    error::Result,
    missions::{
        Setting,
        page::Page,
        results::Results,
        row::{OUTCOMES, Outcome, Row},
        runner,
        statistics::{Estimate, mean, median, paired_difference, share},
    },
};

/// A metric beside the shares: key, name and digits. With `median_` the key is of the median of a column over the successes,
/// otherwise of the mean over all missions.
type Metric = (&'static str, &'static str, usize);

const METRICS: [Metric; 9] = [
    ("median_time_s", "median time, s", 1),
    ("median_k", "median K", 2),
    ("spl", "SPL", 3),
    ("barn_score", "BARN score", 3),
    ("median_clearance_m", "median least clearance, m", 3),
    ("median_p_o", "median p_o", 3),
    ("median_f_ps_m2", "median f_ps, m2", 4),
    ("median_f_vs_m_s2", "median f_vs, m/s2", 3),
    ("median_look_share", "median share of looking", 3),
];

struct Totals<'a> {
    setting: &'a str,
    count: usize,
    /// Shares of all missions, in the order of [`OUTCOMES`].
    shares: [Estimate; OUTCOMES.len()],
    metrics: [Option<f64>; METRICS.len()],
}

impl<'a> Totals<'a> {
    fn of(setting: &'a str, rows: &[Row]) -> Self {
        let rows: Vec<&Row> = rows.iter().filter(|row| row.setting == setting).collect();
        let ended = |name| rows.iter().filter(|row| row.outcome_name() == name).count();
        let value = |key: &str| match key.strip_prefix("median_") {
            Some(column) => {
                let successes = rows.iter().filter(|row| row.is_success());
                median(successes.filter_map(|row| row.number(column)))
            }
            None => mean(rows.iter().filter_map(|row| row.number(key))),
        };
        Self {
            setting,
            count: rows.len(),
            shares: OUTCOMES.map(|name| share(ended(name), rows.len())),
            metrics: METRICS.map(|(key, ..)| value(key)),
        }
    }

    fn object(&self) -> Value {
        let mut object = json!({ "setting": self.setting, "count": self.count });
        for (name, share) in OUTCOMES.iter().zip(&self.shares) {
            object[*name] = share.value.into();
        }
        for ((key, ..), value) in METRICS.iter().zip(self.metrics) {
            object[*key] = value.into();
        }
        object
    }
}

/// The differences of the second setting from the first on the same worlds with the same noise.
struct Comparison<'a> {
    from: &'a str,
    to: &'a str,
    pairs: usize,
    success: Estimate,
    collision: Estimate,
    /// Median ratio of the second's time to the first's, over missions in which both succeeded.
    time_ratio: Option<f64>,
}

impl<'a> Comparison<'a> {
    fn of(from: &'a str, to: &'a str, rows: &[Row]) -> Self {
        let of = |setting| -> BTreeMap<_, &Row> {
            let its = rows.iter().filter(|row| row.setting == setting);
            its.map(|row| ((&row.world, row.seed), row)).collect()
        };
        let (first, second) = (of(from), of(to));
        let pairs: Vec<(&Row, &Row)> =
            first.iter().filter_map(|(key, row)| Some((*row, *second.get(key)?))).collect();
        let count = |outcome, counts: fn(bool, bool) -> bool| {
            let has = |row: &Row| row.outcome == outcome;
            pairs.iter().filter(|(a, b)| counts(has(a), has(b))).count()
        };
        let change = |outcome| {
            let (gained, lost) = (count(outcome, |a, b| b && !a), count(outcome, |a, b| a && !b));
            paired_difference(gained, lost, pairs.len())
        };
        let both = pairs.iter().filter(|(a, b)| a.is_success() && b.is_success());
        Self {
            from,
            to,
            pairs: pairs.len(),
            success: change(Outcome::Success),
            collision: change(Outcome::Collision),
            time_ratio: median(both.map(|(a, b)| b.time_s / a.time_s.max(1e-9))),
        }
    }

    fn text(&self) -> String {
        let Self { from, to, pairs, success, collision, time_ratio } = self;
        let ratio = time_ratio.map_or(String::new(), |ratio| format!(", time x {ratio:.2}"));
        format!(
            "{to} against {from}, {pairs} pairs: success {success:+}, collision {collision:+}{ratio}"
        )
    }

    fn object(&self, totals: &Totals<'_>) -> Value {
        let interval = |of: Estimate| [of.value, of.low, of.high];
        json!({
            "totals": totals.object(),
            "pairs": self.pairs,
            "success_change": interval(self.success),
            "collision_change": interval(self.collision),
            "time_ratio": self.time_ratio,
        })
    }
}

/// The totals of every setting, and the comparisons of each but the first with the first.
pub struct Report<'a> {
    results: &'a Results,
    totals: Vec<Totals<'a>>,
    comparisons: Vec<Comparison<'a>>,
}

impl<'a> Report<'a> {
    pub fn new(settings: &'a [Setting], results: &'a Results) -> Self {
        let rows = &results.rows.rows;
        let names = settings.iter().map(|setting| &*setting.name);
        let others = names.clone().skip(1);
        Self {
            results,
            totals: names.map(|name| Totals::of(name, rows)).collect(),
            comparisons: others.map(|to| Comparison::of(&settings[0].name, to, rows)).collect(),
        }
    }

    /// The first setting; `versus` has the others.
    pub fn object(&self) -> Value {
        let mut totals = self.totals.iter();
        let mut object = totals.next().map(Totals::object).unwrap_or_default();
        let others = totals.zip(&self.comparisons).map(|(totals, it)| it.object(totals));
        let others: Vec<Value> = others.collect();
        if !others.is_empty() {
            object["versus"] = others.into();
        }
        object
    }

    /// The totals with Wilson's 95 % intervals, and the comparisons.
    pub fn text(&self) -> String {
        let mut text = String::new();
        // Writing to a String cannot fail.
        for totals in &self.totals {
            let _ = writeln!(text, "{}: {} missions", totals.setting, totals.count);
            for (name, share) in OUTCOMES.iter().zip(totals.shares) {
                if share.value > 0.0 || *name == "collision" {
                    let _ = writeln!(text, "  {name:<12} {share}");
                }
            }
            for ((_, name, digits), value) in METRICS.iter().zip(totals.metrics) {
                let _ = value.map(|value| writeln!(text, "  {name:<26} {value:.digits$}"));
            }
        }
        for comparison in &self.comparisons {
            text += &comparison.text();
            text.push('\n');
        }
        text
    }

    /// Write the page; pictures are beside it, as [`runner::picture`] says. `command` reproduces the results.
    pub fn save_page(&self, command: &str) -> Result<PathBuf> {
        let Results { directory, rows, .. } = self.results;
        let mut page = Page::new("Evaluation", command);
        page.table(&self.text());
        for outcome in OUTCOMES.into_iter().skip(1) {
            let failures: Vec<_> =
                rows.rows.iter().filter(|row| row.outcome_name() == outcome).collect();
            if !failures.is_empty() {
                page.heading(&format!("{outcome} ({})", failures.len()));
            }
            for row in failures {
                let picture = runner::picture(row);
                let own_page = picture.with_extension("html");
                let there = [&picture, &own_page]
                    .map(|file| directory.join(file).exists().then_some(&**file));
                let Row { world, seed, setting, reason, .. } = row;
                let caption = format!("{world}, seed {seed}, {setting}: {reason}");
                page.figure(&caption, there[0], there[1]);
            }
        }
        page.save(directory)
    }
}
