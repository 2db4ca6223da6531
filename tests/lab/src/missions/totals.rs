//! The result of each setting over all its missions, and the differences of two settings on the same missions.

use std::{collections::BTreeMap, fmt};

use serde::Serialize;

use crate::missions::{
    row::{Outcome, Row},
    statistics::{Estimate, mean, median, paired_difference, share},
};

/// The totals of one setting. Rates are shares of all missions; medians are over the successes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Totals {
    pub setting: String,
    pub count: usize,
    pub success: f64,
    pub collision: f64,
    pub timeout: f64,
    /// Share that reported an arrival in a wrong place.
    pub wrong_place: f64,
    /// Share that gave up although a path exists.
    pub unreachable: f64,
    pub aborted: f64,
    /// Median time of the successes, mission seconds.
    pub median_time_s: Option<f64>,
    /// Median K of the successes.
    pub median_k: Option<f64>,
    pub spl: Option<f64>,
    /// Mean BARN score of all; none if it does not apply.
    pub barn_score: Option<f64>,
    /// Median of the least clearance of the successes, metres.
    pub median_clearance_m: Option<f64>,
    /// Medians of MRPB's metrics over the successes.
    pub median_p_o: Option<f64>,
    pub median_f_ps_m2: Option<f64>,
    pub median_f_vs_m_s2: Option<f64>,
    /// Median share of the time spent looking.
    pub median_look_share: Option<f64>,
    #[serde(skip)]
    shares: BTreeMap<Outcome, Estimate>,
}

impl Totals {
    pub fn of(setting: &str, rows: &[Row]) -> Self {
        let rows: Vec<&Row> = rows.iter().filter(|row| row.setting == setting).collect();
        let successes = || {
            let rows = rows.iter().copied();
            rows.filter(|row| row.outcome == Outcome::Success)
        };
        let estimate = |outcome: Outcome| {
            let hits = rows.iter().filter(|row| row.outcome == outcome).count();
            (outcome, share(hits, rows.len()))
        };
        let shares: BTreeMap<_, _> = Outcome::ALL.into_iter().map(estimate).collect();
        let rate = |outcome| shares.get(&outcome).map_or(0.0, |estimate| estimate.value);
        Self {
            setting: setting.to_owned(),
            count: rows.len(),
            success: rate(Outcome::Success),
            collision: rate(Outcome::Collision),
            timeout: rate(Outcome::Timeout),
            wrong_place: rate(Outcome::WrongPlace),
            unreachable: rate(Outcome::Unreachable),
            aborted: rate(Outcome::Aborted),
            median_time_s: median(successes().map(|row| row.time_s)),
            median_k: median(successes().map(|row| row.k)),
            spl: mean(rows.iter().map(|row| row.spl)),
            barn_score: mean(rows.iter().filter_map(|row| row.barn_score)),
            median_clearance_m: median(successes().filter_map(|row| row.min_clearance_m)),
            median_p_o: median(successes().filter_map(|row| row.p_o)),
            median_f_ps_m2: median(successes().filter_map(|row| row.f_ps_m2)),
            median_f_vs_m_s2: median(successes().filter_map(|row| row.f_vs_m_s2)),
            median_look_share: median(successes().map(|row| row.look_s / row.time_s.max(1e-9))),
            shares,
        }
    }

    pub fn share(&self, outcome: Outcome) -> Option<Estimate> {
        self.shares.get(&outcome).copied()
    }
}

/// The differences of the second setting from the first on the same worlds with the same noise.
#[derive(Clone, Debug)]
pub struct Comparison {
    pub from: String,
    pub to: String,
    /// Missions that both settings have.
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
