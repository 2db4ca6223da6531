//! The state from which another supervisor resumes a run whose supervisor ended.
//!
//! The stages and the simulated robot have checkpoints of their own; this is the supervisor's. Mission time stands still
//! without a supervisor, and so does the robot.

use std::{fs, path::Path};

use common::{
    checkpoint::{Checkpoint, CheckpointError},
    clock::{MissionClock, MissionTime, Pace, boot_ns, monotonic_ns},
    run::{self, Run, RunError},
};
use dead_reckoning::saved_state;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::target_list::TargetList;

/// Room for the encoded [`SupervisorState`], bytes: its targets and their results take under 10,000.
const CAPACITY: usize = 12 << 10;
const BOOT_ID: &str = "/proc/sys/kernel/random/boot_id";
/// The summary of a run that ended, in its run directory.
pub const SUMMARY: &str = "summary.json";
const SIMULATOR: &str = "x80-sim";

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SupervisorState {
    pub operator_stop: bool,
    /// Mission time of operators' stops on the way to the current target, seconds.
    pub operator_stopped_s: f64,
    pub resumes: u32,
    pub(crate) targets: Option<TargetList>,
    /// The boot of the machine in which the supervisor ran.
    boot: String,
    /// The time of the last save, [`boot_ns`], which passes while the machine is suspended and the robot may be moved.
    saved_ns: u64,
}

#[derive(Debug)]
pub struct StateFile {
    checkpoint: Checkpoint,
    pub state: SupervisorState,
}

impl StateFile {
    pub fn open(directory: &Path) -> Result<Self, CheckpointError> {
        let file = run::checkpoint_file(directory, "supervisor");
        let (checkpoint, state) = Checkpoint::open::<SupervisorState>(&file, CAPACITY)?;
        let mut state = state.unwrap_or_default();
        state.boot = boot();
        Ok(Self { checkpoint, state })
    }

    pub fn save(&mut self) -> Result<(), CheckpointError> {
        self.state.saved_ns = boot_ns();
        self.checkpoint.save(&self.state)
    }
}

/// The current boot of the machine; empty if the kernel does not say.
fn boot() -> String {
    let id = fs::read_to_string(BOOT_ID).unwrap_or_default();
    id.trim().to_owned()
}

/// Seconds since the supervisor of `directory` last saved its state; none if the machine was booted since, or there is
/// no state.
pub fn age_s(directory: &Path) -> Result<Option<f64>, CheckpointError> {
    let file = run::checkpoint_file(directory, "supervisor");
    let (_, state) = Checkpoint::open::<SupervisorState>(&file, CAPACITY)?;
    let state = state.filter(|state| state.boot == boot());
    Ok(state.map(|state| boot_ns().saturating_sub(state.saved_ns) as f64 * 1e-9))
}

#[derive(Clone, Debug)]
pub struct RecoveredRun {
    /// The run file, whose clock goes on.
    pub run: Run,
    /// The first tick that did not happen yet.
    pub first_tick: u64,
    pub time: MissionTime,
}

#[derive(Debug, Error)]
pub enum ResumeError {
    #[error("the run in {directory} came to its end, see {SUMMARY} there; start a new one")]
    Ended { directory: String },
    #[error("the simulated robot of the run in {directory} left no checkpoint; start a new run")]
    NoRobot { directory: String },
    #[error(transparent)]
    Run(#[from] RunError),
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
}

impl RecoveredRun {
    pub fn load(directory: &Path) -> Result<Self, ResumeError> {
        let run = Run::load(directory)?;
        let named = || directory.display().to_string();
        if directory.join(SUMMARY).exists() {
            return Err(ResumeError::Ended { directory: named() });
        }
        let simulated = run.mission.robot.address.is_none();
        if simulated && !run::checkpoint_file(directory, SIMULATOR).exists() {
            return Err(ResumeError::NoRobot { directory: named() });
        }
        let newest = saved_state(directory)?.and_then(|state| state.newest());
        let (first_tick, time) =
            newest.map_or((0, MissionTime::default()), |(tick, time)| (tick + 1, time));
        Ok(Self { run, first_tick, time })
    }

    pub fn clock(&self) -> MissionClock {
        match self.run.clock {
            ticks @ MissionClock::Ticks { .. } => ticks,
            MissionClock::Wall { rate, .. } => MissionClock::Wall {
                epoch_ns: monotonic_ns().saturating_sub((self.time.0 as f64 / rate) as u64),
                rate,
            },
        }
    }

    pub const fn pace(&self) -> Pace {
        match self.run.clock {
            MissionClock::Ticks { .. } => Pace::Max,
            MissionClock::Wall { rate, .. } => Pace::Rate(rate),
        }
    }
}

#[cfg(test)]
mod tests {
    use common::{
        mission::Mission,
        samples::{CommandSample, MOST_TARGETS, TargetPoint},
    };

    use super::*;

    #[test]
    fn the_persisted_targets_of_the_longest_run_fit_into_the_checkpoint() {
        let mission = Mission::parse("target = [3, 0]", Path::new("m.toml")).unwrap();
        let mut list = TargetList::of(&mission);
        let points =
            [TargetPoint { x_m: 1.5, has_heading: 1, ..TargetPoint::default() }; MOST_TARGETS];
        for tick in 0..500 {
            let arrival = CommandSample { distance_m: 0.1, ..CommandSample::default() };
            list.replace(&points, (tick, tick as f64), Some((arrival, true)));
        }
        assert!(!list.append(&points[..1]), "the list is full");
        let directory = tempfile::tempdir().unwrap();
        let mut file = StateFile::open(directory.path()).unwrap();
        file.state.targets = Some(list);
        file.save().unwrap();
    }
}
