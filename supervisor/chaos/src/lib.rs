//! Random deaths of random stages at random times, and what became of the missions.
//!
//! - [`schedule`]: who, how and when.
//! - [`mission`]: one mission under attack.
//! - [`attack`], [`subscriptions`]: the attacker, and what it hears.
//! - [`report`]: the sum of them.

mod attack;
pub mod ipc_bench;
mod mission;
mod report;
mod schedule;
mod subscriptions;

use std::path::{Path, PathBuf};

use common::{bus::BusError, clock::Pace, domain::RobotName, mission::Mission};
use thiserror::Error;

pub use report::Report;
use schedule::Chance;
use supervisor::simulator::SimulatorError;

/// What to do to whom.
pub struct Options {
    /// The mission, by name or file.
    pub mission: String,
    /// The same, overrides and all.
    pub loaded: Mission,
    /// Overrides of it.
    pub set: Vec<String>,
    /// The robot that suffers.
    pub robot: RobotName,
    /// The missions' pace, on the wall clock.
    pub pace: Pace,
    /// Signals to send in all.
    pub kills: u32,
    /// Seed of who, how and when; the missions' seeds count up from it.
    pub seed: u64,
    /// Whether some signals hit a successor in its first milliseconds.
    pub startup: bool,
    /// Whether the supervisor is hit too; its run is resumed then. The robot is a process of its own in that case,
    /// as a real one is.
    pub supervisor: bool,
    /// Where the run directories go; emptied mission by mission.
    pub directory: PathBuf,
}

/// Why chaos ended early.
#[derive(Debug, Error)]
pub enum ChaosError {
    /// The bus.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The robot.
    #[error(transparent)]
    Simulator(#[from] SimulatorError),
    /// A process or a file.
    #[error("cannot {action}: {source}")]
    System {
        /// What was tried.
        action: &'static str,
        /// The system's word.
        source: std::io::Error,
    },
    /// A mission ended without a summary.
    #[error("a mission gave no summary: {0}")]
    NoSummary(String),
}

fn system(action: &'static str) -> impl FnOnce(std::io::Error) -> ChaosError {
    move |source| ChaosError::System { action, source }
}

/// Missions, one after the other, until enough signals were sent. `watch` is told after each.
pub fn run(options: &Options, watch: &mut dyn FnMut(&Report)) -> Result<Report, ChaosError> {
    let mut chance = Chance::new(options.seed);
    let mut report = Report::new();
    while report.kills() < options.kills {
        let seed = options.seed + report.missions();
        let calm = mission::undisturbed(options, seed)?;
        mission::attack(options, seed, &mut chance, &mut report, &calm)?;
        report.leftovers += leftovers(options);
        watch(&report);
    }
    report.end();
    Ok(report)
}

/// Files, shared memory and processes that outlived their mission.
fn leftovers(options: &Options) -> usize {
    let domain = common::domain::Domain::of(options.robot.clone());
    let prefix = domain.shared_memory_prefix();
    let shared = names(Path::new(common::domain::SHARED_MEMORY));
    let shared = shared.filter(|name| name.starts_with(&prefix)).count();
    let mark = options.directory.to_string_lossy().into_owned();
    let of_ours = |pid: &String| {
        pid.bytes().all(|byte| byte.is_ascii_digit())
            && pid.parse() != Ok(std::process::id())
            && std::fs::read(format!("/proc/{pid}/cmdline"))
                .is_ok_and(|line| String::from_utf8_lossy(&line).contains(&mark))
    };
    let processes = names(Path::new("/proc")).filter(of_ours).count();
    shared + processes + usize::from(domain.directory().exists())
}

/// Names of what is in a directory.
fn names(directory: &Path) -> impl Iterator<Item = String> {
    let entries = std::fs::read_dir(directory).into_iter().flatten().flatten();
    entries.map(|entry| entry.file_name().to_string_lossy().into_owned())
}
