//! Deaths, recoveries and other events on one time line.

use std::{collections::BTreeMap, fmt::Debug};

use common::{
    samples::{
        Action, Cause, CommandSample, CommandState, DeathSample, DirectiveSample, FaultKind,
        FaultSample, GuidanceSample, HealthSample, HealthState, HoldReason, LinkSample, Order,
        PoseSample, RequestKind, RequestSample, StallSample, Stamp, name_str,
    },
    topics::{EVERY_STAGE, OPERATOR, SUPERVISOR, TABLE},
};
use picture::{Lane, Symbol};
use supervisor::process::ExitCause;

/// Most events of a run. Later ones are only counted.
const MOST: usize = 2000;
/// Most events of the failsafe. It may stop the robot for moments throughout a run; other events must not be lost for it.
const MOST_OF_FAILSAFE: usize = 500;

/// Lanes besides those of the stages.
pub(crate) const FAILSAFE: &str = "failsafe";
const MAP: &str = "map";
const STALLS: &str = "stalls";

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Event {
    /// Mission time, seconds.
    pub(crate) time_s: f64,
    /// Its lane on the time line.
    pub(crate) lane: String,
    pub(crate) symbol: Symbol,
    /// Its description; empty if it is only drawn.
    pub(crate) text: String,
}

#[derive(Default)]
pub(crate) struct Events {
    /// In the order of the recording.
    pub(crate) all: Vec<Event>,
    /// Number of events beyond the limits.
    pub(crate) left_out: u64,
    spans: Vec<(String, [f64; 2])>,
    /// Since when a stage is down, and the generation that died.
    down: BTreeMap<String, (f64, u32)>,
    stopped: Option<f64>,
    failsafe: Option<(u8, u8)>,
    directive: Option<(u8, u8)>,
    arrived: u64,
    safety_events: u64,
    of_failsafe: usize,
    /// Mission time of the newest pose, seconds. A process that has just started knows no mission time.
    now_s: f64,
}

/// The stages, in the order of the pipeline.
fn stages() -> Vec<&'static str> {
    let mut stages = Vec::new();
    for topic in TABLE {
        let writer = topic.spec().writer;
        let is_stage = ![SUPERVISOR, OPERATOR, EVERY_STAGE].contains(&writer);
        if is_stage && !stages.contains(&writer) {
            stages.push(writer);
        }
    }
    stages
}

impl Events {
    fn add(&mut self, stamp: &Stamp, lane: &str, symbol: Symbol, text: String) {
        let is_failsafe = lane == FAILSAFE;
        let (count, most) = if is_failsafe {
            (self.of_failsafe, MOST_OF_FAILSAFE)
        } else {
            (self.all.len() - self.of_failsafe, MOST)
        };
        if count == most {
            self.left_out += 1;
            return;
        }
        self.of_failsafe += usize::from(is_failsafe);
        self.all.push(Event { time_s: self.time_s(stamp), lane: lane.to_owned(), symbol, text });
    }

    fn time_s(&self, stamp: &Stamp) -> f64 {
        stamp.time().seconds().max(self.now_s)
    }

    /// Advance the time.
    pub(crate) fn pose(&mut self, pose: &PoseSample) {
        self.now_s = self.now_s.max(pose.stamp.time().seconds());
    }

    fn add_span(&mut self, lane: &str, from: f64, to: f64) {
        if self.spans.len() < MOST {
            self.spans.push((lane.to_owned(), [from, to]));
        }
    }

    pub(crate) fn death(&mut self, death: &DeathSample) {
        let stage = name_str(&death.stage);
        let hung = if death.hung == 1 { "hung, " } else { "" };
        let log_tail = match death.log_tail.text().trim() {
            "" => String::new(),
            tail => format!("; its log ends: {tail}"),
        };
        let (generation, cause) = (death.generation, ExitCause::from(death));
        let text = format!("generation {generation} died ({hung}{cause}){log_tail}");
        self.add(&death.stamp, stage, Symbol::Death, text);
        // The recording may contain any name; only the stages' names are stored.
        if stages().contains(&stage) {
            let time = self.time_s(&death.stamp);
            self.down
                .entry(stage.to_owned())
                .and_modify(|(_, dead)| *dead = generation)
                .or_insert((time, generation));
        }
    }

    pub(crate) fn health(&mut self, health: &HealthSample) {
        let stage = name_str(&health.stage);
        let Some(&(since, dead)) = self.down.get(stage) else {
            return;
        };
        let generation = health.stamp.generation;
        if generation <= dead || HealthState::from_byte(health.state) != HealthState::Ready {
            return;
        }
        self.down.remove(stage);
        let time = self.time_s(&health.stamp);
        self.add_span(stage, since, time.max(since));
        let text = format!("generation {generation} is ready");
        self.add(&health.stamp, stage, Symbol::Ready, text);
    }

    pub(crate) fn link(&mut self, link: &LinkSample) {
        let time = self.time_s(&link.stamp);
        match (self.stopped, link.stopped()) {
            (None, true) => self.stopped = Some(time),
            (Some(since), false) => {
                self.stopped = None;
                self.add_span(FAILSAFE, since, time.max(since));
            }
            _ => {}
        }
        if self.failsafe.replace((link.action, link.cause)) != Some((link.action, link.cause)) {
            let text = match (link.action(), link.cause()) {
                (Action::Go, _) => "commands pass".to_owned(),
                (action, Cause::None) => words(action),
                (action, cause) => format!("{}: {}", words(action), cause.name()),
            };
            self.add(&link.stamp, FAILSAFE, Symbol::Event, text);
        }
    }

