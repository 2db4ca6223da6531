//! Roll call: how the stages are, and what of one that died is told.

use common::samples::{RosterEntry, StageState, name};

use super::{Member, StageProcesses, log_file};
use crate::{
    death::{self, Cause, Death, Next},
    policy::{Now, Phase},
    process::Process,
};

impl Member {
    /// Whether it beats as ready.
    pub(super) fn is_running(&self) -> bool {
        matches!(self.policy.phase(), Phase::Running { .. })
    }
}

impl StageProcesses {
    /// Whether every stage beats as ready.
    pub fn all_running(&self) -> bool {
        self.members.iter().all(Member::is_running)
    }

    /// Whether one is on its way there, or will be in a moment.
    pub fn any_starting(&self) -> bool {
        let starting = |member: &Member| {
            matches!(
                member.policy.phase(),
                Phase::Starting { .. } | Phase::BackingOff { .. }
            )
        };
        self.members.iter().any(starting)
    }

    /// How many do, and how many there are.
    pub fn alive(&self) -> (usize, usize) {
        let running = self.members.iter().filter(|member| member.is_running());
        (running.count(), self.members.len())
    }

    /// The stages that do not.
    pub fn missing(&self) -> Vec<&'static str> {
        let missing = self.members.iter().filter(|member| !member.is_running());
        missing.map(|member| member.stage.name).collect()
    }

    /// Times each stage was started again.
    pub fn restarts(&self) -> impl Iterator<Item = (&'static str, u32)> + '_ {
        self.members
            .iter()
            .map(|member| (member.stage.name, member.generation.saturating_sub(1)))
    }

    /// What is known of the life that has just ended, besides what follows.
    pub(super) fn record(&self, index: usize, cause: Cause) -> Death {
        let member = &self.members[index];
        let now = self.now();
        let age = |then: Now| now.saturating_sub(then).as_secs_f64();
        let log = log_file(&self.directory, member.stage.name);
        Death {
            stage: member.stage.name,
            pid: member.process.as_ref().map_or(0, Process::id),
            generation: member.generation,
            cause,
            hung: member.hung.is_some(),
            noticed_after_s: member
                .hung
                .zip(member.beat)
                .map(|(seen, beat)| seen.saturating_sub(beat).as_secs_f64()),
            beat_age_s: member.beat.map(age),
            uptime_s: age(member.started),
            deaths_in_window: 0,
            next: Next::Nothing,
            last_words: death::last_words(&log, member.log_began),
        }
    }

    /// What the policy has in mind for a stage that has just died.
    pub(super) fn next(&self, index: usize) -> Next {
        match self.members[index].policy.phase() {
            Phase::BackingOff { until } => Next::StartLater {
                after_s: until.saturating_sub(self.now()).as_secs_f64(),
            },
            Phase::Held => Next::Hold,
            Phase::Down | Phase::Stopping { .. } => Next::Nothing,
            Phase::Starting { .. }
            | Phase::Running { .. }
            | Phase::Late { .. }
            | Phase::Replaced { .. } => Next::StartNow,
        }
    }

    /// The stages that only an operator's word starts again.
    pub fn held(&self) -> impl Iterator<Item = &'static str> + '_ {
        let members = self.members.iter();
        let held = members.filter(|member| member.policy.phase() == Phase::Held);
        held.map(|member| member.stage.name)
    }

    /// The rows of the `roster` topic.
    pub fn roster(&self) -> Vec<RosterEntry> {
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

const fn state(phase: Phase) -> StageState {
    match phase {
        Phase::Down => StageState::Down,
        Phase::BackingOff { .. } => StageState::BackingOff,
        Phase::Starting { .. } => StageState::Starting,
        Phase::Running { .. } => StageState::Running,
        Phase::Late { .. } | Phase::Replaced { .. } | Phase::Stopping { .. } => {
            StageState::Stopping
        }
        Phase::Held => StageState::Held,
    }
}
