//! The result of all missions under attack.

use std::{collections::BTreeMap, fmt};

use common::latency::Histogram;
use serde::{Serialize, Serializer};

use super::{
    Judged,
    changes::Changes,
    options::Options,
    replays::Replays,
    schedule::{Kind, Schedule},
    signals::{self, Row},
};
use crate::{
    error::Result,
    missions::{results::Table, statistics::rounded},
};

/// The name for supervisor and stages together.
pub const EVERYTHING: &str = "everything";

/// The result of all missions under attack.
#[derive(Debug, Default, Serialize)]
pub struct Report {
    pub missions: u64,
    pub reached: u64,
    pub collisions: u64,
    /// Missions that did not reach the target, touched something, lost the pose, did not tell of a target or were not replayed to the
    /// bit: seeds and reasons.
    pub wrong: Vec<String>,
    /// Signals that were sent, to consumers too.
    #[serde(skip)]
    pub signals: u32,
    /// Signals of each kind to each stage and the supervisor.
    kills: BTreeMap<String, BTreeMap<Kind, u32>>,
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    consumers: BTreeMap<String, ConsumerCounts>,
    recovery_ms: BTreeMap<String, Recovery>,
    /// Largest pose error at the end beyond the same seed's undisturbed run, metres.
    pub worst_pose_excess_m: f64,
    /// Files, shared memory and processes that outlived a mission.
    pub leftovers: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub replays: Option<Replays>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub targets: Option<Changes>,
    pub took_s: f64,
}

#[derive(Debug, Default, Serialize)]
pub struct ConsumerCounts {
    pub killed: u32,
    pub frozen: u32,
    pub started: u32,
    /// Times the consumer ended without a signal of chaos.
    pub ended_by_itself: u32,
    /// The last such end, and the last line of its standard error.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub last_end: Option<String>,
}

/// Times from the signal to the successor.
#[derive(Debug, Default, Serialize)]
pub struct Recovery {
    /// The time to the first ready beat, after kills: a death is noticed at once.
    #[serde(serialize_with = "quantiles")]
    pub ready: Histogram,
    /// The time to the first ready beat, after freezes, which are noticed by missing beats.
    #[serde(rename = "ready_when_frozen", serialize_with = "quantiles")]
    pub after_freeze: Histogram,
    /// The time to the first sample of a tick, which may come up to a tick later.
    #[serde(serialize_with = "quantiles")]
    pub output: Histogram,
}

/// The state that the missions of one chaos share.
pub struct Series<'a> {
    pub options: &'a Options,
    pub schedule: Schedule,
    pub report: Report,
    signals: Table<Row>,
}

impl<'a> Series<'a> {
    pub fn new(options: &'a Options) -> Result<Self> {
        Ok(Self {
            options,
            schedule: Schedule::new(options.asked.seed),
            report: Report::default(),
            signals: signals::create(options.asked.out.as_ref().unwrap_or(&options.directory))?,
        })
    }

    /// Keep a signal whose measurement is complete.
    pub fn keep(&mut self, row: Row) -> Result {
        self.report.add(&row);
        self.signals.add(row)
    }

    pub fn is_over(&self) -> bool {
        self.report.signals >= self.options.asked.kills
    }
}

impl Report {
    pub fn consumer(&mut self, name: &str) -> &mut ConsumerCounts {
        self.consumers.entry(name.to_owned()).or_default()
    }

    /// Signals to stages and the supervisor whose measurement is complete.
    pub fn kills(&self) -> u32 {
        self.kills.values().flat_map(BTreeMap::values).sum()
    }

    /// Count a signal whose measurement is complete.
    fn add(&mut self, row: &Row) {
        let Row { stage, kind, ready_ms, first_output_ms, .. } = row;
        *match self.consumers.get_mut(stage) {
            Some(counts) if *kind == Kind::Freeze => &mut counts.frozen,
            Some(counts) => &mut counts.killed,
            None => self.kills.entry(stage.clone()).or_default().entry(*kind).or_default(),
        } += 1;
        if let Some(ready_ms) = ready_ms {
            let recovery = self.recovery_ms.entry(stage.clone()).or_default();
            let record = |histogram: &mut Histogram, ms: &f64| histogram.record((ms * 1e6) as u64);
            if *kind == Kind::Freeze {
                record(&mut recovery.after_freeze, ready_ms);
            } else {
                record(&mut recovery.ready, ready_ms);
                first_output_ms.iter().for_each(|ms| record(&mut recovery.output, ms));
            }
        }
    }

    pub fn judged(&self, json: bool) -> Result<Judged> {
        let moved = || format!("a pose {:.3} m worse than undisturbed", self.worst_pose_excess_m);
        Ok(Judged {
            tried: self.signals.into(),
            lost: (self.wrong.len() + self.leftovers.len()) as u64,
            worst: self.wrong.iter().chain(&self.leftovers).next().cloned().unwrap_or_else(moved),
            text: super::text(self, json)?,
        })
    }
}

/// Median, 99 % quantile and maximum in milliseconds; nothing if nothing was measured.
fn quantiles<S: Serializer>(histogram: &Histogram, to: S) -> Result<S::Ok, S::Error> {
    let us = [0.5, 0.99, 1.0].into_iter().filter_map(|share| histogram.quantile_us(share));
    us.map(|us| rounded(us / 1e3)).collect::<Vec<_>>().serialize(to)
}

impl fmt::Display for Report {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str(&crate::text(self))
    }
}
