//! Results of the experiments as JSON objects, and their page.

use serde_json::{Value, json};

use super::{
    FIRST_SEED,
    table::{Claim, Experiment, METHODS, claims},
};
use crate::{
    error::Result,
    missions::{
        page::Page,
        results::Results,
        row::{Outcome, Row, spread},
        runner::picture,
        statistics::share,
    },
};

const FIGURES: [&str; 7] = [
    "time_s",
    "path_m",
    "k",
    "clearance_m",
    "safety_events",
    "sonar_unavailable",
    "wheel_range_rad_s",
];

pub fn report(experiments: &[Experiment], rows: &[Row]) -> Result<Vec<Value>> {
    let claims = claims()?;
    let its = |experiment: &str, method: &str| -> Vec<&Row> {
        rows.iter().filter(|row| row.world == experiment && row.setting == method).collect()
    };
    let object = |Experiment { name, title, reported, reported_time_s, .. }: &Experiment| {
        let mut object = json!({ "experiment": name, "title": title, "reported": reported });
        if let Some(time_s) = reported_time_s {
            object["reported_time_s"] = (*time_s).into();
        }
        let mut expectations = Vec::new();
        for (method, _) in METHODS {
            let rows = its(name, method);
            let own = claims.iter().filter(|claim| claim.experiment == *name);
            expectations.extend(own.filter_map(|claim| {
                let Claim { claim, figure, over, least, most, .. } = claim;
                let mut found = value(&rows, figure)?;
                if let Some(over) = over {
                    found /= value(&its(over, method), figure).filter(|&value| value != 0.0)?;
                }
                let holds = (*least..=*most).contains(&found);
                Some(json!({ "method": method, "claim": claim, "found": found, "holds": holds }))
            }));
            if !rows.is_empty() {
                object[method] = findings(&rows);
            }
        }
        object["expectations"] = expectations.into();
        object
    };
    Ok(experiments.iter().map(object).collect())
}

fn findings(rows: &[&Row]) -> Value {
    let [arrived, touched, wrong_place] =
        [Outcome::Success, Outcome::Collision, Outcome::WrongPlace].map(|it| count(rows, it));
    let [_, low, high] = share(arrived, rows.len());
    let mut object = json!({
        "count": rows.len(),
        "arrived": arrived,
        "arrival_interval": [low, high],
        "touched": touched,
        "wrong_place": wrong_place,
        "others": rows.len() - arrived - touched - wrong_place,
    });
    for figure in FIGURES {
        if let Some(spread) = spread(rows, figure) {
            object[figure] = json!(spread);
        }
    }
    object
}

fn count(rows: &[&Row], outcome: Outcome) -> usize {
    rows.iter().filter(|row| row.outcome == outcome).count()
}

/// Returns the median of a figure, or the share that `arrived`.
fn value(rows: &[&Row], figure: &str) -> Option<f64> {
    if figure == "arrived" {
        return Some(count(rows, Outcome::Success) as f64 / rows.len() as f64)
            .filter(|share| share.is_finite());
    }
    Some(spread(rows, figure)?.median)
}

pub fn save_page(results: &Results, experiments: &[Experiment], report: &[Value]) -> Result {
    let mut page = Page::new("The paper's experiments", results);
    for (Experiment { name, title, reported, .. }, object) in experiments.iter().zip(report) {
        page.element("h2", &format!("{name}: {title}"));
        page.element("p", &format!("The paper: {reported}."));
        page.element("pre", &crate::text(object));
        for row in results.rows.rows.iter().filter(|row| row.world == *name) {
            if row.seed == FIRST_SEED || !row.is_success() {
                let Row { setting, seed, .. } = row;
                let caption = format!("{setting}, seed {seed}: {}", row.outcome_name());
                page.figure(&caption, &picture(row));
            }
        }
    }
    page.save()
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
            let known = figure == "arrived" || FIGURES.contains(&&*figure);
            assert!(known, "{figure}");
        }
    }
}
