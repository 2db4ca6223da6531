//! The attacker: hears who lives, and hits.

use std::time::{Duration, Instant};

use common::{
    ground_truth::GroundTruthTick,
    samples::{HealthState, Order, PoseSample, RosterEntry, StageState, name_str},
    topics::{self, AnyTopic as _, SUPERVISOR},
};
use rustix::process::{Pid, kill_process};

use super::{
    ChaosError, Options,
    mission::PATIENCE,
    report::{Possessions, Report},
    schedule::{Chance, Kind},
    subscriptions::Subscriptions,
    system,
};
use supervisor::{
    policy::{HOLD_AFTER, HOLD_WINDOW},
    process::Process,
    simulator::Simulator,
    stages,
};

/// What a supervisor says is always of its newest life: it has the bus made anew.
const NEWEST: u32 = u32::MAX;
/// A stage that dies too often is held until an operator releases it, and here there is none: so often none is hit.
/// A hit may bring another in the start-up, and one of each may die of an earlier one.
const MOST_HITS: usize = HOLD_AFTER - 4;
/// How often the child is looked at while the bus is silent.
pub(super) const LOOK: Duration = Duration::from_millis(50);

/// A stage that was hit, until its successor works.
struct PendingRecovery {
    stage: &'static str,
    kind: Kind,
    generation: u32,
    at: Instant,
    ready: bool,
    again: Again,
}

impl PendingRecovery {
    /// Dealt now to that life of `stage`.
    fn new(stage: &'static str, kind: Kind, generation: u32, again: Again) -> Self {
        Self {
            stage,
            kind,
            generation,
            at: Instant::now(),
            ready: false,
            again,
        }
    }
}

/// Whether the successor is to be hit in its first milliseconds.
#[derive(Clone, Copy)]
enum Again {
    /// It may live.
    No,
    /// So long after its start.
    After(Duration),
    /// It has started: then.
    At {
        when: Instant,
        process: u32,
        generation: u32,
    },
}

/// What the attacker knows of a mission.
#[derive(Default)]
pub(super) struct Attack {
    entries: Vec<RosterEntry>,
    supervisor: u32,
    /// It was hit: what it said before, and its stages until they follow it, is no sign of its successor.
    supervisor_hit: bool,
    driving: bool,
    pending: Vec<PendingRecovery>,
    /// Who was hit lately.
    hits: Vec<(&'static str, Instant)>,
    pose: Option<PoseSample>,
    /// Of the supervisor that lives: when its robot began to drive, and when it was last looked at.
    held: Option<[Possessions; 2]>,
}

impl Attack {
    pub(super) fn until_the_end(
        &mut self,
        options: &Options,
        child: &mut Process,
        mut robot: Option<&mut Simulator>,
        chance: &mut Chance,
        report: &mut Report,
    ) -> Result<(), ChaosError> {
        let began = Instant::now();
        self.supervisor_hit = false;
        self.driving = false;
        self.entries.clear();
        self.held = None;
        // The stages of a supervisor that was hit go with it.
        self.pending.retain(|recovery| recovery.stage == SUPERVISOR);
        let mut subscriptions = loop {
            if child.try_reap().map_err(system("reap"))?.is_some() || began.elapsed() >= PATIENCE {
                return Ok(());
            }
            match Subscriptions::join(options, child.id()) {
                Ok(Some(subscriptions)) => break subscriptions,
                // Not up yet.
                Ok(None) | Err(_) => std::thread::park_timeout(LOOK),
            }
        };
        let mut next = Instant::now() + chance.pause();
        while child.try_reap().map_err(system("reap"))?.is_none() && began.elapsed() < PATIENCE {
            // A hit that is overdue waits for the robot to drive, which is heard.
            let due = next.checked_duration_since(Instant::now());
            let patience = due.unwrap_or(LOOK).min(self.time_to_successor());
            subscriptions.waiter.wait(patience.min(LOOK))?;
            if let Some(robot) = &mut robot {
                robot.tend()?;
            }
            self.listen(&mut subscriptions, report)?;
            self.await_successors();
            self.hit_successors(report);
            let enough = report.kills() >= options.kills;
            if Instant::now() >= next && self.driving && !enough {
                next = Instant::now() + chance.pause();
                self.hit(options, chance, report);
            }
        }
        if let Some([first, last]) = self.held {
            report.held(first, last);
        }
        Ok(())
    }

    /// Whether the supervisor was hit, and no successor works yet.
    pub(super) fn supervisor_is_down(&self) -> bool {
        self.pending
            .iter()
            .any(|recovery| recovery.stage == SUPERVISOR)
    }

    /// How far the last pose heard of was from the truth of its tick, metres. Wheel counts are what both know.
    pub(super) fn pose_error(&self, truth: &[GroundTruthTick]) -> Option<f64> {
        let pose = self.pose?;
        let counts = (pose.left_counts, pose.right_counts);
        let same = |tick: &&GroundTruthTick| (tick.left_counts, tick.right_counts) == counts;
        let tick = truth.iter().rev().find(same)?;
        Some((pose.x_m - tick.x).hypot(pose.y_m - tick.y))
    }

