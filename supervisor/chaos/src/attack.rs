//! The attacker of one mission: sends signals, and waits for the successors to work.

use std::time::{Duration, Instant};

use common::{
    ground_truth::GroundTruthTick,
    samples::{HealthState, Order, PoseSample, RosterEntry, StageState, name_str},
    topics::{self, AnyTopic as _, SUPERVISOR},
};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

use supervisor::{
    policy::{HOLD_AFTER, HOLD_WINDOW},
    process::Process,
    simulator::Simulator,
    stages,
};

use crate::{
    error::{ChaosError, system},
    options::Options,
    report::{EVERYTHING, Report},
    resources::Resources,
    schedule::{Kind, Schedule},
    subscriptions::{POLL, Subscriptions},
};

/// The generation of whatever a supervisor publishes: its successor has a bus of its own.
const NEWEST: u32 = u32::MAX;
/// Signals to one stage within the window of the hold rule. One that dies more often is held until an operator releases
/// it, and here there is none. A signal may be followed by one in the start-up, and each may be counted late.
const MOST_HITS: usize = HOLD_AFTER - 4;
/// A stage that was hit, until its successor works.
struct PendingRecovery {
    stage: &'static str,
    kind: Kind,
    generation: u32,
    at: Instant,
    ready: bool,
    startup_hit: StartupHit,
}

impl PendingRecovery {
    /// Of that generation of `stage`, hit now.
    fn new(stage: &'static str, kind: Kind, generation: u32, startup_hit: StartupHit) -> Self {
        Self {
            stage,
            kind,
            generation,
            at: Instant::now(),
            ready: false,
            startup_hit,
        }
    }
}

/// Whether the successor is to be hit in its first milliseconds.
#[derive(Clone, Copy)]
enum StartupHit {
    /// No.
    None,
    /// So long after its start.
    After(Duration),
    /// It has started, and is hit then.
    At {
        when: Instant,
        process: u32,
        generation: u32,
    },
}

