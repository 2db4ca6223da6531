//! The result of all missions under attack.

use std::{collections::BTreeMap, fmt};

use common::{latency::Histogram, topics::SUPERVISOR};
use console::table::Table;
use serde::{Serialize, Serializer};
use summary::Quantiles;

use crate::chaos::{
    changes::Changes, kind::Kind, replays::Replays, resources::Resources, signals::Row,
    tick_latencies::TickLatencies,
};
use mission_control::outcome::Outcome;
use processes::stages::TABLE;

/// The name for supervisor and stages together.
pub const EVERYTHING: &str = "everything";

const NAMED: usize = 20;

/// The result of all missions under attack.
#[derive(Debug, Default, Serialize)]
pub struct Report {
    missions: u64,
    reached: u64,
    collisions: u64,
    /// Missions that did not reach the target, touched something or lost the pose: seeds and reasons.
    wrong: Vec<String>,
    /// Stages that the supervisor aborted as hung although no signal had frozen them, or one had frozen all processes.
    healthy_aborted: u64,
    kills: BTreeMap<&'static str, BTreeMap<Kind, u32>>,
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    consumers: BTreeMap<String, ConsumerCounts>,
    recovery_us: BTreeMap<String, Recovery>,
    /// Largest pose error at the end beyond the same seed's undisturbed run, metres, and the signals of that mission.
    worst_pose_excess_m: f64,
    worst_pose_kills: u32,
    /// Longest time that a wheel turned after the last command the robot had received, mission seconds.
    longest_stopping_time_s: f64,
    /// Files, shared memory and processes that outlived a mission.
    pub leftovers: usize,
    /// The first leftovers, with the missions that left them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    left_behind: Vec<String>,
    /// Largest growth of a supervisor's resources from its robot's departure to its end.
    supervisor_growth: Resources,
    #[serde(skip_serializing_if = "Option::is_none")]
    replays: Option<Replays>,
    #[serde(skip_serializing_if = "Option::is_none")]
    targets: Option<Changes>,
    /// Ticks with and without consumers, if nothing else is hit.
    #[serde(skip_serializing_if = "Option::is_none")]
    tick_latencies: Option<TickLatencies>,
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

impl fmt::Display for ConsumerCounts {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { killed, frozen, started, ended_by_itself, last_end } = self;
        write!(
            to,
            "{killed} killed, {frozen} frozen, {started} started, {ended_by_itself} ended by themselves"
        )?;
        match last_end {
            Some(last) => write!(to, " ({last})"),
            None => Ok(()),
        }
    }
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
    pub stopping_time_s: f64,
    pub kills: u32,
    /// Stages aborted as hung that were not frozen alone.
    pub healthy_aborted: Vec<String>,
}

impl Report {
    pub const fn missions(&self) -> u64 {
        self.missions
    }

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
        let recovery = self.recovery_us.entry(row.stage.clone()).or_default();
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
        self.longest_stopping_time_s = self.longest_stopping_time_s.max(end.stopping_time_s);
        if end.pose_excess_m > self.worst_pose_excess_m {
            self.worst_pose_excess_m = end.pose_excess_m;
            self.worst_pose_kills = end.kills;
        }
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

    pub fn replays(&mut self) -> &mut Replays {
        self.replays.get_or_insert_default()
    }

    pub fn targets(&mut self) -> &mut Changes {
        self.targets.get_or_insert_default()
    }

    pub fn tick_latencies(&mut self) -> &mut TickLatencies {
        self.tick_latencies.get_or_insert_default()
    }

    /// Count the growth of a supervisor that held `first` when its robot began to drive, and `last` at its end.
    pub fn add_growth(&mut self, first: Resources, last: Resources) {
        let most = &mut self.supervisor_growth;
        most.descriptors = most.descriptors.max(last.descriptors - first.descriptors);
        most.memory_kib = most.memory_kib.max(last.memory_kib - first.memory_kib);
    }

