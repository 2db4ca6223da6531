//! A stage of a run: its policy and the process of its current generation.

use std::{
    io,
    path::{Path, PathBuf},
};

use common::{
    mission::Mission,
    run,
    samples::{HealthSample, HealthState, RosterEntry, StageState, name},
    start::Generation,
};
use rustix::process::Signal;
use thiserror::Error;

use crate::{
    activity::{Activity, Times},
    death::{Death, Next},
    host::{Host, Watched},
    policy::{Event, Now, Phase, Policy},
    process::ExitCause,
    stages::Stage,
};

#[derive(Debug, Error)]
#[error("cannot reap stage {stage}: {source}")]
pub struct StageProcessError {
    stage: &'static str,
    source: io::Error,
}

/// Times are of the owner's clock.
pub(crate) struct StageProcess {
    pub stage: &'static Stage,
    executable: Option<PathBuf>,
    pub policy: Policy,
    pub process: Option<Box<dyn Watched>>,
    generation: u32,
    started: Now,
    beat: Option<Now>,
    /// Process times at its start or last ready beat; `None` if uncounted.
    times: Option<Times>,
    pub output: Option<Now>,
    hung: Option<Now>,
    /// Whether the last beat announced a stop on request.
    pub stopping: bool,
    /// Whether the previous iteration found the process ended.
    found_ended: bool,
}

impl StageProcess {
    pub(crate) fn new(stage: &'static Stage, mission: &Mission) -> Self {
        let cells = mission.grid_frame().area();
        Self {
            stage,
            executable: stage.executable(mission).map(Path::to_path_buf),
            policy: Policy::new(stage.deadlines_on(cells)),
            process: None,
            generation: 0,
            started: Now::ZERO,
            beat: None,
            times: None,
            output: None,
            hung: None,
            stopping: false,
            found_ended: false,
        }
    }

    pub(crate) const fn phase(&self) -> Phase {
        self.policy.phase()
    }

    pub(crate) const fn is_running(&self) -> bool {
        matches!(self.phase(), Phase::Running { .. })
    }

    fn pid(&self) -> u32 {
        self.process.as_ref().map_or(0, |process| process.id())
    }

    pub(crate) const fn restarts(&self) -> u32 {
        self.generation.saturating_sub(1)
    }

    /// Watches the external process that published `health`, if it is a successor; returns whether
    /// it is.
    pub(crate) fn adopt(&mut self, host: &mut dyn Host, health: &HealthSample, now: Now) -> bool {
        // Beats of an ended process may still arrive.
        if self.process.is_some() || self.generation >= health.stamp.generation {
            return false;
        }
        let Ok(process) = host.adopt(health.pid, self.stage.name) else {
            return false;
        };
        self.policy.step(Event::Start, now);
        assert!(matches!(self.phase(), Phase::Starting { .. }));
        (self.started, self.times) = (now, process.times());
        self.process = Some(process);
        self.generation = health.stamp.generation;
        true
    }

    /// Returns whether the roster must be published.
    pub(crate) fn on_beat(&mut self, health: &HealthSample, now: Now) -> bool {
        if self.process.is_none() || self.pid() != health.pid {
            return false;
        }
        self.beat = Some(now);
        let was_running = self.is_running();
        let state = health.state();
        self.stopping = state == HealthState::Stopping;
        if state == HealthState::Ready {
            self.times = self.process.as_ref().and_then(|process| process.times());
            self.policy.step(Event::BeatReady, now);
        }
        // A starting process waits for a roster that names it.
        state == HealthState::Starting || !was_running && state == HealthState::Ready
    }

    pub(crate) fn start(
        &mut self,
        host: &mut dyn Host,
        directory: &Path,
        first_tick: u64,
        now: Now,
    ) {
        assert!(self.process.is_none());
        let stage = self.stage.name;
        (self.started, self.hung, self.times) = (now, None, Some(Times::default()));
        let spawned =
            run::next_generation(directory, stage).map_err(io::Error::other).and_then(|number| {
                self.generation = number;
                let directory = directory.to_path_buf();
                let generation = Generation { stage, directory, number, first_tick };
                host.start(self.executable.as_deref(), &generation)
            });
        match spawned {
            Ok(process) => self.process = Some(process),
            // The start is retried with growing pauses; other stages go on.
            Err(error) => {
                tracing::error!(stage, %error, "the stage cannot be started; check the limits of processes and descriptors and the free disk space");
                self.policy.step(Event::StartFailed, now);
            }
        }
    }

