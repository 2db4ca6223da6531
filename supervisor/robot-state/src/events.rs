//! Deaths, recoveries, orders and log lines as one list.

use std::collections::{BTreeMap, VecDeque};

use common::samples::{
    Cause, CommandSample, CommandState, ComplaintSample, DeathSample, DirectiveSample, FaultSample,
    FollowState, FollowingSample, HoldReason, LinkSample, RequestAnswer, RequestSample,
    RosterEntry, StageState, StallSample, TargetSample, name_str,
};
use serde::Serialize;

use crate::{
    sample::Sample,
    words::{death_in_words, failsafe_in_words, words},
};

/// Most letters of a text.
const LONGEST: usize = 300;
const MOST_WAITING: usize = 20_000;

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Event {
    /// Mission time, seconds.
    pub t: f64,
    /// Stage or part of the system that the event is about.
    pub of: String,
    pub kind: Kind,
    pub text: String,
}

impl Event {
    /// Returns whether a process died or the robot stalled.
    pub fn is_recovery(&self) -> bool {
        self.kind == Kind::Bad && self.of != FAILSAFE
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Death, stall or stop.
    Bad,
    /// Problem that a person must solve.
    Warn,
    Good,
    Note,
    Log,
}

const FAILSAFE: &str = "failsafe";

#[derive(Clone, Debug, Default)]
pub(crate) struct Events {
    waiting: VecDeque<Event>,
    failsafe: Option<(u8, u8)>,
    directive: Option<(u8, u8)>,
    /// Newest complaint; only changes are events.
    complaint: String,
    /// Numbers of the current, last and reached targets.
    target: u64,
    last: u64,
    arrived: u64,
    follows: bool,
    /// Generation of each stage seen to run.
    running: BTreeMap<String, u32>,
    /// Mission time of the newest pose, seconds, for new processes.
    pub now_s: f64,
    at_s: f64,
}

impl Events {
    pub(crate) fn drain(&mut self) -> Vec<Event> {
        self.waiting.drain(..).collect()
    }

    fn add(&mut self, of: &str, kind: Kind, text: impl Into<String>) {
        let mut text = text.into();
        if let Some((cut, _)) = text.char_indices().nth(LONGEST) {
            text.truncate(cut);
            text.push('…');
        }
        if self.waiting.len() == MOST_WAITING {
            self.waiting.pop_front();
        }
        assert!(self.waiting.len() < MOST_WAITING);
        self.waiting.push_back(Event { t: self.at_s, of: of.to_owned(), kind, text });
    }

    pub(crate) fn sample(&mut self, sample: &Sample) {
        if let Sample::Pose(pose) = sample {
            self.now_s = self.now_s.max(pose.stamp.seconds());
        }
        self.at_s = match sample {
            // A new process reads earlier single events late.
            Sample::Death(_) | Sample::Stall(_) | Sample::Order(_) | Sample::Fault(_) => {
                sample.time().seconds()
            }
            _ => self.now_s,
        };
        match sample {
            Sample::Command(command) => self.command(command),
            Sample::Following(following) => self.following(following),
            Sample::Target(target) => self.target(target),
            Sample::Roster(_, entries) => self.roster(entries),
            Sample::Death(death) => self.death(death),
            Sample::Directive(directive) => self.directive(directive),
            Sample::Stall(stall) => self.stall(stall),
            Sample::Order(request) => self.request(request),
            Sample::Fault(fault) => self.fault(fault),
            Sample::Link(link) => self.link(link),
            Sample::Complaint(complaint) => self.complaint(complaint),
            _ => {}
        }
    }

    fn death(&mut self, death: &DeathSample) {
        let hung = if death.hung == 1 { "hung, " } else { "" };
        let log_tail = match death.log_tail.text().trim() {
            "" => String::new(),
            tail => format!("; its log ends: {tail}"),
        };
        let (generation, cause) = (death.generation, death_in_words(death));
        self.add(
            name_str(&death.stage),
            Kind::Bad,
            format!("generation {generation} died ({hung}{cause}){log_tail}"),
        );
    }

    fn roster(&mut self, entries: &[RosterEntry]) {
        let running = entries.iter().filter(|entry| entry.state() == StageState::Running);
        for RosterEntry { stage, generation, .. } in running {
            let name = name_str(stage);
            if self.running.insert(name.to_owned(), *generation) != Some(*generation) {
                self.add(name, Kind::Good, format!("generation {generation} runs"));
            }
        }
    }

    fn link(&mut self, link: &LinkSample) {
        let now = (link.action, link.cause);
        if self.failsafe.replace(now) != Some(now) {
            self.add(FAILSAFE, self.kind(link), failsafe_in_words(link));
        }
    }

    pub(crate) fn kind(&self, link: &LinkSample) -> Kind {
        match link.cause() {
            Cause::NotOrdered => Kind::Note,
            Cause::MissionOver if self.last > 0 && self.arrived == self.last => Kind::Good,
            _ if link.stopped() => Kind::Bad,
            _ => Kind::Good,
        }
    }

