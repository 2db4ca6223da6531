//! What of a supervisor outlives it: enough for another to go on with its run.
//!
//! Pose, belief and robot keep themselves; here is what only the supervisor knew. On a wall clock mission time
//! stands still while nobody supervises: the robot stands too.

use std::{fs, path::Path};

use common::{
    checkpoint::{Checkpoint, CheckpointError},
    clock::{MissionClock, MissionTime, Pace, monotonic_ns},
    run::{self, Run, RunError},
};
use dead_reckoning::shell::saved_state;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Room for the encoded [`SupervisorState`], bytes: it is under 80.
const CAPACITY: usize = 256;
/// The kernel's name for the time since the machine was started.
const BOOT_ID: &str = "/proc/sys/kernel/random/boot_id";
/// In a run directory whose run was summed up.
pub const SUMMARY: &str = "summary.json";
/// Whose checkpoint a simulated robot's is.
const SIMULATOR: &str = "x80-sim";

/// What a supervisor keeps.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SupervisorState {
    /// An operator said stop, and has not said resume.
    pub operator_stop: bool,
    /// Supervisors that went on with this run.
    pub resumes: u32,
    /// The start of the machine that it lived in.
    boot: String,
    /// When it was last alive, [`monotonic_ns`].
    alive_ns: u64,
}

/// Keeps it in the run directory.
#[derive(Debug)]
pub struct StateFile {
    checkpoint: Checkpoint,
    /// What is state.
    pub state: SupervisorState,
}

impl StateFile {
    /// For a run that begins, or one that goes on.
    pub fn open(directory: &Path) -> Result<Self, CheckpointError> {
        let file = run::checkpoint_file(directory, "supervisor");
        let (checkpoint, state) = Checkpoint::open::<SupervisorState>(&file, CAPACITY)?;
        let mut state = state.unwrap_or_default();
        state.boot = boot();
        Ok(Self { checkpoint, state })
    }

    /// Keep what is so now.
    pub fn keep(&mut self) -> Result<(), CheckpointError> {
        self.state.alive_ns = monotonic_ns();
        self.checkpoint.save(&self.state)
    }
}

/// The start of the machine that this is; empty where the kernel does not say.
fn boot() -> String {
    let id = fs::read_to_string(BOOT_ID).unwrap_or_default();
    id.trim().to_owned()
}

/// Seconds since the supervisor of `directory` was last alive; none if the machine was started since, or nothing
/// was state.
pub fn age_s(directory: &Path) -> Option<f64> {
    let file = run::checkpoint_file(directory, "supervisor");
    let (_, state) = Checkpoint::open::<SupervisorState>(&file, CAPACITY).ok()?;
    let state = state.filter(|state| state.boot == boot())?;
    Some(monotonic_ns().saturating_sub(state.alive_ns) as f64 * 1e-9)
}

/// A run to go on with.
#[derive(Clone, Debug)]
pub struct RecoveredRun {
    /// What it was; its clock goes on.
    pub run: Run,
    /// The first tick that nobody has made.
    pub first_tick: u64,
    /// Mission time by then.
    pub time: MissionTime,
}

/// Why there is nothing to go on with.
#[derive(Debug, Error)]
pub enum ResumeError {
    /// It ended.
    #[error("the run in {directory} came to its end, see {SUMMARY} there; start a new one")]
    Ended {
        /// Its directory.
        directory: String,
    },
    /// The simulated robot left nothing.
    #[error(
        "the simulated robot of the run in {directory} did not keep where it stood; start a new run"
    )]
    NoRobot {
        /// Its directory.
        directory: String,
    },
    /// The run file.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The pose.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
}

impl RecoveredRun {
    /// The run whose supervisor died.
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
        Ok(Self {
            run,
            first_tick,
            time,
        })
    }

    /// Its clock from now on.
    pub fn clock(&self) -> MissionClock {
        match self.run.clock {
            ticks @ MissionClock::Ticks { .. } => ticks,
            MissionClock::Wall { rate, .. } => MissionClock::Wall {
                epoch_ns: monotonic_ns().saturating_sub((self.time.0 as f64 / rate) as u64),
                rate,
            },
        }
    }

    /// How its mission time passes.
    pub const fn pace(&self) -> Pace {
        match self.run.clock {
            MissionClock::Ticks { .. } => Pace::Max,
            MissionClock::Wall { rate, .. } => Pace::Rate(rate),
        }
    }
}