    pub(crate) fn signal(&mut self, signal: Signal, now: Now) {
        if signal == Signal::ABORT {
            self.hung = Some(now);
        }
        if let Some(process) = &self.process {
            tracing::debug!(stage = self.stage.name, ?signal, "signalled");
            process.signal(signal);
        }
    }

    /// Returns the activity since the last beat, if a deadline has passed.
    pub(crate) fn overdue_activity(&self, now: Now) -> Option<Activity> {
        self.policy.deadline().filter(|deadline| now >= *deadline)?;
        self.process.as_ref()?.activity(self.times?)
    }

    /// Returns the time of the last beat without the process's waits for a processor. While no beat
    /// comes, the policy judges the process.
    pub(crate) fn unstarved(&self) -> Now {
        self.beat.unwrap_or_default().saturating_sub(self.times.unwrap_or_default().starved)
    }

    /// Returns the cause if the process has ended.
    ///
    /// An unannounced end of an external process is reported one iteration later, after a possible
    /// last beat.
    pub(crate) fn try_reap(&mut self) -> Result<Option<ExitCause>, StageProcessError> {
        let Some(process) = &mut self.process else {
            return Ok(None);
        };
        let cause = process
            .try_reap()
            .map_err(|source| StageProcessError { stage: self.stage.name, source })?;
        let found_before = std::mem::replace(&mut self.found_ended, cause.is_some());
        let is_known = cause != Some(ExitCause::Unknown) || self.stopping || found_before;
        Ok(cause.filter(|_| is_known))
    }

    pub(crate) fn record_death(&mut self, cause: ExitCause, now: Now) -> Death {
        assert!(self.process.is_some());
        let age = |then: Now| now.saturating_sub(then).as_secs_f64();
        let hung_after = |(hung, beat): (Now, Now)| hung.saturating_sub(beat).as_secs_f64();
        let death = Death {
            stage: self.stage.name,
            pid: self.pid(),
            generation: self.generation,
            cause,
            hung: self.hung.is_some(),
            noticed_after_s: self.hung.zip(self.beat).map(hung_after),
            beat_age_s: self.beat.map(age),
            uptime_s: age(self.started),
            deaths_in_window: 0,
            next: Next::Nothing,
            log_tail: self.process.as_ref().map(|process| process.log_tail()).unwrap_or_default(),
        };
        (self.process, self.beat) = (None, None);
        (self.stopping, self.found_ended) = (false, false);
        death
    }

    pub(crate) fn record_next(&self, death: &mut Death, now: Now) {
        assert!(!self.is_running());
        death.deaths_in_window = self.policy.recent_deaths() as u32;
        death.next = match self.phase() {
            Phase::BackingOff { until } => {
                Next::StartLater { after_s: until.saturating_sub(now).as_secs_f64() }
            }
            Phase::Held => Next::Hold,
            Phase::Down | Phase::Stopping { .. } => Next::Nothing,
            Phase::Starting { .. }
            | Phase::Running { .. }
            | Phase::Aborted { .. }
            | Phase::Replaced { .. } => Next::StartNow,
        };
    }

    pub(crate) fn roster_entry(&self, now: Now) -> RosterEntry {
        let age = |then: Option<Now>| {
            then.map_or(u64::MAX, |then| now.saturating_sub(then).as_nanos() as u64)
        };
        RosterEntry {
            stage: name(self.stage.name),
            pid: self.pid(),
            generation: self.generation,
            state: state(self.phase()).into(),
            restarts: self.restarts(),
            uptime_ns: age(self.process.as_ref().map(|_| self.started)),
            beat_age_ns: age(self.beat),
            output_age_ns: age(self.output),
        }
    }
}

const fn state(phase: Phase) -> StageState {
    match phase {
        Phase::Down => StageState::Down,
        Phase::BackingOff { .. } => StageState::BackingOff,
        Phase::Starting { .. } => StageState::Starting,
        Phase::Running { .. } => StageState::Running,
        Phase::Aborted { .. } | Phase::Replaced { .. } | Phase::Stopping { .. } => {
            StageState::Stopping
        }
        Phase::Held => StageState::Held,
    }
}