    fn complaint(&mut self, complaint: &ComplaintSample) {
        let text = complaint.refusal().to_string();
        if self.complaint != text {
            self.complaint.clone_from(&text);
            self.add(name_str(&complaint.stage), Kind::Warn, text);
        }
    }

    fn directive(&mut self, directive: &DirectiveSample) {
        let now = (directive.order, directive.reason);
        if self.directive.replace(now) == Some(now) {
            return;
        }
        let order = words(directive.order());
        let text = match directive.reason() {
            HoldReason::None => format!("order: {order}"),
            reason => format!("order: {order} ({})", words(reason)),
        };
        self.add("supervisor", Kind::Note, text);
    }

    fn stall(&mut self, stall: &StallSample) {
        let (cause, recovery) = (words(stall.cause()), words(stall.recovery()));
        self.add("stalls", Kind::Bad, format!("no progress ({cause}): {recovery}"));
    }

    fn request(&mut self, request: &RequestSample) {
        let targets: String = request
            .targets()
            .unwrap_or_default()
            .iter()
            .map(|at| format!("({:.2}, {:.2}) ", at.x_m, at.y_m))
            .collect();
        let kind = words(request.kind());
        let asked = format!("{kind} {}{targets}", name_str(&request.stage));
        let asked = asked.trim_end();
        match request.answer() {
            RequestAnswer::Taken => self.add("operator", Kind::Note, asked),
            answer => {
                self.add("operator", Kind::Bad, format!("{asked}, refused: {}", answer.text()));
            }
        }
    }

    fn fault(&mut self, fault: &FaultSample) {
        let kind = words(fault.kind());
        self.add("operator", Kind::Note, format!("fault {kind} in {}", name_str(&fault.stage)));
    }

    fn target(&mut self, target: &TargetSample) {
        self.last = target.last;
        if std::mem::replace(&mut self.target, target.number) == target.number || self.follows {
            return;
        }
        let at = target.target.position();
        self.add(
            "supervisor",
            Kind::Note,
            format!("target {}: ({:.2}, {:.2})", target.number, at.x, at.y),
        );
    }

    fn following(&mut self, following: &FollowingSample) {
        let follows = following.state() != FollowState::Ended;
        if std::mem::replace(&mut self.follows, follows) && !follows {
            self.add("supervisor", Kind::Note, following.result());
        }
    }

    fn command(&mut self, command: &CommandSample) {
        let arrived = command.state() == CommandState::Arrived;
        if arrived && self.arrived != command.target_number && !self.follows {
            self.arrived = command.target_number;
            self.add(
                "controller",
                Kind::Good,
                format!("target {} is reached", command.target_number),
            );
        }
    }

    pub(crate) fn log(&mut self, process: &str, line: &str, at_s: Option<f64>) {
        self.at_s = at_s.unwrap_or(self.now_s);
        self.add(process, Kind::Log, line);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use common::{
        bus::Stamp,
        samples::{DeathCause, PoseSample, RosterHeader, name},
    };

    #[test]
    fn a_death_and_the_successor_that_runs_are_told_once_each() {
        let mut events = Events::default();
        let mut entry = RosterEntry {
            stage: name("planner"),
            generation: 1,
            state: StageState::Running.into(),
            ..RosterEntry::default()
        };
        let roster = |entry| Sample::Roster(RosterHeader::default(), vec![entry]);
        events.sample(&roster(entry));
        events.sample(&Sample::Death(DeathSample {
            stage: name("planner"),
            generation: 1,
            cause: DeathCause::Signalled.into(),
            code: 9,
            ..DeathSample::default()
        }));
        entry.generation = 2;
        events.sample(&roster(entry));
        events.sample(&roster(entry));
        let told: Vec<_> = events.drain().into_iter().map(|event| event.text).collect();
        let died = "generation 1 died (signal 9)";
        assert_eq!(told, ["generation 1 runs", died, "generation 2 runs"]);
        assert!(events.drain().is_empty());
    }

    #[test]
    fn a_death_that_is_read_late_has_the_time_at_which_it_happened() {
        let mut events = Events::default();
        let mut stamp = Stamp { stamp_ns: 60_000_000_000, ..Stamp::default() };
        events.sample(&Sample::Pose(PoseSample { stamp, ..PoseSample::default() }));
        stamp.stamp_ns = 7_000_000_000;
        events.sample(&Sample::Death(DeathSample { stamp, ..DeathSample::default() }));
        assert_eq!(events.drain()[0].t, 7.0);
    }

    #[test]
    fn a_long_line_of_a_log_is_cut_between_letters() {
        let mut events = Events::default();
        events.log("mapper", &"ö".repeat(1000), None);
        assert_eq!(events.drain()[0].text.chars().count(), LONGEST + 1);
    }
}
