//! State from which another supervisor resumes a run.
//!
//! Stages and simulated robot have their own checkpoints. Without a supervisor the robot comes to
//! rest, and then mission time stands still.

use std::{fs, path::Path, time::Duration};

use common::{
    checkpoint::{Checkpoint, CheckpointError},
    clock::{MissionClock, MissionTime, Pace, monotonic_ns},
    file,
    geometry::Zone,
    mission::Mission,
    run::{self, Run, RunError},
    samples::PlaceSample,
};
use dead_reckoning::{saved_place, saved_state};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use thiserror::Error;

use crate::{following::Following, target_list::TargetList};

/// Capacity for the encoded [`SupervisorState`], bytes. Targets and results take under 10,000,
/// zones 5,000.
const CAPACITY: usize = 18 << 10;
/// Summary of a finished run, in its run directory.
pub const SUMMARY: &str = "summary.json";
/// Largest summary that is read. A summary takes 2 kB.
const LARGEST_SUMMARY: u64 = 1 << 20;
const SIMULATOR: &str = "x80-sim";
/// Time for a robot to come to rest after its supervisor's end. It counts as mission time, in which
/// the wheels may turn.
const COMES_TO_REST: Duration = Duration::from_secs(10);

#[derive(Debug, Default, Serialize, Deserialize)]
pub struct SupervisorState {
    pub operator_stop: bool,
    /// Time of operator stops since the current target's start.
    pub operator_stopped_s: f64,
    pub resumes: u32,
    pub(crate) targets: Option<TargetList>,
    pub(crate) following: Option<Following>,
    /// Newest place set by an operator; number 0 for none.
    pub(crate) place: PlaceSample,
    /// Operators' zones and the number of changes; `None` for the mission's zones.
    pub(crate) zones: Option<(u64, Vec<Zone>)>,
}

impl SupervisorState {
    pub(crate) fn open(directory: &Path) -> Result<(Checkpoint, Self), CheckpointError> {
        let (checkpoint, state) =
            Checkpoint::open::<Self>(&run::checkpoint_file(directory, "supervisor"), CAPACITY)?;
        Ok((checkpoint, state.unwrap_or_default()))
    }
}

/// Returns `None` without a readable summary.
pub fn summary<T: DeserializeOwned>(directory: &Path) -> Option<T> {
    serde_json::from_str(&file::text(&directory.join(SUMMARY), LARGEST_SUMMARY)?).ok()
}

/// Returns the robot's last known place and its age, seconds.
pub fn last_place(directory: &Path, mission: &Mission) -> Option<(PlaceSample, f64)> {
    let place = saved_place(directory, mission).ok().flatten()?;
    let saved =
        fs::metadata(run::checkpoint_file(directory, "supervisor")).ok()?.modified().ok()?;
    Some((place, saved.elapsed().unwrap_or_default().as_secs_f64()))
}

#[derive(Debug)]
pub struct RecoveredRun {
    pub run: Run,
    pub first_tick: u64,
    pub time: MissionTime,
}

#[derive(Debug, Error)]
pub enum ResumeError {
    #[error("the run in {directory} has ended, see {SUMMARY} there; start a new one")]
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
        if file::exists(&directory.join(SUMMARY)) {
            return Err(ResumeError::Ended { directory: named() });
        }
        let simulated = run.mission.robot.address.is_none();
        if simulated && !file::exists(&run::checkpoint_file(directory, SIMULATOR)) {
            return Err(ResumeError::NoRobot { directory: named() });
        }
        let (first_tick, saved) = saved_state(directory)?
            .and_then(|state| state.newest())
            .map_or((0, MissionTime::default()), |(tick, time)| (tick + 1, time));
        // After a restart of the machine its clock says nothing.
        let latest = MissionTime(saved.0 + COMES_TO_REST.as_nanos() as u64);
        let time = match run.clock {
            MissionClock::Ticks { .. } => saved,
            wall => wall.at(0, monotonic_ns()).clamp(saved, latest),
        };
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
        address::Address,
        domain::RobotName,
        mission::{MOST_CORNERS, MOST_ZONES},
        samples::{CommandSample, MOST_TARGETS, TargetPoint},
    };
    use glam::DVec2;

    use super::*;
    use crate::{target_list::TargetOutcome, testing::mission};

    #[test]
    fn the_persisted_targets_of_the_longest_run_fit_into_the_checkpoint() {
        let mission = mission("target = [3, 0]");
        let mut list = TargetList::of(&mission);
        let points =
            [TargetPoint { x_m: 1.5, has_heading: 1, ..TargetPoint::default() }; MOST_TARGETS];
        for tick in 0..500 {
            let arrival = CommandSample { distance_m: 0.1, ..CommandSample::default() };
            list.replace(&points, (tick, tick as f64), Some((arrival, TargetOutcome::Reached)));
        }
        assert!(!list.append(&points[..1]), "the list is full");
        let directory = tempfile::tempdir().unwrap();
        let (mut checkpoint, mut state) = SupervisorState::open(directory.path()).unwrap();
        state.targets = Some(list);
        let zone = Zone { points: vec![DVec2::splat(1.5); MOST_CORNERS] };
        state.zones = Some((1 << 40, vec![zone; MOST_ZONES]));
        checkpoint.save(&state).unwrap();
    }

    #[test]
    fn mission_time_goes_on_while_a_robot_without_a_supervisor_may_roll_and_no_longer() {
        let directory = tempfile::tempdir().unwrap();
        let mut mission = mission("target = [3, 0]");
        mission.robot.address = Some("127.0.0.1:5990".to_owned());
        let resumed_at = |began_ago_s: i64| {
            let epoch_ns = monotonic_ns().saturating_add_signed(-began_ago_s * 1_000_000_000);
            let run = Run {
                robot: RobotName::default(),
                address: Address::Ros2(None),
                clock: MissionClock::Wall { epoch_ns, rate: 1.0 },
                mission: mission.clone(),
            };
            run.save(directory.path()).unwrap();
            RecoveredRun::load(directory.path()).unwrap().time.seconds().round()
        };
        // After a restart of the machine the epoch is ahead.
        assert_eq!([4, 3_000, -1_000].map(resumed_at), [4.0, 10.0, 0.0]);
    }
}