    /// Take what came: who runs, who beats, who speaks.
    fn listen(
        &mut self,
        subscriptions: &mut Subscriptions,
        report: &mut Report,
    ) -> Result<(), ChaosError> {
        while let Some(entries) = subscriptions.roster.take()? {
            self.driving = Order::from_byte(entries.header().order) == Order::Drive;
            self.supervisor = entries.header().supervisor_pid;
            self.entries = entries.to_vec();
            if self.driving {
                self.supervisor_recovered(true, report);
                // What the dead held is given back once their successors work.
                if self.pending.is_empty()
                    && let Some(held) = Possessions::of(self.supervisor)
                {
                    let [first, _] = self.held.unwrap_or([held; 2]);
                    self.held = Some([first, held]);
                }
            }
        }
        while let Some(health) = subscriptions.health.take()? {
            if HealthState::from_byte(health.state) == HealthState::Ready {
                self.recovered(
                    name_str(&health.stage),
                    health.stamp.generation,
                    true,
                    report,
                );
            }
        }
        while let Some(sample) = subscriptions.wheels.take()? {
            let writer = topics::WHEELS.spec().writer;
            self.recovered(writer, sample.stamp.generation, false, report);
        }
        while let Some(sample) = subscriptions.pose.take()? {
            let writer = topics::POSE.spec().writer;
            self.recovered(writer, sample.stamp.generation, false, report);
            self.pose = Some(sample);
        }
        while let Some(sample) = subscriptions.grid.take()? {
            let writer = topics::GRID.spec().writer;
            let generation = sample.header().stamp.generation;
            self.recovered(writer, generation, false, report);
        }
        while let Some(sample) = subscriptions.guidance.take()? {
            let writer = topics::GUIDANCE.spec().writer;
            self.recovered(writer, sample.stamp.generation, false, report);
        }
        while let Some(sample) = subscriptions.command.take()? {
            let writer = topics::COMMAND.spec().writer;
            self.recovered(writer, sample.stamp.generation, false, report);
            self.supervisor_recovered(false, report);
        }
        Ok(())
    }

    fn supervisor_recovered(&mut self, beat: bool, report: &mut Report) {
        if !self.supervisor_hit {
            self.recovered(SUPERVISOR, NEWEST, beat, report);
        }
    }

    /// A sign of a life of `stage`: a beat that says ready, or a sample of a tick.
    fn recovered(&mut self, stage: &str, generation: u32, beat: bool, report: &mut Report) {
        let is_it = |recovery: &PendingRecovery| {
            recovery.stage == stage && generation > recovery.generation
        };
        let Some(at) = self.pending.iter().position(is_it) else {
            return;
        };
        let hit = &mut self.pending[at];
        let took = hit.at.elapsed().as_nanos() as u64;
        let recovery = report.recovery(hit.stage);
        let frozen = hit.kind == Kind::Freeze;
        if !hit.ready {
            hit.ready = true;
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

    /// Hit a stage that runs and has no open recovery, or the supervisor.
    fn hit(&mut self, options: &Options, chance: &mut Chance, report: &mut Report) {
        if options.supervisor && chance.supervisor() {
            let kind = chance.supervisor_kind();
            if !self.supervisor_is_down() && send(self.supervisor, kind) {
                report.hit(SUPERVISOR, kind);
                self.pending
                    .push(PendingRecovery::new(SUPERVISOR, kind, 0, Again::No));
                self.supervisor_hit = true;
                self.driving = false;
            }
            return;
        }
        let Some(stage) = stages::find(chance.stage()).map(|stage| stage.name) else {
            return;
        };
        let (kind, again) = (chance.kind(), chance.again());
        let running = |entry: &&RosterEntry| {
            name_str(&entry.stage) == stage
                && StageState::from_byte(entry.state) == StageState::Running
        };
        let Some(entry) = self.entries.iter().find(running) else {
            return;
        };
        let hurt = self.pending.iter().any(|recovery| recovery.stage == stage);
        self.hits.retain(|(_, at)| at.elapsed() < HOLD_WINDOW);
        let lately = self.hits.iter().filter(|(hit, _)| *hit == stage).count();
        if hurt || lately >= MOST_HITS || !send(entry.pid, kind) {
            return;
        }
        report.hit(stage, kind);
        self.hits.push((stage, Instant::now()));
        let again = match again {
            Some(after) if options.startup && kind != Kind::Freeze => Again::After(after),
            _ => Again::No,
        };
        self.pending
            .push(PendingRecovery::new(stage, kind, entry.generation, again));
    }

    /// Find the successors that are to be hit, once they have started.
    fn await_successors(&mut self) {
        for recovery in &mut self.pending {
            let successor = self.entries.iter().find(|entry| {
                name_str(&entry.stage) == recovery.stage
                    && entry.generation > recovery.generation
                    && entry.pid != 0
            });
            if let (Again::After(after), Some(entry)) = (recovery.again, successor) {
                let age = Duration::from_nanos(entry.uptime_ns);
                recovery.again = Again::At {
                    when: Instant::now() + after.saturating_sub(age),
                    process: entry.pid,
                    generation: entry.generation,
                };
            }
        }
    }

    /// Until one of them is to be hit.
    fn time_to_successor(&self) -> Duration {
        let times = self
            .pending
            .iter()
            .filter_map(|recovery| match recovery.again {
                Again::At { when, .. } => Some(when.saturating_duration_since(Instant::now())),
                Again::No | Again::After(_) => None,
            });
        times.min().unwrap_or(Duration::MAX)
    }

    /// Hit those whose time has come.
    fn hit_successors(&mut self, report: &mut Report) {
        for recovery in &mut self.pending {
            let Again::At {
                when,
                process,
                generation,
            } = recovery.again
            else {
                continue;
            };
            if Instant::now() < when {
                continue;
            }
            recovery.again = Again::No;
            if send(process, Kind::KillAtStart) {
                report.hit(recovery.stage, Kind::KillAtStart);
                self.hits.push((recovery.stage, Instant::now()));
                *recovery =
                    PendingRecovery::new(recovery.stage, Kind::KillAtStart, generation, Again::No);
            }
        }
    }
}

/// Whether the signal reached a process.
fn send(pid: u32, kind: Kind) -> bool {
    Pid::from_raw(pid.cast_signed()).is_some_and(|pid| kill_process(pid, kind.signal()).is_ok())
}