/// What the attacker knows of a mission.
#[derive(Default)]
pub(crate) struct Attack {
    entries: Vec<RosterEntry>,
    supervisor: u32,
    /// It was hit: what it and its stages still publish is no sign of its successor.
    supervisor_hit: bool,
    driving: bool,
    pending: Vec<PendingRecovery>,
    /// Generations that were frozen alone: those may be taken for hung.
    frozen: Vec<(&'static str, u32)>,
    /// Stages that were hit lately, and when.
    hits: Vec<(&'static str, Instant)>,
    pose: Option<PoseSample>,
    /// What the supervisor held when its robot began to drive, and when it was last looked at.
    resources: Option<[Resources; 2]>,
}

impl Attack {
    /// Attack one generation of the supervisor, `child`, until it ends, for at most `patience`.
    pub(crate) fn run(
        &mut self,
        options: &Options,
        child: &mut Process,
        mut robot: Option<&mut Simulator>,
        schedule: &mut Schedule,
        report: &mut Report,
        patience: Duration,
    ) -> Result<(), ChaosError> {
        let began = Instant::now();
        self.supervisor_hit = false;
        self.driving = false;
        self.entries.clear();
        self.resources = None;
        // The stages of a supervisor that was hit go with it.
        self.pending.retain(|recovery| recovery.stage == SUPERVISOR);
        let mut subscriptions = loop {
            if child.try_reap().map_err(system("reap"))?.is_some() || began.elapsed() >= patience {
                return Ok(());
            }
            match Subscriptions::join(options, child.id()) {
                Ok(Some(subscriptions)) => break subscriptions,
                // Not up yet.
                Ok(None) | Err(_) => std::thread::park_timeout(POLL),
            }
        };
        let mut next = Instant::now() + schedule.pause();
        while child.try_reap().map_err(system("reap"))?.is_none() && began.elapsed() < patience {
            // A hit that is overdue waits for the robot to drive.
            let due = next.checked_duration_since(Instant::now());
            let timeout = due.unwrap_or(POLL).min(self.time_to_startup_hit());
            subscriptions.roster.waiter.wait(timeout.min(POLL))?;
            if let Some(robot) = &mut robot {
                robot.poll()?;
            }
            self.read(&mut subscriptions, report)?;
            self.schedule_startup_hits();
            self.hit_starting(report);
            let enough = report.kills() >= options.kills;
            if Instant::now() >= next && self.driving && !enough {
                let pause = schedule.pause();
                self.hit(options, schedule, report);
                next = Instant::now() + pause;
            }
        }
        if let Some([first, last]) = self.resources {
            report.add_growth(first, last);
        }
        Ok(())
    }

    /// Whether the supervisor was hit, and no successor works yet.
    pub(crate) fn supervisor_is_down(&self) -> bool {
        self.pending
            .iter()
            .any(|recovery| recovery.stage == SUPERVISOR)
    }

    /// Stages that were aborted as hung, by the `deaths` of the run, and were not frozen alone.
    pub(crate) fn healthy_aborted(&self, deaths: &[Value]) -> Vec<String> {
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

    /// How far the last published pose was from the ground truth of its tick, metres; none without both.
    pub(crate) fn pose_error(&self, truth: &[GroundTruthTick]) -> Option<f64> {
        let pose = self.pose?;
        let tick = truth.iter().rev().find(|tick| tick.is_of(&pose))?;
        Some(tick.pose_error_m(&pose))
    }

    /// Read what came: which stages run, beat and publish.
    fn read(
        &mut self,
        subscriptions: &mut Subscriptions,
        report: &mut Report,
    ) -> Result<(), ChaosError> {
        while let Some(entries) = subscriptions.roster.samples.take()? {
            self.driving = Order::from_byte(entries.header().order) == Order::Drive;
            self.supervisor = entries.header().supervisor_pid;
            self.entries = entries.to_vec();
            if self.driving {
                self.on_supervisor_sign(true, report);
                // What ended processes held is freed once their successors work.
                if self.pending.is_empty()
                    && let Some(resources) = Resources::of(self.supervisor)
                {
                    let [first, _] = self.resources.unwrap_or([resources; 2]);
                    self.resources = Some([first, resources]);
                }
            }
        }
        while let Some(health) = subscriptions.health.take()? {
            if HealthState::from_byte(health.state) == HealthState::Ready {
                self.on_sign(
                    name_str(&health.stage),
                    health.stamp.generation,
                    true,
                    report,
                );
            }
        }
        while let Some(sample) = subscriptions.wheels.take()? {
            let writer = topics::WHEELS.spec().writer;
            self.on_sign(writer, sample.stamp.generation, false, report);
        }
        while let Some(sample) = subscriptions.pose.take()? {
            let writer = topics::POSE.spec().writer;
            self.on_sign(writer, sample.stamp.generation, false, report);
            self.pose = Some(sample);
        }
        while let Some(sample) = subscriptions.grid.take()? {
            let writer = topics::GRID.spec().writer;
            let generation = sample.header().stamp.generation;
            self.on_sign(writer, generation, false, report);
        }
        while let Some(sample) = subscriptions.guidance.take()? {
            let writer = topics::GUIDANCE.spec().writer;
            self.on_sign(writer, sample.stamp.generation, false, report);
        }
        while let Some(sample) = subscriptions.command.take()? {
            let writer = topics::COMMAND.spec().writer;
            self.on_sign(writer, sample.stamp.generation, false, report);
            self.on_supervisor_sign(false, report);
        }
        Ok(())
    }

    fn on_supervisor_sign(&mut self, beat: bool, report: &mut Report) {
        if !self.supervisor_hit {
            self.on_sign(SUPERVISOR, NEWEST, beat, report);
        }
    }

    /// A sign of a generation of `stage`: a beat as ready, or a sample of a tick.
    fn on_sign(&mut self, stage: &str, generation: u32, beat: bool, report: &mut Report) {
        let awaited = |recovery: &PendingRecovery| {
            recovery.stage == stage && generation > recovery.generation
        };
        let Some(at) = self.pending.iter().position(awaited) else {
            return;
        };
        let pending = &mut self.pending[at];
        let took = pending.at.elapsed().as_nanos() as u64;
        let recovery = report.recovery(pending.stage);
        let frozen = pending.kind == Kind::Freeze;
        if !pending.ready {
            pending.ready = true;
            if frozen {
                recovery.after_freeze.record(took);
            } else {
                recovery.ready.record(took);
            }
        }
        if !beat {
            if !frozen {
                recovery.output.record(took);
            }
            self.pending.remove(at);
        }
    }

    /// Stop supervisor and stages together, and let them go on after `pause`.
    fn freeze_all(&mut self, pause: Duration, report: &mut Report) {
        // One that hangs alone stays so.
        let hangs = |entry: &&RosterEntry| {
            self.frozen
                .contains(&(name_str(&entry.stage), entry.generation))
        };
        let stages = self.entries.iter().filter(|entry| !hangs(entry));
        let stages = stages.map(|entry| entry.pid);
        // The supervisor first: it must not see the stages stand still.
        let all: Vec<u32> = std::iter::once(self.supervisor).chain(stages).collect();
        let all: Vec<Pid> = all
            .iter()
            .filter_map(|pid| Pid::from_raw(pid.cast_signed()))
            .filter(|pid| kill_process(*pid, Kind::FreezeAll.signal()).is_ok())
            .collect();
        let began = Instant::now();
        while let Some(left) = pause.checked_sub(began.elapsed()) {
            std::thread::park_timeout(left);
        }
        // The supervisor last.
        for pid in all.iter().rev() {
            let _ = kill_process(*pid, Signal::CONT);
        }
        report.hit(EVERYTHING, Kind::FreezeAll);
        // What took longer only because nothing ran is no time of recovery.
        for recovery in &mut self.pending {
            recovery.at += began.elapsed();
        }
    }

    /// Hit a stage that runs and has no pending recovery, or the supervisor.
    fn hit(&mut self, options: &Options, schedule: &mut Schedule, report: &mut Report) {
        if options.supervisor && schedule.supervisor() {
            let kind = schedule.supervisor_kind();
            if !self.supervisor_is_down() && send(self.supervisor, kind) {
                report.hit(SUPERVISOR, kind);
                self.pending
                    .push(PendingRecovery::new(SUPERVISOR, kind, 0, StartupHit::None));
                self.supervisor_hit = true;
                self.driving = false;
            }
            return;
        }
        if options.freeze_all
            && let Some(pause) = schedule.freeze_all()
        {
            self.freeze_all(pause, report);
            return;
        }
        let Some(stage) = stages::find(schedule.stage()).map(|stage| stage.name) else {
            return;
        };
        let (kind, startup_hit) = (schedule.kind(), schedule.startup_hit());
        let running = |entry: &&RosterEntry| {
            name_str(&entry.stage) == stage
                && StageState::from_byte(entry.state) == StageState::Running
        };
        let Some(entry) = self.entries.iter().find(running) else {
            return;
        };
        let recovering = self.pending.iter().any(|recovery| recovery.stage == stage);
        self.hits.retain(|(_, at)| at.elapsed() < HOLD_WINDOW);
        let lately = self.hits.iter().filter(|(hit, _)| *hit == stage).count();
        if recovering || lately >= MOST_HITS || !send(entry.pid, kind) {
            return;
        }
        report.hit(stage, kind);
        if kind == Kind::Freeze {
            self.frozen.push((stage, entry.generation));
        }
        self.hits.push((stage, Instant::now()));
        let startup_hit = match startup_hit {
            Some(after) if options.startup && kind != Kind::Freeze => StartupHit::After(after),
            _ => StartupHit::None,
        };
        self.pending.push(PendingRecovery::new(
            stage,
            kind,
            entry.generation,
            startup_hit,
        ));
    }

    /// Find the successors that have started and are to be hit in their start-up.
    fn schedule_startup_hits(&mut self) {
        for recovery in &mut self.pending {
            let successor = self.entries.iter().find(|entry| {
                name_str(&entry.stage) == recovery.stage
                    && entry.generation > recovery.generation
                    && entry.pid != 0
            });
            if let (StartupHit::After(after), Some(entry)) = (recovery.startup_hit, successor) {
                let age = Duration::from_nanos(entry.uptime_ns);
                recovery.startup_hit = StartupHit::At {
                    when: Instant::now() + after.saturating_sub(age),
                    process: entry.pid,
                    generation: entry.generation,
                };
            }
        }
    }

    /// Time until one of them is to be hit.
    fn time_to_startup_hit(&self) -> Duration {
        let times = self
            .pending
            .iter()
            .filter_map(|recovery| match recovery.startup_hit {
                StartupHit::At { when, .. } => Some(when.saturating_duration_since(Instant::now())),
                StartupHit::None | StartupHit::After(_) => None,
            });
        times.min().unwrap_or(Duration::MAX)
    }

    /// Hit those whose time has come.
    fn hit_starting(&mut self, report: &mut Report) {
        for recovery in &mut self.pending {
            let StartupHit::At {
                when,
                process,
                generation,
            } = recovery.startup_hit
            else {
                continue;
            };
            if Instant::now() < when {
                continue;
            }
            recovery.startup_hit = StartupHit::None;
            if send(process, Kind::KillAtStart) {
                report.hit(recovery.stage, Kind::KillAtStart);
                self.hits.push((recovery.stage, Instant::now()));
                *recovery = PendingRecovery::new(
                    recovery.stage,
                    Kind::KillAtStart,
                    generation,
                    StartupHit::None,
                );
            }
        }
    }
}

/// Whether the signal reached a process.
fn send(pid: u32, kind: Kind) -> bool {
    Pid::from_raw(pid.cast_signed()).is_some_and(|pid| kill_process(pid, kind.signal()).is_ok())
}
