//! The stages of a run: their processes, each under its own policy.

use std::{
    fs::File,
    io,
    os::fd::{AsFd, BorrowedFd},
    path::PathBuf,
    process::Stdio,
    time::{Duration, Instant},
};

use common::samples::{HealthSample, HealthState, RosterEntry, StageState, name, name_str};
use rustix::process::Signal;
use thiserror::Error;

use crate::{
    policy::{Action, Event, Now, Phase, Policy},
    process::{Process, firsthand},
    stages::{Stage, start_order},
};

/// A stage's process could not be started or watched.
#[derive(Debug, Error)]
#[error("cannot {action} stage {stage}: {source}; are processes, descriptors or disk used up?")]
pub(crate) struct FleetError {
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
}

/// All stages, in start order.
pub(crate) struct Fleet {
    members: Vec<Member>,
    directory: PathBuf,
    clock: Instant,
    ending: bool,
}

impl Fleet {
    /// None running yet; they will live in the run directory.
    pub(crate) fn new(directory: PathBuf) -> Self {
        let member = |stage| Member {
            stage,
            policy: Policy::new(stage),
            process: None,
            generation: 0,
            started: Now::ZERO,
            beat: None,
            output: None,
        };
        Self {
            members: start_order().into_iter().map(member).collect(),
            directory,
            clock: Instant::now(),
            ending: false,
        }
    }

    fn now(&self) -> Now {
        self.clock.elapsed()
    }

    /// Start every stage, in order.
    pub(crate) fn start_all(&mut self) -> Result<(), FleetError> {
        let now = self.now();
        for index in 0..self.members.len() {
            let action = self.members[index].policy.start(now);
            self.act(index, action, 0)?;
        }
        Ok(())
    }