    pub(crate) fn directive(&mut self, directive: &DirectiveSample) {
        let now = (directive.order, directive.reason);
        if self.directive.replace(now) != Some(now) {
            let order = words(Order::from_byte(directive.order));
            let text = match HoldReason::from_byte(directive.reason) {
                HoldReason::None => format!("order: {order}"),
                reason => format!("order: {order} ({})", words(reason)),
            };
            self.add(&directive.stamp, SUPERVISOR, Symbol::Event, text);
        }
    }

    pub(crate) fn stall(&mut self, stall: &StallSample) {
        let text = format!(
            "the robot does not get on ({}): {}",
            words(stall.cause()),
            words(stall.recovery())
        );
        self.add(&stall.stamp, STALLS, Symbol::Event, text);
    }

    pub(crate) fn request(&mut self, request: &RequestSample) {
        let targets = request.targets().unwrap_or_default().iter();
        let targets: String =
            targets.map(|at| format!(" ({:.2}, {:.2})", at.x_m, at.y_m)).collect();
        let kind = words(RequestKind::from_byte(request.kind));
        let text = format!("{kind} {}{targets}", name_str(&request.stage));
        self.add(&request.stamp, OPERATOR, Symbol::Request, text);
    }

    pub(crate) fn fault(&mut self, fault: &FaultSample) {
        let text = format!(
            "fault {} in {}",
            words(FaultKind::from_byte(fault.kind)),
            name_str(&fault.stage)
        );
        self.add(&fault.stamp, OPERATOR, Symbol::Request, text);
    }

    pub(crate) fn guidance(&mut self, guidance: &GuidanceSample) {
        if guidance.safety_events > self.safety_events {
            self.safety_events = guidance.safety_events;
            // The map shows these events; a list would be long.
            self.add(&guidance.stamp, MAP, Symbol::Event, String::new());
        }
    }

    pub(crate) fn command(&mut self, command: &CommandSample) {
        let arrived = CommandState::from_byte(command.state) == CommandState::Arrived;
        if arrived && self.arrived != command.target_number {
            self.arrived = command.target_number;
            let text = format!("target {} is reached", command.target_number);
            self.add(&command.stamp, "controller", Symbol::Event, text);
        }
    }

    /// The lanes of a run that took `duration_s`.
    pub(crate) fn lanes(&self, duration_s: f64) -> Vec<Lane> {
        let others = [FAILSAFE, SUPERVISOR, OPERATOR, STALLS, MAP];
        let open = self.down.iter().map(|(stage, (since, _))| (&**stage, since));
        let open = open.chain(self.stopped.iter().map(|since| (FAILSAFE, since)));
        let open: Vec<_> = open.collect();
        let lane = |name: &str| Lane {
            name: name.to_owned(),
            spans: self
                .spans
                .iter()
                .filter(|(lane, _)| lane == name)
                .map(|(_, ends)| *ends)
                .chain(
                    open.iter()
                        .filter(|(lane, _)| *lane == name)
                        .map(|(_, since)| [**since, duration_s.max(**since)]),
                )
                .collect(),
            // The failsafe's events are the ends of its spans.
            marks: self
                .all
                .iter()
                .filter(|event| event.lane == name && name != FAILSAFE)
                .map(|event| (event.time_s, event.symbol))
                .collect(),
        };
        let stages = stages().into_iter().map(lane);
        let others = others.into_iter().map(lane);
        let others = others.filter(|lane| !lane.marks.is_empty() || !lane.spans.is_empty());
        stages.chain(others).collect()
    }
}

/// `CommandStale` as `command stale`.
fn words(of: impl Debug) -> String {
    let mut words = String::new();
    for character in format!("{of:?}").chars() {
        if character.is_uppercase() && !words.is_empty() {
            words.push(' ');
        }
        words.extend(character.to_lowercase());
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;
    use common::samples::{DeathCause, name};

    fn stamp(seconds: u64, generation: u32) -> Stamp {
        Stamp { stamp_ns: seconds * 1_000_000_000, generation, ..Stamp::default() }
    }

    fn health(seconds: u64, generation: u32) -> HealthSample {
        HealthSample {
            stamp: stamp(seconds, generation),
            stage: name("planner"),
            state: HealthState::Ready.into(),
            ..HealthSample::default()
        }
    }

    #[test]
    fn a_stage_is_down_from_its_death_until_its_successor_is_ready() {
        let mut events = Events::default();
        events.death(&DeathSample {
            stamp: stamp(3, 0),
            stage: name("planner"),
            generation: 1,
            cause: DeathCause::Signalled.into(),
            code: 9,
            ..DeathSample::default()
        });
        // The last heartbeat of the dead one, read after its death.
        events.health(&health(3, 1));
        // A process that has just started knows no mission time yet.
        events.pose(&PoseSample { stamp: stamp(5, 1), ..PoseSample::default() });
        events.health(&health(0, 2));
        events.health(&health(6, 2));
        let lanes = events.lanes(9.0);
        let planner = lanes.iter().find(|lane| lane.name == "planner").unwrap();
        assert_eq!(planner.spans, [[3.0, 5.0]]);
        assert_eq!(planner.marks, [(3.0, Symbol::Death), (5.0, Symbol::Ready)]);
        assert_eq!(events.all[0].text, "generation 1 died (signal 9)");
    }

    #[test]
    fn of_very_many_events_the_first_are_kept_and_the_others_counted() {
        let mut events = Events::default();
        let death = DeathSample::default();
        (0..MOST + 5).for_each(|_| events.death(&death));
        assert_eq!((events.all.len(), events.left_out), (MOST, 5));
    }
}
