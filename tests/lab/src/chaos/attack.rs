//! The attacker of one mission: sends signals, and waits for the successors to work.

use std::time::{Duration, Instant};

use common::{
    bus::{AnyReader, AnyTopic, Bus, BusError, Reader},
    clock::MissionTime,
    domain::Domain,
    ground_truth::GroundTruthTick,
    roster::Roster,
    samples::{
        DeathSample, HealthSample, HealthState, Order, PoseSample, RosterEntry, RosterHeader,
        StageState, WheelSample, name_str,
    },
    topics::{self, SUPERVISOR},
};
use mission_control::simulator::Simulator;
use processes::{
    policy::{HOLD_AFTER, HOLD_WINDOW},
    process::Process,
    stages,
};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

use super::{
    consumers::Consumers,
    options::Options,
    report::{EVERYTHING, Report, Series},
    schedule::Kind,
    signals::{Row, ms_since},
};
use crate::error::{OrCannot as _, Result};

/// Wait for the bus between checks of the processes.
const POLL: Duration = Duration::from_millis(50);
/// Signals to one stage within the window of the hold rule. A stage that dies more often is held until an operator releases
/// it, and chaos has no operator. A second signal may follow in the start-up, and each may be counted late.
const MOST_HITS: usize = HOLD_AFTER - 4;

