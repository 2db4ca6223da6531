//! The result of each setting over all its missions, and the differences of two settings on the same missions.

use std::{collections::BTreeMap, fmt};

use serde_json::{Value, json};

use crate::missions::{
    row::{Outcome, Row},
    statistics::{Estimate, mean, median, paired_difference, share},
};

#[derive(Clone, Debug)]
pub struct Totals {
    pub setting: String,
    pub count: usize,
    /// Shares of all missions, in the order of [`Outcome::ALL`].
    pub shares: [Estimate; Outcome::ALL.len()],
    metrics: [Option<f64>; METRICS.len()],
}

/// A metric beside the shares: key, name, digits, the missions it is of, and its value of one.
type Metric = (&'static str, &'static str, usize, Missions, fn(&Row) -> Option<f64>);

enum Missions {
    /// The median of the successes.
    Successes,
    /// The mean of all.
    All,
}

const METRICS: [Metric; 9] = [
    ("median_time_s", "median time, s", 1, Missions::Successes, |row| Some(row.time_s)),
    ("median_k", "median K", 2, Missions::Successes, |row| Some(row.k)),
    ("spl", "SPL", 3, Missions::All, |row| Some(row.spl)),
    ("barn_score", "BARN score", 3, Missions::All, |row| row.barn_score),
    ("median_clearance_m", "median least clearance, m", 3, Missions::Successes, |row| {
        row.min_clearance_m
    }),
    ("median_p_o", "median p_o", 3, Missions::Successes, |row| row.p_o),
    ("median_f_ps_m2", "median f_ps, m2", 4, Missions::Successes, |row| row.f_ps_m2),
    ("median_f_vs_m_s2", "median f_vs, m/s2", 3, Missions::Successes, |row| row.f_vs_m_s2),
    ("median_look_share", "median share of looking", 3, Missions::Successes, |row| {
        Some(row.look_s / row.time_s.max(1e-9))
    }),
];

impl Totals {
    pub fn of(setting: &str, rows: &[Row]) -> Self {
        let rows: Vec<&Row> = rows.iter().filter(|row| row.setting == setting).collect();
        let ended = |outcome| rows.iter().filter(move |row| row.outcome == outcome);
        Self {
            setting: setting.to_owned(),
            count: rows.len(),
            shares: Outcome::ALL.map(|outcome| share(ended(outcome).count(), rows.len())),
            metrics: METRICS.map(|(_, _, _, of, value)| match of {
                Missions::Successes => median(ended(Outcome::Success).filter_map(|row| value(row))),
                Missions::All => mean(rows.iter().filter_map(|row| value(row))),
            }),
        }
    }

    pub fn object(&self) -> Value {
        let mut object = json!({ "setting": self.setting, "count": self.count });
        for (outcome, share) in Outcome::ALL.iter().zip(&self.shares) {
            object[outcome.as_str()] = share.value.into();
        }
        for ((key, ..), value) in METRICS.iter().zip(self.metrics) {
            object[*key] = value.into();
        }
        object
    }

    /// Name, value and digits of the metrics that are known.
    pub fn metrics(&self) -> impl Iterator<Item = (&'static str, f64, usize)> {
        let known = METRICS.iter().zip(self.metrics);
        known.filter_map(|((_, name, digits, ..), value)| Some((*name, value?, *digits)))
    }
}

/// The differences of the second setting from the first on the same worlds with the same noise.
#[derive(Clone, Debug)]
pub struct Comparison {
    pub from: String,
    pub to: String,
    pub pairs: usize,
    pub success: Estimate,
    pub collision: Estimate,
    /// Median ratio of the second's time to the first's, over missions in which both succeeded.
    pub time_ratio: Option<f64>,
}

impl Comparison {
    pub fn of(from: &str, to: &str, rows: &[Row]) -> Self {
        let key = |row: &Row| (row.world.clone(), row.seed);
        let of = |setting: &str| -> BTreeMap<_, &Row> {
            let rows = rows.iter().filter(|row| row.setting == setting);
            rows.map(|row| (key(row), row)).collect()
        };
        let (first, second) = (of(from), of(to));
        let pairs: Vec<(&Row, &Row)> =
            first.iter().filter_map(|(key, row)| Some((*row, *second.get(key)?))).collect();
        let change = |outcome: Outcome| {
            let only = |has: fn(&(&Row, &Row)) -> (Outcome, Outcome)| {
                let has_it = pairs.iter().map(has);
                let differ = has_it.filter(|&(a, b)| a == outcome && b != outcome);
                differ.count()
            };
            let gained = only(|pair| (pair.1.outcome, pair.0.outcome));
            let lost = only(|pair| (pair.0.outcome, pair.1.outcome));
            paired_difference(gained, lost, pairs.len())
        };
        let both = pairs
            .iter()
            .filter(|(a, b)| a.outcome == Outcome::Success && b.outcome == Outcome::Success);
        Self {
            from: from.to_owned(),
            to: to.to_owned(),
            pairs: pairs.len(),
            success: change(Outcome::Success),
            collision: change(Outcome::Collision),
            time_ratio: median(both.map(|(a, b)| b.time_s / a.time_s.max(1e-9))),
        }
    }
}

impl fmt::Display for Estimate {
    /// Write the estimate, for example as `.620 [.564, .673]`, or with signs as `{:+}`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { value, low, high } = self;
        if f.sign_plus() {
            write!(f, "{value:+.3} [{low:+.3}, {high:+.3}]")
        } else {
            write!(f, "{value:.3} [{low:.3}, {high:.3}]")
        }
    }
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} against {}, {} pairs: success {:+}, collision {:+}",
            self.to, self.from, self.pairs, self.success, self.collision
        )?;
        match self.time_ratio {
            Some(ratio) => write!(f, ", time x {ratio:.2}"),
            None => Ok(()),
        }
    }
}
