//! The result of all missions under attack.

use std::{collections::BTreeMap, fmt};

use common::latency::Histogram;
use serde::{Serialize, Serializer};

use crate::chaos::{
    Judged, changes::Changes, kind::Kind, replays::Replays, signals::Row,
    tick_latencies::TickLatencies,
};
use crate::missions::statistics::rounded;
use mission_control::outcome::Outcome;

/// The name for supervisor and stages together.
pub const EVERYTHING: &str = "everything";

/// The result of all missions under attack.
#[derive(Debug, Default, Serialize)]
pub struct Report {
    pub missions: u64,
    reached: u64,
    collisions: u64,
    /// Missions that did not reach the target, touched something or lost the pose: seeds and reasons.
    wrong: Vec<String>,
    /// Stages that the supervisor aborted as hung although no signal had frozen them, or one had frozen all processes.
    healthy_aborted: u64,
    /// Signals of each kind to stages and supervisor, of all and of each.
    kinds: BTreeMap<Kind, u32>,
    kills: BTreeMap<&'static str, BTreeMap<Kind, u32>>,
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    consumers: BTreeMap<String, ConsumerCounts>,
    recovery_ms: BTreeMap<String, Recovery>,
    /// Largest pose error at the end beyond the same seed's undisturbed run, metres.
    worst_pose_excess_m: f64,
    /// Files, shared memory and processes that outlived a mission.
    pub leftovers: usize,
    /// These leftovers, with the missions that left them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    left_behind: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub replays: Option<Replays>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub targets: Option<Changes>,
    /// Ticks with and without consumers, if nothing else is hit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tick_latencies: Option<TickLatencies>,
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

#[derive(Debug)]
pub struct End {
    pub seed: u64,
    pub outcome: Outcome,
    pub reason: String,
    pub collisions: u64,
    pub pose_excess_m: f64,
    pub pose_allowance_m: f64,
    /// Stages aborted as hung that were not frozen alone.
    pub healthy_aborted: Vec<String>,
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
        self.kinds.values().sum()
    }

    pub fn hit(&mut self, stage: &'static str, kind: Kind) {
        *self.kinds.entry(kind).or_default() += 1;
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

    /// Count a mission. Returns whether it reached the target without a contact, and knew its pose.
    pub fn add_mission(&mut self, end: &End) -> bool {
        self.missions += 1;
        self.collisions += end.collisions;
        self.worst_pose_excess_m = self.worst_pose_excess_m.max(end.pose_excess_m);
        let reached = matches!(end.outcome, Outcome::Reached | Outcome::ReachedUnsure);
        self.reached += u64::from(reached);
        let (seed, excess, allowance) = (end.seed, end.pose_excess_m, end.pose_allowance_m);
        let before = self.wrong.len();
        if !reached {
            let (outcome, reason) = (end.outcome.as_str(), &end.reason);
            self.wrong.push(format!("seed {seed}: {outcome}: {reason}"));
        }
        if end.collisions > 0 {
            self.wrong.push(format!("seed {seed}: touched something {} times", end.collisions));
        }
        self.healthy_aborted += end.healthy_aborted.len() as u64;
        for stage in &end.healthy_aborted {
            self.wrong.push(format!("seed {seed}: aborted although healthy: {stage}"));
        }
        if excess > allowance {
            self.wrong.push(format!(
                "seed {seed}: pose off by {excess:.4} m more than undisturbed, of {allowance:.4} m allowed"
            ));
        }
        self.wrong.len() == before
    }

    /// Whether every mission reached the target without a contact and knew its pose. The files of other missions stay.
    pub fn is_right(&self) -> bool {
        let replayed = self.replays.as_ref().is_none_or(Replays::all_equal);
        let told = self.targets.as_ref().is_none_or(Changes::is_right);
        self.wrong.is_empty() && replayed && told
    }

    pub fn judged(&self) -> Judged {
        let replays = self.replays.as_ref().map_or(&[][..], Replays::wrong);
        let targets = self.targets.as_ref().map_or(&[][..], Changes::wrong);
        let mut lost = [&self.wrong[..], replays, targets, &self.left_behind].into_iter().flatten();
        let count = self.wrong.len() + replays.len() + targets.len() + self.leftovers;
        let moved = || format!("a pose {:.3} m worse than undisturbed", self.worst_pose_excess_m);
        Judged {
            tried: self.signals().into(),
            lost: count as u64 + self.healthy_aborted,
            worst: lost.next().cloned().unwrap_or_else(moved),
        }
    }

    pub fn left_behind(&mut self, found: &[String]) {
        self.leftovers += found.len();
        let missions = self.missions;
        self.left_behind.extend(found.iter().map(|what| format!("by mission {missions}: {what}")));
    }

    pub fn is_clean(&self) -> bool {
        self.is_right() && self.leftovers == 0
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
