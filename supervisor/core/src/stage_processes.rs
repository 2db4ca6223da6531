//! The stages of a run: their members, each under its own policy.

mod snapshot;

use std::{
    fs::File,
    io,
    os::fd::{AsFd, BorrowedFd},
    path::{Path, PathBuf},
    process::Stdio,
    time::{Duration, Instant},
};

use common::{
    bus::Bus,
    run,
    samples::{HealthSample, HealthState, name_str},
};
use rustix::process::Signal;
use thiserror::Error;

use crate::{
    death::{Cause, Death},
    output_watchdog::OutputWatchdog,
    policy::{Action, Event, Now, Phase, Policy},
    process::{Ended, Process, firsthand},
    stages::{Stage, start_order},
};

/// A stage's process could not be started or watched.
#[derive(Debug, Error)]
#[error("cannot {action} stage {stage}: {source}; are members, descriptors or disk used up?")]
pub struct StageProcessError {
    action: &'static str,
    stage: &'static str,
    source: io::Error,
}

/// Time a stage has to say goodbye to a supervisor that fails.
const GOODBYE: Duration = Duration::from_millis(300);

/// One stage and its current life.
struct Member {
    stage: &'static Stage,
    policy: Policy,
    process: Option<Process>,
    generation: u32,
    started: Now,
    beat: Option<Now>,
    output: Option<Now>,
    /// Length of its log when this life began.
    log_began: u64,
    /// When the supervisor saw that it hung.
    hung: Option<Now>,
}

/// All stages, in start order.
pub struct StageProcesses {
    members: Vec<Member>,
    watchdog: OutputWatchdog,
    directory: PathBuf,
    clock: Instant,
    /// Who starts the stages.
    starter: Starter,
    ending: bool,
    /// A stage cannot begin a life on the bus as it is.
    start_blocked: bool,
}

/// Who starts a stage, and starts it again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Starter {
    /// We do.
    Supervisor,
    /// Systemd, a person: a stage is known once it beats, and its next life is waited for.
    Another,
}