    /// Whether every mission reached the target without a contact and knew its pose. The files of other missions stay.
    pub fn is_right(&self) -> bool {
        let replayed = self.replays.as_ref().is_none_or(Replays::all_equal);
        let told = self.targets.as_ref().is_none_or(Changes::is_right);
        self.wrong.is_empty() && replayed && told
    }

    pub fn left_behind(&mut self, found: Vec<String>) {
        self.leftovers += found.len();
        let missing = NAMED.saturating_sub(self.left_behind.len());
        let missions = self.missions;
        let named = found.into_iter().take(missing);
        let named = named.map(|what| format!("by mission {missions}: {what}"));
        self.left_behind.extend(named);
    }

    pub fn is_clean(&self) -> bool {
        self.is_right() && self.leftovers == 0
    }
}

fn quantiles<S: Serializer>(histogram: &Histogram, to: S) -> Result<S::Ok, S::Error> {
    Quantiles::from(histogram).serialize(to)
}

/// The quantiles in milliseconds.
fn ms(histogram: &Histogram) -> String {
    let quantiles = [0.5, 0.99, 1.0].map(|share| histogram.quantile_us(share));
    let ms = quantiles.iter().flatten().map(|us| format!("{:.1}", us / 1e3));
    ms.collect::<Vec<_>>().join(" ")
}

impl fmt::Display for Report {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            to,
            "{} signals in {} missions, {:.0} s: {} reached, {} collisions, {} healthy stages aborted, {} leftovers",
            self.signals(),
            self.missions,
            self.took_s,
            self.reached,
            self.collisions,
            self.healthy_aborted,
            self.leftovers
        )?;
        for wrong in &self.wrong {
            writeln!(to, "  {wrong}")?;
        }
        for left in &self.left_behind {
            writeln!(to, "  left behind {left}")?;
        }
        let mut table =
            Table::new(["stage", ">hit", ">ready, ms", ">frozen, ms", ">a tick's output, ms"]);
        let nothing = Recovery::default();
        let stages = TABLE.iter().map(|stage| stage.name);
        let hit_supervisor = self.kills.contains_key(SUPERVISOR).then_some(SUPERVISOR);
        for name in stages.chain(hit_supervisor) {
            let hit: u32 = self.kills.get(name).map_or(0, |kinds| kinds.values().sum());
            let Recovery { ready, after_freeze, output } =
                self.recovery_us.get(name).unwrap_or(&nothing);
            table.row([&name, &hit, &ms(ready), &ms(after_freeze), &ms(output)]);
        }
        write!(to, "{table}")?;
        let mut kinds: BTreeMap<Kind, u32> = BTreeMap::new();
        for (&kind, &count) in self.kills.values().flatten() {
            *kinds.entry(kind).or_default() += count;
        }
        let kinds: Vec<_> =
            kinds.iter().map(|(kind, count)| format!("{count} {}", kind.as_str())).collect();
        writeln!(to, "(p50, p99, max) {}", kinds.join(", "))?;
        for (name, counts) in &self.consumers {
            writeln!(to, "consumer {name}: {counts}")?;
        }
        writeln!(
            to,
            "pose error beyond the undisturbed run at most {:.4} m ({} signals in that mission)",
            self.worst_pose_excess_m, self.worst_pose_kills
        )?;
        writeln!(
            to,
            "a wheel turned at most {:.2} s of mission time after the last command",
            self.longest_stopping_time_s
        )?;
        let Resources { descriptors, memory_kib } = self.supervisor_growth;
        writeln!(
            to,
            "a supervisor grew by at most {descriptors} descriptors and {memory_kib} KiB"
        )?;
        if let Some(targets) = &self.targets {
            writeln!(to, "{targets}")?;
        }
        if let Some(ticks) = &self.tick_latencies {
            writeln!(to, "{ticks}")?;
        }
        match &self.replays {
            Some(replays) => write!(to, "{replays}"),
            None => Ok(()),
        }
    }
}
