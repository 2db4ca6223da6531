//! The attacker of one mission: sends signals, and waits for the successors to work.

use std::time::{Duration, Instant};

use common::{
    clock::MissionTime,
    ground_truth::GroundTruthTick,
    samples::{HealthState, Order, PoseSample, RosterEntry, StageState, name_str},
    topics::{self, SUPERVISOR},
};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

use mission_control::simulator::Simulator;
use processes::{
    policy::{HOLD_AFTER, HOLD_WINDOW},
    process::Process,
    stages,
};

use crate::chaos::{
    consumers::Consumers,
    kind::Kind,
    recovery::PendingRecovery,
    report::{EVERYTHING, Report},
    series::Series,
    signals::Row,
    subscriptions::{POLL, Subscriptions},
};
use crate::error::{OrCannot as _, Result};

/// The generation that stands for the samples of a supervisor, whose successor has a bus of its own.
const NEWEST: u32 = u32::MAX;
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
        let is_stage = |recovery: &mut PendingRecovery| recovery.stage != SUPERVISOR;
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
        self.measured.drain(..).try_for_each(|row| series.keep(&row))
    }

    /// Note that the mission is over, and end all measurements.
    pub fn end(&mut self, series: &mut Series<'_>) -> Result {
        self.consumers.end();
        let pending = self.pending.drain(..);
        self.measured.extend(pending.map(|recovery| recovery.row));
        self.keep_measured(series)
    }

    /// Count a signal to a stage, the supervisor or all, and begin its row.
    fn count(
        &self,
        report: &mut Report,
        stage: &'static str,
        kind: Kind,
        generation: Option<u32>,
    ) -> Row {
        report.hit(stage, kind);
        self.row(stage, kind, generation)
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
        self.pending.iter().any(|recovery| recovery.stage == SUPERVISOR)
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
            let is_its = |it: &&mut PendingRecovery| {
                it.stage == name_str(&death.stage) && it.generation == death.generation
            };
            self.pending.iter_mut().filter(is_its).for_each(PendingRecovery::noticed);
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
            self.on_sign(SUPERVISOR, NEWEST, beat);
        }
    }

    /// Note a sign of work of a generation of `stage`: a ready beat, or a sample of a tick.
    fn on_sign(&mut self, stage: &str, generation: u32, beat: bool) {
        let complete = |recovery: &mut PendingRecovery| {
            recovery.stage == stage && generation > recovery.generation && recovery.sign(beat)
        };
        let complete = self.pending.extract_if(.., complete);
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
        let row = self.count(report, EVERYTHING, Kind::FreezeAll, None);
        self.measured.push(row);
        // The pause does not count as time of recovery.
        for recovery in &mut self.pending {
            recovery.at += began.elapsed();
        }
    }

    /// Hit a consumer, the supervisor, or a running stage without a pending recovery.
    fn hit(&mut self, series: &mut Series<'_>) -> Result {
        let Series { options, schedule, report, .. } = series;
        if let Some((index, kind, pause)) =
            schedule.consumer(self.consumers.len(), options.asked.only_consumers)
        {
            let supervisor = self.supervisor;
            let hit = self.consumers.hit(index, kind, pause, supervisor, report)?;
            self.measured.extend(hit.map(|(name, starts)| self.row(&name, kind, starts)));
            return Ok(());
        }
        if options.asked.include_supervisor && schedule.supervisor() {
            let kind = schedule.supervisor_kind();
            if !self.supervisor_is_down() && send(self.supervisor, kind.signal()) {
                let row = self.count(report, SUPERVISOR, kind, None);
                self.pending.push(PendingRecovery::new(SUPERVISOR, 0, row));
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
        let Some(stage) = stages::find(schedule.stage()).map(|stage| stage.name) else {
            return Ok(());
        };
        let (kind, startup_hit) = (schedule.kind(), schedule.startup_hit());
        let running = |entry: &&RosterEntry| {
            name_str(&entry.stage) == stage
                && StageState::from_byte(entry.state) == StageState::Running
        };
        let Some(entry) = self.entries.iter().find(running) else {
            return Ok(());
        };
        let recovering = self.pending.iter().any(|recovery| recovery.stage == stage);
        self.hits.retain(|(_, at)| at.elapsed() < HOLD_WINDOW);
        let lately = self.hits.iter().filter(|(hit, _)| *hit == stage).count();
        if recovering || lately >= MOST_HITS || !send(entry.pid, kind.signal()) {
            return Ok(());
        }
        if kind == Kind::Freeze {
            self.frozen.push((stage, entry.generation));
        }
        self.hits.push((stage, Instant::now()));
        let row = self.count(report, stage, kind, Some(entry.generation));
        let mut recovery = PendingRecovery::new(stage, entry.generation, row);
        recovery.startup_hit =
            startup_hit.filter(|_| options.asked.include_startup && kind != Kind::Freeze);
        self.pending.push(recovery);
        Ok(())
    }

    /// The next hit of a successor in its start-up: its time, its place among the pending recoveries, and the process.
    fn next_startup_hit(&self) -> Option<(Instant, usize, RosterEntry)> {
        let read = self.entries_read?;
        let hits = self.pending.iter().enumerate().filter_map(|(place, recovery)| {
            let (at, entry) = recovery.startup_hit(&self.entries, read)?;
            Some((at, place, entry))
        });
        hits.min_by_key(|hit| hit.0)
    }

    fn hit_starting(&mut self, report: &mut Report) {
        while let Some((at, place, entry)) = self.next_startup_hit()
            && at <= Instant::now()
        {
            self.pending[place].startup_hit = None;
            if send(entry.pid, Signal::KILL) {
                let stage = self.pending[place].stage;
                self.hits.push((stage, Instant::now()));
                let row = self.count(report, stage, Kind::KillAtStart, Some(entry.generation));
                let next = PendingRecovery::new(stage, entry.generation, row);
                self.measured.push(std::mem::replace(&mut self.pending[place], next).row);
            }
        }
    }
}

/// Whether the signal reached a process.
fn send(pid: u32, signal: Signal) -> bool {
    Pid::from_raw(pid.cast_signed()).is_some_and(|pid| kill_process(pid, signal).is_ok())
}