impl StageProcesses {
    /// None running yet; they will live in the run directory, with a map of so many `cells`.
    pub fn new(directory: PathBuf, starter: Starter, cells: usize) -> Self {
        let member = |stage: &'static Stage| Member {
            stage,
            policy: Policy::new(stage.deadlines_on(cells)),
            process: None,
            generation: 0,
            started: Now::ZERO,
            beat: None,
            output: None,
            log_began: 0,
            hung: None,
        };
        Self {
            members: start_order().into_iter().map(member).collect(),
            watchdog: OutputWatchdog::new(cells),
            directory,
            clock: Instant::now(),
            starter,
            ending: false,
            start_blocked: false,
        }
    }

    fn now(&self) -> Now {
        self.clock.elapsed()
    }

    /// Start every stage that is down on a new bus, in order, from `first_tick` on, if that is ours to do.
    pub fn start_all(&mut self, first_tick: u64) -> Result<(), StageProcessError> {
        if self.starter == Starter::Another {
            return Ok(());
        }
        for index in 0..self.members.len() {
            if self.members[index].policy.phase() == Phase::Down {
                self.tell(index, Event::Start, first_tick)?;
            }
        }
        Ok(())
    }

    /// Descriptors that become readable when a stage ends.
    pub fn descriptors(&self) -> Vec<BorrowedFd<'_>> {
        let members = self
            .members
            .iter()
            .filter_map(|member| member.process.as_ref());
        members.map(AsFd::as_fd).collect()
    }

    /// Time until some policy must look at the clock.
    pub fn time_to_deadline(&self) -> Option<Now> {
        let now = self.now();
        let deadlines = self
            .members
            .iter()
            .filter_map(|member| member.policy.deadline());
        deadlines.min().map(|deadline| deadline.saturating_sub(now))
    }

    /// A guest that was not known beats: from now on it is watched like a child.
    fn meet(&mut self, health: &HealthSample) -> bool {
        let now = self.now();
        let Some(member) = self.members.iter_mut().find(|member| {
            member.stage.name == name_str(&health.stage)
                && member.process.is_none()
                // Beats of the dead may still be on their way.
                && member.generation < health.stamp.generation
        }) else {
            return false;
        };
        let Ok(process) = Process::adopt(health.pid, member.stage.name) else {
            return false;
        };
        self.watchdog.on_start(member.stage.name);
        member.policy.step(Event::Start, now);
        member.process = Some(process);
        member.generation = health.stamp.generation;
        member.started = now;
        true
    }

    /// A heartbeat came. Says whether what the roster says of the stage changed by it.
    pub fn on_health(&mut self, health: &HealthSample) -> bool {
        let met = self.starter == Starter::Another && !self.ending && self.meet(health);
        let now = self.now();
        let Some(member) = self.members.iter_mut().find(|member| {
            member.stage.name == name_str(&health.stage)
                && member.process.as_ref().map(Process::id) == Some(health.pid)
        }) else {
            return false;
        };
        member.beat = Some(now);
        let was_running = member.is_running();
        let event = match HealthState::from_byte(health.state) {
            HealthState::Ready => Event::BeatReady,
            HealthState::Starting | HealthState::Stopping => Event::BeatStarting,
        };
        member.policy.step(event, now);
        let became_ready = !was_running && event == Event::BeatReady;
        met || became_ready
    }

    /// A stage published something of `tick`.
    pub fn on_output(&mut self, stage: &str, tick: u64) {
        self.watchdog.on_output(stage, tick);
        let now = self.now();
        if let Some(member) = self
            .members
            .iter_mut()
            .find(|member| member.stage.name == stage)
        {
            member.output = Some(now);
        }
    }

    /// A stage that beats and leaves its inputs unanswered is late, while the robot is driven. What follows it is not
    /// judged meanwhile.
    pub fn judge_outputs(
        &mut self,
        driven: bool,
        first_tick: u64,
    ) -> Result<(), StageProcessError> {
        if !driven || !self.all_running() {
            self.watchdog.forgive();
            return Ok(());
        }
        let Some(stage) = self.watchdog.stale(self.now()) else {
            return Ok(());
        };
        tracing::warn!(stage, "beats, and does not answer what it reads");
        let index = self.members.iter().position(|it| it.stage.name == stage);
        index.map_or(Ok(()), |index| {
            self.tell(index, Event::OutputStale, first_tick)
        })
    }

    /// Reap what ended, meet the deadlines. `first_tick` is what a new life on `bus` starts from. Returns the deaths.
    pub fn tend(&mut self, bus: &Bus, first_tick: u64) -> Result<Vec<Death>, StageProcessError> {
        let mut deaths = Vec::new();
        // Beats were taken until now. What follows may wait for the disk, and no stage is silent for that.
        let heard = self.now();
        for index in 0..self.members.len() {
            if let Some(status) = self.reap(index)? {
                let asked = matches!(
                    self.members[index].policy.phase(),
                    Phase::Replaced { .. } | Phase::Stopping { .. }
                );
                let mut death = self.record(index, Cause::of(status));
                if let Err(error) = bus.remove_unfinished(death.pid) {
                    tracing::warn!(stage = death.stage, %error, "cannot make way for its successor");
                }
                let member = &mut self.members[index];
                (member.process, member.beat) = (None, None);
                let event = if death.was_refused() {
                    Event::Refused
                } else {
                    Event::Exited
                };
                self.tell(index, event, first_tick)?;
                death.next = self.next(index);
                death.deaths_in_window = self.members[index].policy.recent_deaths() as u32;
                // One that was told to go, and has gone, is no death.
                if asked {
                    tracing::info!(stage = death.stage, cause = %death.cause, "stage ended");
                } else {
                    deaths.push(death);
                }
            }
            self.tell_as_of(heard, index, Event::Time, first_tick)?;
        }
        Ok(deaths)
    }

    /// What ended a stage's process, if it has ended.
    fn reap(&mut self, index: usize) -> Result<Option<Ended>, StageProcessError> {
        let member = &mut self.members[index];
        let Some(process) = &mut member.process else {
            return Ok(None);
        };
        process.try_reap().map_err(|source| StageProcessError {
            action: "reap",
            stage: member.stage.name,
            source,
        })
    }

    /// Whether, since this was last asked, it was seen that the bus must be made anew.
    pub fn is_start_blocked(&mut self) -> bool {
        std::mem::take(&mut self.start_blocked)
    }

    /// From now on a stage that ends stays down.
    pub fn want_no_more(&mut self) {
        self.ending = true;
    }

    /// Give `stage` a fresh life, which begins at `first_tick`; one that is held is released. Says whether there is
    /// such a stage.
    pub fn replace(&mut self, stage: &str, first_tick: u64) -> Result<bool, StageProcessError> {
        let found = self
            .members
            .iter()
            .position(|member| member.stage.name == stage);
        match found {
            Some(index) => self.tell(index, Event::Replace, first_tick).map(|()| true),
            None => Ok(false),
        }
    }

    /// Stop the last stage, in start order, that has a process or waits for one. Says whether there was one.
    pub fn stop_last(&mut self) -> Result<bool, StageProcessError> {
        let last = self.members.iter().rposition(|member| {
            member.process.is_some() || !matches!(member.policy.phase(), Phase::Down | Phase::Held)
        });
        if let Some(index) = last {
            let stopping = matches!(self.members[index].policy.phase(), Phase::Stopping { .. });
            if !stopping {
                self.tell(index, Event::Stop, 0)?;
            }
        }
        Ok(last.is_some())
    }

    fn tell(
        &mut self,
        index: usize,
        event: Event,
        first_tick: u64,
    ) -> Result<(), StageProcessError> {
        self.tell_as_of(self.now(), index, event, first_tick)
    }

    fn tell_as_of(
        &mut self,
        now: Now,
        index: usize,
        event: Event,
        first_tick: u64,
    ) -> Result<(), StageProcessError> {
        match self.members[index].policy.step(event, now) {
            Some(action) => self.act(index, action, first_tick),
            None => Ok(()),
        }
    }

    fn act(
        &mut self,
        index: usize,
        action: Action,
        first_tick: u64,
    ) -> Result<(), StageProcessError> {
        let now = self.now();
        let member = &mut self.members[index];
        let stage = member.stage.name;
        let signal = match action {
            Action::Start if self.ending || self.starter == Starter::Another => {
                member.policy.step(Event::Stop, now);
                member.policy.step(Event::Exited, now);
                return Ok(());
            }
            Action::Start => {
                self.watchdog.on_start(stage);
                member.started = now;
                member.hung = None;
                let log = log_file(&self.directory, stage);
                member.log_began = log.metadata().map_or(0, |log| log.len());
                let spawned = run::next_generation(&self.directory, stage)
                    .map_err(io::Error::other)
                    .and_then(|life| {
                        member.generation = life;
                        spawn(member, &self.directory, first_tick)
                    });
                match spawned {
                    Ok(process) => member.process = Some(process),
                    // Tried again with growing pauses, the others go on.
                    Err(error) => {
                        tracing::error!(stage, %error, "cannot be started; are members, descriptors or disk used up?");
                        member.policy.step(Event::StartFailed, now);
                    }
                }
                return Ok(());
            }
            Action::Terminate => Signal::TERM,
            Action::Abort => {
                member.hung = Some(now);
                Signal::ABORT
            }
            Action::Kill => Signal::KILL,
            Action::RecreateBus => {
                tracing::error!(stage, "cannot begin a life on the bus as it is");
                // Guests are another's to stop and start.
                self.start_blocked = self.starter == Starter::Supervisor;
                return Ok(());
            }
        };
        if let Some(process) = &member.process {
            tracing::debug!(stage, ?signal, "signalled");
            process.signal(signal);
        }
        Ok(())
    }
}

/// Should a supervisor end without its orderly stop, the stages still go in reverse order, each asked
/// first: the link, the last, stops the robot.
impl Drop for StageProcesses {
    fn drop(&mut self) {
        while let Some(member) = self.members.pop() {
            if let Some(mut process) = member.process {
                process.end(GOODBYE);
            }
        }
    }
}

/// Where a stage's words go, life after life.
fn log_file(directory: &Path, stage: &str) -> PathBuf {
    directory.join(format!("{stage}.log"))
}

/// A process for the member's new generation; its words go to a log in the run directory.
fn spawn(member: &Member, directory: &Path, first_tick: u64) -> io::Result<Process> {
    let log = log_file(directory, member.stage.name);
    let log = File::options().create(true).append(true).open(log)?;
    let directory = directory
        .to_str()
        .ok_or_else(|| io::Error::other("the run directory's name is not UTF-8"))?;
    let mut command = firsthand(&[
        "stage",
        member.stage.name,
        "--run",
        directory,
        "--generation",
        &member.generation.to_string(),
        "--first-tick",
        &first_tick.to_string(),
        "--supervisor",
        &std::process::id().to_string(),
    ]);
    command.stdout(Stdio::null()).stderr(log);
    Process::spawn(command)
}
