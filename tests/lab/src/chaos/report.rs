//! Result of all missions under attack, and its table `signals.csv`.
//!
//! A row is written once its signal and all earlier ones are measured.

use std::{
    collections::BTreeMap,
    env, fs,
    path::{Path, PathBuf},
    process,
    time::Instant,
};

use common::{latency::Histogram, mission::Mission};
use console::missions;
use serde::{Deserialize, Serialize, Serializer};

use super::{
    options::Arguments,
    replays::Replays,
    schedule::{Kind, Schedule},
};
use crate::{
    error::{OrCannot as _, Result},
    missions::{results::Table, statistics::rounded},
};

const FILE_NAME: &str = "signals.csv";

#[derive(Default, Serialize)]
pub struct Report {
    pub missions: u64,
    pub reached: u64,
    pub collisions: u64,
    /// Failed missions with seeds and reasons.
    pub wrong: Vec<String>,
    #[serde(skip)]
    pub signals: u32,
    kills: BTreeMap<String, BTreeMap<Kind, u32>>,
    /// By consumer: how often it was killed, frozen and started, and ended by itself.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    consumers: BTreeMap<String, BTreeMap<&'static str, u32>>,
    /// Last end by itself of each consumer, and the last line of its standard error.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub last_ends: BTreeMap<String, String>,
    /// By stage, delays of successors: until the first ready beat after kills, which are noticed at
    /// once, and after freezes, which are noticed by missing beats; until the first sample of a
    /// tick, which may come up to a tick later.
    recovery_ms: BTreeMap<String, BTreeMap<&'static str, Delays>>,
    /// Maximum final pose error beyond the same seed's undisturbed run.
    pub worst_pose_excess_m: f64,
    pub leftovers: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub replays: Option<Replays>,
}

#[derive(Default)]
struct Delays(Histogram);

pub struct Series {
    pub asked: Arguments,
    pub loaded: Mission,
    /// Parent of the run directories, emptied after each mission.
    pub directory: PathBuf,
    pub schedule: Schedule,
    /// Time of the next signal; an overdue one waits until the robot drives.
    pub next_hit: Instant,
    pub report: Report,
    signals: Table<Row>,
}

impl Series {
    /// Creates a new directory for the missions. Fails for an unsuitable mission.
    pub fn new(asked: &Arguments) -> Result<Self> {
        let mut asked = asked.clone();
        if asked.freeze_all {
            // The robot's clock continues during a freeze. A user's --set comes later and wins.
            asked.set.insert(0, "timeout_s=1800".to_owned());
        }
        let loaded = missions::load(&asked.mission, &asked.set)?;
        if loaded.robot.address.is_some() {
            return Err("chaos simulates its own robot; remove robot.address".into());
        }
        let name = format!("firsthand-chaos-{}-{}", process::id(), asked.robot);
        let directory = env::temp_dir().join(name);
        let signals = create(asked.out.as_ref().unwrap_or(&directory))?;
        fs::create_dir_all(&directory).or_cannot_file("make", &directory)?;
        Ok(Self {
            schedule: Schedule::new(asked.seed),
            next_hit: Instant::now(),
            report: Report::default(),
            asked,
            loaded,
            directory,
            signals,
        })
    }

    pub fn keep(&mut self, row: Row) -> Result {
        self.report.add(&row);
        self.signals.add(row)
    }

    pub fn is_over(&self) -> bool {
        self.report.signals >= self.asked.kills
    }
}

impl Report {
    pub fn count(&mut self, consumer: &str, what: &'static str) {
        *self.consumers.entry(consumer.to_owned()).or_default().entry(what).or_default() += 1;
    }

    pub fn kills(&self) -> u32 {
        self.kills.values().flat_map(BTreeMap::values).sum()
    }

    fn add(&mut self, row: &Row) {
        let Row { ref stage, kind, ready_ms, first_output_ms, .. } = *row;
        if self.consumers.contains_key(stage) {
            self.count(stage, if kind == Kind::Freeze { "frozen" } else { "killed" });
        } else {
            *self.kills.entry(stage.clone()).or_default().entry(kind).or_default() += 1;
        }
        let measured = match kind {
            Kind::Freeze => [("ready_when_frozen", ready_ms), ("output", None)],
            _ => [("ready", ready_ms), ("output", first_output_ms)],
        };
        for (name, ms) in measured {
            if let Some(ms) = ms {
                let delays = self.recovery_ms.entry(stage.clone()).or_default();
                delays.entry(name).or_default().0.record((ms * 1e6) as u64);
            }
        }
    }
}

/// Median, 99 % quantile and maximum in milliseconds.
impl Serialize for Delays {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let us = [0.5, 0.99, 1.0].into_iter().filter_map(|share| self.0.quantile_us(share));
        to.collect_seq(us.map(|us| rounded(us / 1e3)))
    }
}

/// Signal; unmeasured values are empty cells. Delays count from the signal.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Row {
    pub mission: u64,
    /// Mission time of the newest wheel sample read before the signal.
    pub time_s: Option<f64>,
    pub stage: String,
    pub kind: Kind,
    /// Generation; for the supervisor and a consumer, its number of starts in that mission. None for
    /// everything.
    pub generation: Option<u32>,
    /// Whether the hit was due in the process's first milliseconds.
    pub start_up: bool,
    /// Until the record of the death was read; only for stages.
    pub noticed_ms: Option<f64>,
    /// Until the successor's first sign of work; only for stages and the supervisor.
    pub ready_ms: Option<f64>,
    /// Until the successor's first sample of a tick; only for stages and the supervisor.
    pub first_output_ms: Option<f64>,
}

pub fn ms_since(at: Instant) -> f64 {
    rounded(at.elapsed().as_secs_f64() * 1e3)
}

fn create(directory: &Path) -> Result<Table<Row>> {
    let path = directory.join(FILE_NAME);
    fs::create_dir_all(directory).or_cannot_file("make the directory of", &path)?;
    if path.exists() {
        return Err(format!("{} exists; give another directory", path.display()).into());
    }
    Table::open(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_of_signals_is_not_written_over() {
        let folder = tempfile::tempdir().unwrap();
        let directory = folder.path().join("results");
        create(&directory).unwrap();
        let refused = create(&directory).unwrap_err().to_string();
        let file = directory.join(FILE_NAME);
        assert!(refused.contains(file.to_str().unwrap()), "{refused}");
    }
}