#[derive(Default)]
pub struct Attack {
    seed: u64,
    time: Option<MissionTime>,
    pub consumers: Consumers,
    entries: Vec<RosterEntry>,
    /// The time when they were read.
    entries_read: Option<Instant>,
    supervisor: u32,
    /// Whether the supervisor was hit. Later samples of it and its stages are no sign of its successor.
    supervisor_hit: bool,
    driving: bool,
    pending: Vec<PendingRecovery>,
    /// Signals whose measurement is complete.
    measured: Vec<Row>,
    /// Generations that were frozen alone. The supervisor may abort these as hung.
    frozen: Vec<(&'static str, u32)>,
    hits: Vec<(&'static str, Instant)>,
    pose: Option<PoseSample>,
}

impl Attack {
    pub fn new(seed: u64, consumers: Consumers) -> Self {
        Self { seed, consumers, ..Self::default() }
    }

    /// Attack one generation of the supervisor, `child`, until it ends, for at most `patience`.
    pub fn run(
        &mut self,
        series: &mut Series<'_>,
        child: &mut Process,
        mut robot: Option<&mut Simulator>,
        patience: Duration,
    ) -> Result {
        let began = Instant::now();
        self.supervisor_hit = false;
        self.driving = false;
        self.entries.clear();
        // The stages of a supervisor that was hit end with it.
        let is_stage = |recovery: &mut PendingRecovery| recovery.row.stage != SUPERVISOR;
        let ended = self.pending.extract_if(.., is_stage);
        self.measured.extend(ended.map(|recovery| recovery.row));
        let mut subscriptions = loop {
            self.consumers.maintain(&mut series.report)?;
            if child.try_reap().or_cannot("reap")?.is_some() || began.elapsed() >= patience {
                return Ok(());
            }
            match Subscriptions::join(series.options, child.id()) {
                Ok(Some(subscriptions)) => break subscriptions,
                // The bus does not exist yet.
                Ok(None) | Err(_) => std::thread::park_timeout(POLL),
            }
        };
        let mut next = Instant::now() + series.schedule.pause();
        while child.try_reap().or_cannot("reap")?.is_none() && began.elapsed() < patience {
            // An overdue hit waits for the robot to drive.
            let due = next.checked_duration_since(Instant::now());
            let startup_hit = self.next_startup_hit();
            let startup_hit =
                startup_hit.map_or(POLL, |(at, ..)| at.saturating_duration_since(Instant::now()));
            let timeout = due.unwrap_or(POLL).min(startup_hit);
            subscriptions.roster.waiter.wait(timeout.min(POLL))?;
            if let Some(robot) = &mut robot {
                robot.poll()?;
            }
            self.read(&mut subscriptions)?;
            self.hit_starting(&mut series.report);
            if Instant::now() >= next && self.driving && !series.is_over() {
                let pause = series.schedule.pause();
                self.hit(series)?;
                next = Instant::now() + pause;
            }
            self.consumers.maintain(&mut series.report)?;
            self.keep_measured(series)?;
        }
        Ok(())
    }

    /// Write the rows of the signals whose measurement is complete.
    fn keep_measured(&mut self, series: &mut Series<'_>) -> Result {
        self.measured.drain(..).try_for_each(|row| series.keep(row))
    }

    /// Note that the mission is over, and end all measurements.
    pub fn end(&mut self, series: &mut Series<'_>) -> Result {
        self.consumers.end();
        let pending = self.pending.drain(..);
        self.measured.extend(pending.map(|recovery| recovery.row));
        self.keep_measured(series)
    }

    /// The row of a signal of `kind` that is sent to a generation of `stage` now.
    fn row(&self, stage: &str, kind: Kind, generation: Option<u32>) -> Row {
        Row {
            mission: self.seed,
            time_s: self.time.map(MissionTime::seconds),
            stage: stage.to_owned(),
            kind,
            generation,
            start_up: kind == Kind::KillAtStart,
            ..Row::default()
        }
    }

    /// Whether the supervisor was hit and has no working successor yet.
    pub fn supervisor_is_down(&self) -> bool {
        self.is_recovering(SUPERVISOR)
    }

    fn is_recovering(&self, stage: &str) -> bool {
        self.pending.iter().any(|recovery| recovery.row.stage == stage)
    }

    /// Stages that the supervisor aborted as hung, by the `deaths` of the run, although they were not frozen alone.
    pub fn healthy_aborted(&self, deaths: &[Value]) -> Vec<String> {
        let frozen = |death: &Value| {
            self.frozen.iter().any(|(stage, generation)| {
                death["stage"] == *stage && death["generation"] == *generation
            })
        };
        let hung = deaths.iter().filter(|death| death["hung"] == true);
        let healthy = hung.filter(|death| !frozen(death));
        healthy
            .map(|death| format!("{} generation {}", death["stage"], death["generation"]))
            .collect()
    }

    /// Distance from the last published pose to the ground truth of its tick, metres; none without both.
    pub fn pose_error(&self, truth: &[GroundTruthTick]) -> Option<f64> {
        let pose = self.pose?;
        let tick = truth.iter().rev().find(|tick| tick.is_of(&pose))?;
        Some(tick.pose_error_m(&pose))
    }

    /// Read new samples, which show the stages that run, beat and publish.
    fn read(&mut self, subscriptions: &mut Subscriptions) -> Result {
        while let Some(death) = subscriptions.deaths.next_sample()? {
            for PendingRecovery { row, at, .. } in &mut self.pending {
                if row.stage == name_str(&death.stage) && row.generation == Some(death.generation) {
                    row.noticed_ms.get_or_insert_with(|| ms_since(*at));
                }
            }
        }
        while let Some(entries) = subscriptions.roster.samples.next_slice()? {
            self.driving = Order::from_byte(entries.header().order) == Order::Drive;
            self.supervisor = entries.header().supervisor_pid;
            self.entries = entries.to_vec();
            self.entries_read = Some(Instant::now());
            if self.driving {
                self.on_supervisor_sign(true);
            }
        }
        while let Some(health) = subscriptions.health.next_sample()? {
            if HealthState::from_byte(health.state) == HealthState::Ready {
                self.on_sign(name_str(&health.stage), health.stamp.generation, true);
            }
        }
        while let Some(sample) = subscriptions.wheels.next_sample()? {
            self.time = Some(sample.stamp.time());
            let writer = topics::WHEELS.spec().writer;
            self.on_sign(writer, sample.stamp.generation, false);
        }
        while let Some(sample) = subscriptions.pose.next_sample()? {
            let writer = topics::POSE.spec().writer;
            self.on_sign(writer, sample.stamp.generation, false);
            self.pose = Some(sample);
        }
        for (writer, reader) in &mut subscriptions.outputs {
            while let Some(sample) = reader.next_sample()? {
                self.on_sign(writer, sample.stamp().generation, false);
                if *writer == topics::COMMAND.spec().writer {
                    self.on_supervisor_sign(false);
                }
            }
        }
        Ok(())
    }

    fn on_supervisor_sign(&mut self, beat: bool) {
        if !self.supervisor_hit {
            // Its successor has a bus of its own.
            self.on_sign(SUPERVISOR, 0, beat);
        }
    }

    /// Note a sign of work of a generation of `stage`: a ready beat, or a sample of a tick.
    fn on_sign(&mut self, stage: &str, generation: u32, beat: bool) {
        let complete = self.pending.extract_if(.., |PendingRecovery { row, at, .. }| {
            if row.stage != stage || Some(generation) <= row.generation {
                return false;
            }
            row.ready_ms.get_or_insert_with(|| ms_since(*at));
            row.first_output_ms = (!beat).then(|| ms_since(*at));
            !beat
        });
        self.measured.extend(complete.map(|recovery| recovery.row));
    }

    /// Freeze supervisor and stages together, and thaw them after `pause`.
    fn freeze_all(&mut self, pause: Duration, report: &mut Report) {
        // A stage that is frozen alone stays frozen.
        let hangs = |entry: &&RosterEntry| {
            self.frozen.contains(&(name_str(&entry.stage), entry.generation))
        };
        let stages = self.entries.iter().filter(|entry| !hangs(entry));
        // The supervisor is frozen first: it must not see frozen stages.
        let all = std::iter::once(self.supervisor).chain(stages.map(|entry| entry.pid));
        let all: Vec<u32> = all.filter(|&process| send(process, Signal::STOP)).collect();
        let began = Instant::now();
        while let Some(left) = pause.checked_sub(began.elapsed()) {
            std::thread::park_timeout(left);
        }
        // The supervisor is thawed last.
        for process in all.into_iter().rev() {
            send(process, Signal::CONT);
        }
        report.hit(EVERYTHING, Kind::FreezeAll);
        self.measured.push(self.row(EVERYTHING, Kind::FreezeAll, None));
        // The pause does not count as time of recovery.
        for recovery in &mut self.pending {
            recovery.at += began.elapsed();
        }
    }

    /// Hit a consumer, the supervisor, or a running stage without a pending recovery.
    fn hit(&mut self, series: &mut Series<'_>) -> Result {
        let Series { options, schedule, report, .. } = series;
        if let Some((index, kind, pause)) = schedule.consumer(self.consumers.len()) {
            let hit = self.consumers.hit(index, kind, pause, report)?;
            self.measured.extend(hit.map(|(name, starts)| self.row(&name, kind, Some(starts))));
            return Ok(());
        }
        if options.asked.include_supervisor && schedule.supervisor() {
            let kind = schedule.supervisor_kind();
            if !self.supervisor_is_down() && send(self.supervisor, kind.signal()) {
                report.hit(SUPERVISOR, kind);
                self.pending.push(PendingRecovery::new(self.row(SUPERVISOR, kind, None)));
                self.supervisor_hit = true;
                self.driving = false;
            }
            return Ok(());
        }
        if options.asked.freeze_all
            && let Some(pause) = schedule.freeze_all()
        {
            self.freeze_all(pause, report);
            return Ok(());
        }
        let (stage, kind) = (schedule.stage(), schedule.kind());
        let startup_hit = schedule.startup_hit();
        let running = |entry: &&RosterEntry| {
            name_str(&entry.stage) == stage
                && StageState::from_byte(entry.state) == StageState::Running
        };
        let Some(entry) = self.entries.iter().find(running) else {
            return Ok(());
        };
        self.hits.retain(|(_, at)| at.elapsed() < HOLD_WINDOW);
        let lately = self.hits.iter().filter(|(hit, _)| *hit == stage).count();
        if self.is_recovering(stage) || lately >= MOST_HITS || !send(entry.pid, kind.signal()) {
            return Ok(());
        }
        if kind == Kind::Freeze {
            self.frozen.push((stage, entry.generation));
        }
        self.hits.push((stage, Instant::now()));
        report.hit(stage, kind);
        let mut recovery = PendingRecovery::new(self.row(stage, kind, Some(entry.generation)));
        recovery.startup_hit =
            startup_hit.filter(|_| options.asked.include_startup && kind != Kind::Freeze);
        self.pending.push(recovery);
        Ok(())
    }

    /// The next hit of a successor in its start-up: its time, its place among the pending recoveries, and the process.
    fn next_startup_hit(&self) -> Option<(Instant, usize, RosterEntry)> {
        let read = self.entries_read?;
        let hits = self.pending.iter().enumerate().filter_map(|(place, recovery)| {
            let after = recovery.startup_hit?;
            let entry = self.entries.iter().find(|entry| {
                name_str(&entry.stage) == recovery.row.stage
                    && Some(entry.generation) > recovery.row.generation
                    && entry.pid != 0
            })?;
            let age = Duration::from_nanos(entry.uptime_ns);
            Some((read + after.saturating_sub(age), place, *entry))
        });
        hits.min_by_key(|hit| hit.0)
    }

    fn hit_starting(&mut self, report: &mut Report) {
        while let Some((at, place, entry)) = self.next_startup_hit()
            && at <= Instant::now()
        {
            self.pending[place].startup_hit = None;
            if let Some(stage) = stages::find(name_str(&entry.stage)).map(|stage| stage.name)
                && send(entry.pid, Signal::KILL)
            {
                self.hits.push((stage, Instant::now()));
                report.hit(stage, Kind::KillAtStart);
                let row = self.row(stage, Kind::KillAtStart, Some(entry.generation));
                let next = PendingRecovery::new(row);
                self.measured.push(std::mem::replace(&mut self.pending[place], next).row);
            }
        }
    }
}

/// Whether the signal reached a process.
pub fn send(pid: u32, signal: Signal) -> bool {
    Pid::from_raw(pid.cast_signed()).is_some_and(|pid| kill_process(pid, signal).is_ok())
}

/// The recovery of a stage or the supervisor that was hit, until its successor works.
struct PendingRecovery {
    row: Row,
    at: Instant,
    /// The time after its start at which the successor is to be hit too.
    startup_hit: Option<Duration>,
}

impl PendingRecovery {
    fn new(row: Row) -> Self {
        Self { row, at: Instant::now(), startup_hit: None }
    }
}

/// The attacker's readers on the bus of one generation of the supervisor.
struct Subscriptions {
    roster: Roster,
    deaths: Reader<DeathSample>,
    health: Reader<HealthSample>,
    wheels: Reader<WheelSample>,
    pose: Reader<PoseSample>,
    /// The other outputs of a tick, each with its writer.
    outputs: Vec<(&'static str, Box<dyn AnyReader>)>,
}

impl Subscriptions {
    /// Join the bus. None if the bus is not of `supervisor`: a killed supervisor leaves its bus, and its successor removes it.
    fn join(options: &Options, supervisor: u32) -> Result<Option<Self>> {
        let bus = Bus::join(&Domain::of(options.asked.robot.clone()), "chaos")?;
        let mut roster = Roster::open(&bus)?;
        roster.waiter.on(bus.wakeup(&topics::DEATHS)?);
        roster.waiter.on(bus.wakeup(&topics::HEALTH)?);
        roster.waiter.on(bus.wakeup(&topics::COMMAND)?);
        let outputs: [&dyn AnyTopic; 3] = [&topics::GRID, &topics::GUIDANCE, &topics::COMMAND];
        let outputs = outputs.iter().map(|it| Ok((it.spec().writer, it.any_reader(&bus)?)));
        let mut subscriptions = Self {
            roster,
            deaths: bus.reader(&topics::DEATHS)?,
            health: bus.reader(&topics::HEALTH)?,
            wheels: bus.reader(&topics::WHEELS)?,
            pose: bus.reader(&topics::POSE)?,
            outputs: outputs.collect::<Result<_, BusError>>()?,
        };
        let of_supervisor = |header: &RosterHeader, _: &[RosterEntry]| {
            (header.supervisor_pid == supervisor).then_some(())
        };
        let found = subscriptions.roster.find(2 * topics::RESTATE, of_supervisor)?;
        Ok(found.map(|()| subscriptions))
    }
}
