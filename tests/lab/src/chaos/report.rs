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
    /// Signals of each kind to each stage and the supervisor.
    kills: BTreeMap<&'static str, BTreeMap<Kind, u32>>,
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
    /// The table of signals; none if no results are written.
    signals: Option<Table<Row>>,
}

impl<'a> Series<'a> {
    pub fn new(options: &'a Options) -> Result<Self> {
        let out = options.asked.out.as_deref();
        Ok(Self {
            options,
            schedule: Schedule::new(options.asked.seed),
            report: Report::default(),
            signals: out.map(signals::create).transpose()?,
        })
    }

    /// Keep a signal whose measurement is complete.
    pub fn keep(&mut self, row: Row) -> Result {
        self.report.add_recovery(&row);
        self.signals.as_mut().map_or(Ok(()), |table| table.add(row))
    }

    pub fn is_over(&self) -> bool {
        self.report.signals() >= self.options.asked.kills
    }
}

impl Report {
    pub fn signals(&self) -> u32 {
        let consumers = self.consumers.values();
        let to_consumers: u32 = consumers.map(|counts| counts.killed + counts.frozen).sum();
        self.kills() + to_consumers
    }

    pub fn consumer(&mut self, name: &str) -> &mut ConsumerCounts {
        self.consumers.entry(name.to_owned()).or_default()
    }

    pub fn kills(&self) -> u32 {
        self.kills.values().flat_map(BTreeMap::values).sum()
    }

    pub fn hit(&mut self, stage: &'static str, kind: Kind) {
        *self.kills.entry(stage).or_default().entry(kind).or_default() += 1;
    }

    /// Count the times of a signal whose measurement is complete.
    pub fn add_recovery(&mut self, row: &Row) {
        let record = |histogram: &mut Histogram, ms: Option<f64>| {
            ms.into_iter().for_each(|ms| histogram.record((ms * 1e6) as u64));
        };
        if row.ready_ms.is_none() {
            return;
        }
        let recovery = self.recovery_ms.entry(row.stage.clone()).or_default();
        if row.kind == Kind::Freeze {
            record(&mut recovery.after_freeze, row.ready_ms);
        } else {
            record(&mut recovery.ready, row.ready_ms);
            record(&mut recovery.output, row.first_output_ms);
        }
    }

    pub fn judged(&self, json: bool) -> Result<Judged> {
        let moved = || format!("a pose {:.3} m worse than undisturbed", self.worst_pose_excess_m);
        Ok(Judged {
            tried: self.signals().into(),
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
