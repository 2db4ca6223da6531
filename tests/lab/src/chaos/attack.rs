//! Attacker of one mission.

use std::time::{Duration, Instant};

use common::{
    bus::{AnyReader, AnyTopic, Bus, BusError, Reader},
    clock::MissionTime,
    domain::RobotName,
    roster::Roster,
    samples::{DeathSample, HealthSample, HealthState, Order, RosterEntry, StageState, name_str},
    topics::{self, SUPERVISOR},
};
use mission_control::{simulator::Simulator, surroundings::SimulatedRobot as _};
use processes::{
    policy::{HOLD_AFTER, HOLD_WINDOW},
    process::Process,
};
use rustix::process::{Pid, Signal, kill_process};

use super::{
    consumers::Consumers,
    report::{Row, Series, ms_since},
    schedule::Kind,
};
use crate::error::{OrCannot as _, Result};

const POLL: Duration = Duration::from_millis(50);
/// Maximum signals to a stage within the hold rule's window, after which a stage is held. A second
/// signal may follow at start-up, and each may be counted late.
const MOST_HITS: usize = HOLD_AFTER - 4;

#[derive(Default)]
pub struct Attack {
    seed: u64,
    time: Option<MissionTime>,
    consumers: Consumers,
    entries: Vec<RosterEntry>,
    supervisor: u32,
    /// Number of supervisors until now; each has its own bus.
    supervisors: u32,
    driving: bool,
    sent: Vec<Sent>,
    kept: usize,
}

struct Sent {
    row: Row,
    at: Instant,
    pending: bool,
    /// Delay of a second hit after the successor's start.
    startup_hit: Option<Duration>,
}

impl Attack {
    pub fn new(seed: u64, consumers: Consumers) -> Self {
        Self { seed, consumers, ..Self::default() }
    }

    /// Attacks one generation of the supervisor, `child`, until it ends, for at most `patience`.
    pub fn run(
        &mut self,
        series: &mut Series,
        child: &mut Process,
        mut robot: Option<&mut Simulator>,
        patience: Duration,
    ) -> Result {
        let began = Instant::now();
        self.supervisors += 1;
        self.driving = false;
        self.entries.clear();
        // A hit supervisor's stages end with it.
        for sent in &mut self.sent {
            sent.pending &= sent.row.stage == SUPERVISOR;
        }
        let mut joined = None;
        while child.try_reap().or_cannot("reap")?.is_none() && began.elapsed() < patience {
            self.consumers.maintain(&mut series.report)?;
            let Some(subscriptions) = &mut joined else {
                joined = Subscriptions::join(&series.asked.robot, child.id()).ok().flatten();
                if joined.is_none() {
                    std::thread::park_timeout(POLL);
                }
                continue;
            };
            let due = series.next_hit.checked_duration_since(Instant::now()).unwrap_or(POLL);
            subscriptions.roster.waiter.wait(due.min(POLL))?;
            if let Some(robot) = &mut robot {
                robot.poll()?;
            }
            self.read(subscriptions)?;
            self.hit_starting(series);
            if Instant::now() >= series.next_hit && self.driving && !series.is_over() {
                self.hit(series)?;
                series.next_hit = Instant::now() + series.schedule.pause();
            }
            self.keep_rows(series)?;
        }
        Ok(())
    }

    fn keep_rows(&mut self, series: &mut Series) -> Result {
        while let Some(sent) = self.sent.get(self.kept).filter(|sent| !sent.pending) {
            series.keep(sent.row.clone())?;
            self.kept += 1;
        }
        Ok(())
    }

    pub fn end(&mut self, series: &mut Series) -> Result {
        self.consumers.end();
        self.sent.iter_mut().for_each(|sent| sent.pending = false);
        self.keep_rows(series)
    }

