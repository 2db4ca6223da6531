//! Stages of a run, each with a policy from beats, deaths and deadlines to actions.

use std::{os::fd::BorrowedFd, path::PathBuf, time::Duration};

use common::{
    bus::Bus,
    clock::Instant,
    mission::Mission,
    samples::{HealthSample, RosterEntry, name_str},
};
use rustix::process::Signal;

use crate::{
    death::Death,
    host::Host,
    observed_time::ObservedTime,
    output_watchdog::OutputWatchdog,
    policy::{Action, Event, Now, Phase, STOP_GRACE},
    stage_process::{StageProcess, StageProcessError},
    stages::start_order,
};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Starter {
    Supervisor,
    /// Systemd or a person starts the stages; their beats make them known.
    External,
}

/// Interval of checks on a late stage that may only be starved.
const LOOK_AGAIN: Duration = Duration::from_millis(10);

pub struct StageProcesses {
    stages: Vec<StageProcess>,
    watchdog: OutputWatchdog,
    directory: PathBuf,
    clock: ObservedTime,
    starter: Starter,
    host: Box<dyn Host>,
    ending: bool,
    start_blocked: bool,
}

impl StageProcesses {
    /// Creates all stages of the run in `directory`, not yet running.
    pub fn new(
        directory: PathBuf,
        starter: Starter,
        mission: &Mission,
        host: Box<dyn Host>,
    ) -> Self {
        let cells = mission.grid_frame().area();
        let stages = start_order().into_iter();
        Self {
            stages: stages.map(|stage| StageProcess::new(stage, mission)).collect(),
            watchdog: OutputWatchdog::new(cells),
            directory,
            clock: ObservedTime::new(Instant::now()),
            starter,
            host,
            ending: false,
            start_blocked: false,
        }
    }

    pub fn now(&self) -> Now {
        self.clock.at(Instant::now())
    }

    /// Records the end of a wait planned to take at most `planned`; excess time is ignored.
    pub fn on_waited(&mut self, planned: Duration) {
        self.clock.on_waited(planned, Instant::now());
    }

    fn position(&self, stage: &str) -> Option<usize> {
        self.stages.iter().position(|it| it.stage.name == stage)
    }

    /// Starts every down stage, in order, from `first_tick` on. External stages start by
    /// themselves.
    pub fn start_all(&mut self, first_tick: u64) {
        self.ending = false;
        if self.starter == Starter::External {
            return;
        }
        for index in 0..self.stages.len() {
            if self.stages[index].phase() == Phase::Down {
                self.apply(index, Event::Start, self.now(), first_tick);
            }
        }
    }

