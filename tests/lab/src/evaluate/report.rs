//! Results per setting, paired differences of settings, and the page of failures.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use crate::{
    error::Result,
    missions::{
        Setting,
        page::Page,
        results::Results,
        row::{OUTCOMES, Outcome, Row, spread},
        runner,
        statistics::{mean, median, paired_difference, rounded, share},
    },
};

/// Metrics beside the shares. `median_` keys are medians of a column over the successes, others
/// means over all missions.
const METRICS: [&str; 9] = [
    "median_time_s",
    "median_k",
    "spl",
    "barn_score",
    "median_clearance_m",
    "median_p_o",
    "median_f_ps_m2",
    "median_f_vs_m_s2",
    "median_look_share",
];

pub fn report(settings: &[Setting], rows: &[Row]) -> Value {
    let (first, others) = (&settings[0].name, &settings[1..]);
    let mut report = totals(first, rows);
    if !others.is_empty() {
        report["versus"] = others.iter().map(|other| versus(first, &other.name, rows)).collect();
    }
    report
}

fn totals(setting: &str, rows: &[Row]) -> Value {
    let rows: Vec<&Row> = rows.iter().filter(|row| row.setting == setting).collect();
    let mut totals = json!({ "setting": setting, "count": rows.len() });
    let mut add = |name: &str, counts: &dyn Fn(&Row) -> bool| {
        let hits = rows.iter().filter(|row| counts(row)).count();
        let [share, low, high] = share(hits, rows.len());
        totals[name] = share.into();
        totals["intervals"][name] = [low, high].map(rounded).into();
    };
    OUTCOMES.into_iter().for_each(|name| add(name, &|row| row.outcome_name() == name));
    // Collisions in motion; in the others the robot was run into at rest.
    add("at_fault_collision", &Row::is_at_fault);
    // Departed robots that the failsafe stopped, or slowed to half speed.
    add("stopped_by_failsafe", &|row| !row.stops.is_empty());
    add("slowed_by_failsafe", &|row| !row.slowed.is_empty());
    for key in METRICS {
        let value = match key.strip_prefix("median_") {
            Some(column) => spread(&rows, column).map(|spread| spread.median),
            None => mean(rows.iter().filter_map(|row| row.number(key))),
        };
        if let Some(value) = value {
            totals[key] = value.into();
        }
    }
    totals
}

fn versus(from: &str, to: &str, rows: &[Row]) -> Value {
    let of = |setting| -> BTreeMap<_, &Row> {
        let its = rows.iter().filter(|row| row.setting == setting);
        its.map(|row| ((&row.world, row.seed), row)).collect()
    };
    let (first, second) = (of(from), of(to));
    let pairs: Vec<(&Row, &Row)> =
        first.iter().filter_map(|(key, row)| Some((*row, *second.get(key)?))).collect();
    let change = |has: &dyn Fn(&Row) -> bool| {
        let gained = pairs.iter().filter(|(a, b)| has(b) && !has(a)).count();
        let lost = pairs.iter().filter(|(a, b)| has(a) && !has(b)).count();
        paired_difference(gained, lost, pairs.len()).map(rounded)
    };
    let both = pairs.iter().filter(|(a, b)| a.is_success() && b.is_success());
    let mut versus = json!({
        "totals": totals(to, rows),
        "pairs": pairs.len(),
        "success_change": change(&Row::is_success),
        "collision_change": change(&|row| row.outcome == Outcome::Collision),
        "at_fault_change": change(&Row::is_at_fault),
    });
    // Median ratio of times over missions in which both succeeded.
    if let Some(ratio) = median(both.map(|(a, b)| b.time_s / a.time_s.max(1e-9))) {
        versus["time_ratio"] = ratio.into();
    }
    versus
}

pub fn save_page(results: &Results, report: &Value) -> Result {
    let rows = &results.rows.rows;
    let mut page = Page::new("Evaluation", results);
    page.element("pre", &crate::text(report));
    for outcome in OUTCOMES.into_iter().skip(1) {
        let failures: Vec<_> = rows.iter().filter(|row| row.outcome_name() == outcome).collect();
        if !failures.is_empty() {
            page.element("h2", &format!("{outcome} ({})", failures.len()));
        }
        for row in failures {
            let Row { world, seed, setting, reason, .. } = row;
            let caption = format!("{world}, seed {seed}, {setting}: {reason}");
            page.figure(&caption, &runner::picture(row));
        }
    }
    page.save()
}