    fn note(
        &mut self,
        series: &mut Series,
        (stage, generation): (&str, Option<u32>),
        kind: Kind,
        pending: bool,
    ) {
        series.report.signals += 1;
        let row = Row {
            mission: self.seed,
            time_s: self.time.map(MissionTime::seconds),
            stage: stage.to_owned(),
            kind,
            generation,
            start_up: kind == Kind::KillAtStart,
            ..Row::default()
        };
        self.sent.push(Sent { row, at: Instant::now(), pending, startup_hit: None });
    }

    pub fn supervisor_is_down(&mut self) -> bool {
        self.pending(SUPERVISOR).is_some()
    }

    /// Returns the signal from which `stage` recovers. It gets no other meanwhile.
    fn pending(&mut self, stage: &str) -> Option<&mut Sent> {
        self.sent.iter_mut().find(|sent| sent.pending && sent.row.stage == stage)
    }

    /// Returns whether a generation was frozen alone, and may be aborted.
    pub fn was_frozen(&self, stage: &str, generation: u32) -> bool {
        self.sent.iter().any(|Sent { row, .. }| {
            row.kind == Kind::Freeze && row.stage == stage && row.generation == Some(generation)
        })
    }

    fn read(&mut self, subscriptions: &mut Subscriptions) -> Result {
        while let Some(death) = subscriptions.deaths.next_sample()? {
            if let Some(Sent { row, at, .. }) = self.pending(name_str(&death.stage))
                && row.generation == Some(death.generation)
            {
                row.noticed_ms.get_or_insert_with(|| ms_since(*at));
            }
        }
        while let Some(entries) = subscriptions.roster.samples.next_slice()? {
            self.driving = entries.header().order() == Order::Drive;
            self.supervisor = entries.header().supervisor_pid;
            self.entries = entries.to_vec();
            if self.driving {
                self.on_sign(SUPERVISOR, self.supervisors, true);
            }
        }
        while let Some(health) = subscriptions.health.next_sample()? {
            if health.state() == HealthState::Ready {
                self.on_sign(name_str(&health.stage), health.stamp.generation, true);
            }
        }
        for (writer, reader) in &mut subscriptions.outputs {
            while let Some((_, stamp)) = reader.next_stamp()? {
                self.time = self.time.max(Some(stamp.time()));
                self.on_sign(writer, stamp.generation, false);
                if *writer == topics::COMMAND.spec().writer {
                    self.on_sign(SUPERVISOR, self.supervisors, false);
                }
            }
        }
        Ok(())
    }

    fn on_sign(&mut self, stage: &str, generation: u32, beat: bool) {
        if let Some(Sent { row, at, pending, .. }) = self.pending(stage)
            && Some(generation) > row.generation
        {
            row.ready_ms.get_or_insert_with(|| ms_since(*at));
            row.first_output_ms = (!beat).then(|| ms_since(*at));
            *pending = beat;
        }
    }

    fn freeze_all(&mut self, pause: Duration, series: &mut Series) {
        // The supervisor freezes first and thaws last, so that it never sees frozen stages. A stage
        // frozen alone stays frozen.
        let thaws = |it: &&RosterEntry| !self.was_frozen(name_str(&it.stage), it.generation);
        let stages = self.entries.iter().filter(thaws).map(|entry| entry.pid);
        let mut all = vec![self.supervisor];
        all.extend(stages);
        all.retain(|&process| send(process, Signal::STOP));
        let began = Instant::now();
        std::thread::sleep(pause);
        for process in all.into_iter().rev() {
            send(process, Signal::CONT);
        }
        // The pause is excluded from recovery times.
        for sent in self.sent.iter_mut().filter(|sent| sent.pending) {
            sent.at += began.elapsed();
        }
        self.note(series, ("everything", None), Kind::FreezeAll, false);
    }