    /// Descriptors that become readable when a stage ends.
    pub(crate) fn descriptors(&self) -> Vec<BorrowedFd<'_>> {
        let processes = self
            .members
            .iter()
            .filter_map(|member| member.process.as_ref());
        processes.map(AsFd::as_fd).collect()
    }

    /// Time until some policy must look at the clock.
    pub(crate) fn time_to_deadline(&self) -> Option<Now> {
        let now = self.now();
        let deadlines = self
            .members
            .iter()
            .filter_map(|member| member.policy.deadline());
        deadlines.min().map(|deadline| deadline.saturating_sub(now))
    }

    /// Whether every stage beats as ready.
    pub(crate) fn all_running(&self) -> bool {
        let running = |member: &Member| matches!(member.policy.phase(), Phase::Running { .. });
        self.members.iter().all(running)
    }

    /// How many do, and how many there are.
    pub(crate) fn alive(&self) -> (usize, usize) {
        let running = |member: &&Member| matches!(member.policy.phase(), Phase::Running { .. });
        (
            self.members.iter().filter(running).count(),
            self.members.len(),
        )
    }

    /// Times each stage was started again.
    pub(crate) fn restarts(&self) -> impl Iterator<Item = (&'static str, u32)> + '_ {
        self.members
            .iter()
            .map(|member| (member.stage.name, member.generation.saturating_sub(1)))
    }

    /// A heartbeat came. Says whether a stage became ready by it.
    pub(crate) fn on_health(&mut self, health: &HealthSample) -> bool {
        let now = self.now();
        let Some(member) = self.members.iter_mut().find(|member| {
            member.stage.name == name_str(&health.stage)
                && member.process.as_ref().map(Process::id) == Some(health.pid)
        }) else {
            return false;
        };
        member.beat = Some(now);
        let was_running = matches!(member.policy.phase(), Phase::Running { .. });
        let event = match HealthState::from_byte(health.state) {
            HealthState::Ready => Event::BeatReady,
            HealthState::Starting | HealthState::Stopping => Event::BeatStarting,
        };
        member.policy.step(event, now);
        !was_running && event == Event::BeatReady
    }

    /// A stage published something.
    pub(crate) fn on_output(&mut self, stage: &str) {
        let now = self.now();
        if let Some(member) = self
            .members
            .iter_mut()
            .find(|member| member.stage.name == stage)
        {
            member.output = Some(now);
        }
    }

    /// Reap the dead, look at the clock, do what the policies say. New lives begin at `first_tick`.
    /// Returns the names of the stages that ended.
    pub(crate) fn tend(&mut self, first_tick: u64) -> Result<Vec<&'static str>, FleetError> {
        let mut ended = Vec::new();
        for index in 0..self.members.len() {
            if let Some(reason) = self.reap(index)? {
                let member = &self.members[index];
                tracing::warn!(stage = member.stage.name, generation = member.generation, %reason, "stage ended");
                ended.push(member.stage.name);
                self.tell(index, Event::Exited, first_tick)?;
            }
            self.tell(index, Event::Time, first_tick)?;
        }
        Ok(ended)
    }

    fn reap(&mut self, index: usize) -> Result<Option<std::process::ExitStatus>, FleetError> {
        let member = &mut self.members[index];
        let Some(process) = &mut member.process else {
            return Ok(None);
        };
        let status = process.try_reap().map_err(|source| FleetError {
            action: "reap",
            stage: member.stage.name,
            source,
        })?;
        if status.is_some() {
            member.process = None;
            member.beat = None;
        }
        Ok(status)
    }

    /// From now on a stage that ends stays down.
    pub(crate) fn want_no_more(&mut self) {
        self.ending = true;
    }

    /// Give a stage a fresh life.
    pub(crate) fn replace(&mut self, stage: &str) -> Result<(), FleetError> {
        let found = self
            .members
            .iter()
            .position(|member| member.stage.name == stage);
        found.map_or(Ok(()), |index| self.tell(index, Event::Replace, 0))
    }

    /// Stop the last stage, in start order, that still has a process. Says whether there was one.
    pub(crate) fn stop_last(&mut self) -> Result<bool, FleetError> {
        let last = self.members.iter().rposition(|member| {
            member.process.is_some() || !matches!(member.policy.phase(), Phase::Down)
        });
        if let Some(index) = last {
            let stopping = matches!(self.members[index].policy.phase(), Phase::Stopping { .. });
            if !stopping {
                self.tell(index, Event::Stop, 0)?;
            }
        }
        Ok(last.is_some())
    }

    fn tell(&mut self, index: usize, event: Event, first_tick: u64) -> Result<(), FleetError> {
        let now = self.now();
        match self.members[index].policy.step(event, now) {
            Some(action) => self.act(index, action, first_tick),
            None => Ok(()),
        }
    }

    fn act(&mut self, index: usize, action: Action, first_tick: u64) -> Result<(), FleetError> {
        let now = self.now();
        let member = &mut self.members[index];
        let stage = member.stage.name;
        let signal = match action {
            Action::Start if self.ending => {
                member.policy.step(Event::Stop, now);
                member.policy.step(Event::Exited, now);
                return Ok(());
            }
            Action::Start => {
                member.generation += 1;
                member.started = now;
                match spawn(member, &self.directory, first_tick) {
                    Ok(process) => member.process = Some(process),
                    // As if it had died at once: tried again with growing pauses, the others go on.
                    Err(error) => {
                        tracing::error!(stage, %error, "cannot be started; are processes, descriptors or disk used up?");
                        member.policy.step(Event::Exited, now);
                        member.policy.step(Event::Exited, now);
                    }
                }
                return Ok(());
            }
            Action::Terminate => Signal::TERM,
            Action::Abort => Signal::ABORT,
            Action::Kill => Signal::KILL,
        };
        if let Some(process) = &member.process {
            tracing::debug!(stage, ?signal, "signalled");
            process.signal(signal);
        }
        Ok(())
    }

    /// The rows of the `roster` topic.
    pub(crate) fn roster(&self) -> Vec<RosterEntry> {
        let now = self.now();
        let age = |then: Option<Now>| {
            then.map_or(u64::MAX, |then| now.saturating_sub(then).as_nanos() as u64)
        };
        let entry = |member: &Member| RosterEntry {
            stage: name(member.stage.name),
            pid: member.process.as_ref().map_or(0, Process::id),
            generation: member.generation,
            state: state(member.policy.phase()).into(),
            restarts: member.generation.saturating_sub(1),
            uptime_ns: age(member.process.as_ref().map(|_| member.started)),
            beat_age_ns: age(member.beat),
            output_age_ns: age(member.output),
        };
        self.members.iter().map(entry).collect()
    }
}

/// Should a supervisor end without its orderly stop, the stages still go in reverse order, each asked
/// first: the link, the last, stops the robot.
impl Drop for Fleet {
    fn drop(&mut self) {
        while let Some(member) = self.members.pop() {
            if let Some(mut process) = member.process {
                process.end(GOODBYE);
            }
        }
    }
}

const fn state(phase: Phase) -> StageState {
    match phase {
        Phase::Down => StageState::Down,
        Phase::BackingOff { .. } => StageState::BackingOff,
        Phase::Starting { .. } => StageState::Starting,
        Phase::Running { .. } => StageState::Running,
        Phase::Failing { .. } | Phase::Stopping { .. } => StageState::Stopping,
    }
}

/// A process for the member's new generation; its words go to a log in the run directory.
fn spawn(member: &Member, directory: &std::path::Path, first_tick: u64) -> io::Result<Process> {
    let log = directory.join(format!("{}.log", member.stage.name));
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