    pub fn descriptors(&self) -> Vec<BorrowedFd<'_>> {
        self.stages
            .iter()
            .filter_map(|stage| stage.process.as_ref())
            .filter_map(|process| process.descriptor())
            .collect()
    }

    pub fn time_to_deadline(&self) -> Option<Duration> {
        let left = self
            .stages
            .iter()
            .filter_map(|stage| stage.policy.deadline())
            .min()?
            .saturating_sub(self.now());
        Some(if left.is_zero() { LOOK_AGAIN } else { left })
    }

    /// Returns whether the roster changed.
    pub fn on_health(&mut self, health: &HealthSample) -> bool {
        let Some(index) = self.position(name_str(&health.stage)) else {
            return false;
        };
        let now = self.now();
        let stage = &mut self.stages[index];
        let external = self.starter == Starter::External && !self.ending;
        let adopted = external && stage.adopt(&mut *self.host, health, now);
        if adopted {
            self.watchdog.on_start(stage.stage.name);
        }
        stage.on_beat(health, now) || adopted
    }

    pub fn on_output(&mut self, stage: &str, tick: u64) {
        self.watchdog.on_output(stage, tick);
        if let Some(index) = self.position(stage) {
            self.stages[index].output = Some(self.now());
        }
    }

    /// Aborts a stage that sends heartbeats without answering, while the robot drives and all
    /// stages run.
    pub fn check_outputs(&mut self, driving: bool, first_tick: u64) {
        if !driving || !self.all_running() {
            self.watchdog.clear_unanswered();
            return;
        }
        let now = self.now();
        let unstarved = |stage: &str| {
            self.stages
                .iter()
                .find(|it| it.stage.name == stage)
                .map_or(now, StageProcess::unstarved)
        };
        if let Some(stage) = self.watchdog.stale(unstarved) {
            tracing::warn!(stage, "the stage sends heartbeats but does not answer its inputs");
            if let Some(index) = self.position(stage) {
                self.apply(index, Event::OutputStale, now, first_tick);
            }
        }
    }

    /// Reaps ended stages, starts successors on `bus` from `first_tick` on, applies deadlines.
    /// Returns the deaths.
    pub fn poll(&mut self, bus: &Bus, first_tick: u64) -> Result<Vec<Death>, StageProcessError> {
        let mut deaths = Vec::new();
        // Heartbeats were read until now; later disk work must not make a stage late.
        let taken = self.now();
        for index in 0..self.stages.len() {
            if let Some(cause) = self.stages[index].try_reap()? {
                let now = self.now();
                let stage = &mut self.stages[index];
                let by_us =
                    matches!(stage.phase(), Phase::Replaced { .. } | Phase::Stopping { .. });
                // Systemd stops external stages before their supervisor.
                let by_starter = self.starter == Starter::External && stage.stopping;
                let asked = by_us || by_starter;
                let mut death = stage.record_death(cause, now);
                if let Err(error) = bus.remove_unfinished(death.pid) {
                    tracing::warn!(stage = death.stage, %error, "cannot prepare the bus for its successor");
                }
                let event = if death.was_refused() { Event::Refused } else { Event::Exited };
                self.apply(index, event, self.now(), first_tick);
                self.stages[index].record_next(&mut death, self.now());
                if asked {
                    tracing::info!(stage = death.stage, cause = %death.cause, "stage ended");
                } else {
                    deaths.push(death);
                }
            }
            let activity = self.stages[index].overdue_activity(taken);
            self.apply(index, Event::Time(activity), taken, first_tick);
        }
        Ok(deaths)
    }

    /// Returns whether a stage could not start on this bus since the last call.
    pub fn is_start_blocked(&mut self) -> bool {
        std::mem::take(&mut self.start_blocked)
    }

    /// Suspends restarts until [`Self::start_all`].
    pub fn start_no_more(&mut self) {
        self.ending = true;
    }

    /// Replaces `stage`, even if held, by a new generation from `first_tick` on.
    pub fn replace(&mut self, stage: &str, first_tick: u64) {
        if let Some(index) = self.position(stage) {
            self.apply(index, Event::Replace, self.now(), first_tick);
        }
    }

    /// Stops all stages from the `first` of the start order on. Returns whether one has or awaits a
    /// process.
    pub fn stop_from(&mut self, first: usize) -> bool {
        assert!(first < self.stages.len());
        let mut any = false;
        for index in first..self.stages.len() {
            let stage = &self.stages[index];
            match stage.phase() {
                Phase::Down | Phase::Held if stage.process.is_none() => continue,
                Phase::Stopping { .. } => {}
                _ => self.apply(index, Event::Stop, self.now(), 0),
            }
            any = true;
        }
        any
    }

    pub fn runs(&self, stage: &str) -> bool {
        self.position(stage).is_some_and(|index| self.stages[index].is_running())
    }

    fn apply(&mut self, index: usize, event: Event, now: Now, first_tick: u64) {
        let Some(action) = self.stages[index].policy.step(event, now) else {
            return;
        };
        let now = self.now();
        let stage = &mut self.stages[index];
        match action {
            Action::Start if self.ending || self.starter == Starter::External => {
                stage.policy.step(Event::Stop, now);
                stage.policy.step(Event::Exited, now);
                assert_eq!(stage.phase(), Phase::Down);
            }
            Action::Start => {
                self.watchdog.on_start(stage.stage.name);
                stage.start(&mut *self.host, &self.directory, first_tick, now);
            }
            Action::Terminate => stage.signal(Signal::TERM, now),
            Action::Abort => stage.signal(Signal::ABORT, now),
            Action::Kill => stage.signal(Signal::KILL, now),
            Action::RecreateBus => {
                let stage = stage.stage.name;
                tracing::error!(stage, "the stage cannot start on this bus");
                // External stages are stopped and started by others.
                self.start_blocked = self.starter == Starter::Supervisor;
            }
        }
    }

    pub fn all_running(&self) -> bool {
        self.stages.iter().all(StageProcess::is_running)
    }

    pub fn any_starting(&self) -> bool {
        let starting = |stage: &StageProcess| {
            matches!(stage.phase(), Phase::Starting { .. } | Phase::BackingOff { .. })
        };
        self.stages.iter().any(starting)
    }

    pub fn running(&self) -> (usize, usize) {
        (self.stages.iter().filter(|stage| stage.is_running()).count(), self.stages.len())
    }

    /// Returns the external stages that do not beat as ready.
    pub fn not_started(&self) -> Vec<&'static str> {
        let external = self.starter == Starter::External;
        self.names(|stage| external && !stage.is_running())
    }

    /// Returns the supervisor's own stages that have yet to beat as ready.
    pub fn not_ready(&self) -> Vec<&'static str> {
        let own = self.starter != Starter::External;
        self.names(|stage| own && !stage.is_running() && stage.phase() != Phase::Held)
    }

    pub fn held(&self) -> Vec<&'static str> {
        self.names(|stage| stage.phase() == Phase::Held)
    }

    fn names(&self, of: impl Fn(&StageProcess) -> bool) -> Vec<&'static str> {
        self.stages.iter().filter(|stage| of(stage)).map(|stage| stage.stage.name).collect()
    }

    pub fn restarts(&self) -> impl Iterator<Item = (&'static str, u32)> + '_ {
        self.stages.iter().map(|stage| (stage.stage.name, stage.restarts()))
    }

    pub fn roster(&self) -> Vec<RosterEntry> {
        let now = self.now();
        self.stages.iter().map(|stage| stage.roster_entry(now)).collect()
    }
}

/// Stops the stages in reverse order. The link comes last and stops the robot.
impl Drop for StageProcesses {
    fn drop(&mut self) {
        while let Some(mut stage) = self.stages.pop() {
            if let Some(mut process) = stage.process.take() {
                process.end(STOP_GRACE);
            }
        }
    }
}