    fn hit(&mut self, series: &mut Series) -> Result {
        let Series { asked, schedule, report, .. } = series;
        if let Some((index, kind, pause)) = schedule.consumer(self.consumers.len()) {
            if let Some((name, starts)) = self.consumers.hit(index, kind, pause, report)? {
                self.note(series, (&name, Some(starts)), kind, false);
            }
        } else if asked.include_supervisor
            && let Some(kind) = schedule.supervisor()
        {
            if !self.supervisor_is_down() && send(self.supervisor, kind.signal()) {
                self.note(series, (SUPERVISOR, Some(self.supervisors)), kind, true);
                self.driving = false;
            }
        } else if asked.freeze_all
            && let Some(pause) = schedule.freeze_all()
        {
            self.freeze_all(pause, series);
        } else {
            let (stage, kind) = (schedule.stage(), schedule.kind());
            let is_followed = asked.include_startup && kind != Kind::Freeze;
            let startup_hit = schedule.startup_hit().filter(|_| is_followed);
            let running = |entry: &&RosterEntry| {
                name_str(&entry.stage) == stage && entry.state() == StageState::Running
            };
            let lately = |sent: &&Sent| sent.row.stage == stage && sent.at.elapsed() < HOLD_WINDOW;
            if let Some(&RosterEntry { pid, generation, .. }) = self.entries.iter().find(running)
                && self.pending(stage).is_none()
                && self.sent.iter().filter(lately).count() < MOST_HITS
                && send(pid, kind.signal())
            {
                self.note(series, (stage, Some(generation)), kind, true);
                if let Some(sent) = self.pending(stage) {
                    sent.startup_hit = startup_hit;
                }
            }
        }
        Ok(())
    }

    /// Kills successors within their first milliseconds.
    fn hit_starting(&mut self, series: &mut Series) {
        for entry in self.entries.clone() {
            let stage = name_str(&entry.stage);
            if let Some(sent) = self.pending(stage)
                && Some(entry.generation) > sent.row.generation
                && entry.pid != 0
                && let Some(age) = sent.startup_hit.take()
            {
                std::thread::sleep(age.saturating_sub(Duration::from_nanos(entry.uptime_ns)));
                if send(entry.pid, Signal::KILL) {
                    sent.pending = false;
                    self.note(series, (stage, Some(entry.generation)), Kind::KillAtStart, true);
                }
            }
        }
    }
}

fn send(pid: u32, signal: Signal) -> bool {
    Pid::from_raw(pid.cast_signed()).is_some_and(|pid| kill_process(pid, signal).is_ok())
}

struct Subscriptions {
    roster: Roster,
    deaths: Reader<DeathSample>,
    health: Reader<HealthSample>,
    outputs: Vec<(&'static str, Box<dyn AnyReader>)>,
}

impl Subscriptions {
    /// Joins the bus of `supervisor`; none for another's. A killed supervisor leaves its bus until
    /// its successor removes it.
    fn join(robot: &RobotName, supervisor: u32) -> Result<Option<Self>> {
        let bus = Bus::join(&robot.domain(), "chaos")?;
        let mut roster = Roster::open(&bus)?;
        let wakes: [&dyn AnyTopic; 3] = [&topics::DEATHS, &topics::HEALTH, &topics::COMMAND];
        for topic in wakes {
            roster.waiter.on(bus.wakeup(topic)?);
        }
        let outputs: [&dyn AnyTopic; 5] =
            [&topics::WHEELS, &topics::POSE, &topics::GRID, &topics::GUIDANCE, &topics::COMMAND];
        let outputs = outputs.iter().map(|it| Ok((it.spec().writer, it.any_reader(&bus)?)));
        let mut subscriptions = Self {
            roster,
            deaths: bus.reader(&topics::DEATHS)?,
            health: bus.reader(&topics::HEALTH)?,
            outputs: outputs.collect::<Result<_, BusError>>()?,
        };
        let found = subscriptions.roster.find(2 * topics::RESTATE, |header, _| {
            (header.supervisor_pid == supervisor).then_some(())
        })?;
        Ok(found.map(|()| subscriptions))
    }
}
