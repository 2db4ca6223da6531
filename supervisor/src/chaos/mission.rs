//! One mission under attack.

use std::{
    fs::{self, File},
    path::Path,
    process::{Command, Stdio},
    time::{Duration, Instant},
};

use common::{
    bus::{Bus, Reader, SliceReader},
    domain::Domain,
    mission::Mission,
    samples::{
        CommandSample, GridHeader, GuidanceSample, HealthSample, HealthState, Order, PoseSample,
        RosterEntry, RosterHeader, StageState, Stamp, Stamped as _, WheelSample, name_str,
    },
    topics::{self, AnyTopic as _, SUPERVISOR},
    truth::TruthTick,
    waiter::Waiter,
};
use rustix::process::{Pid, kill_process};
use serde_json::Value;

use super::{
    ChaosError, Options,
    report::{End, Possessions, Report},
    system,
    victim::{Chance, Kind},
};
use crate::{
    policy::{HOLD_AFTER, HOLD_WINDOW},
    process::{Process, firsthand},
    simulator::Simulator,
    stages,
};

/// Nothing that is waited for takes longer; a mission at a wall-clock pace takes half a minute.
const PATIENCE: Duration = Duration::from_secs(600);
/// What a supervisor says is always of its newest life: it has the bus made anew.
const AFTER_ANY: Stamp = Stamp {
    tick: 0,
    stamp_ns: 0,
    generation: u32::MAX,
    sequence: 0,
};
/// A stage that dies too often is held until an operator releases it, and here there is none: so often none is hit.
/// A hit may bring another in the start-up, and one of each may die of an earlier one.
const MOST_HITS: usize = HOLD_AFTER - 4;
/// How often the child is looked at while the bus is silent.
const LOOK: Duration = Duration::from_millis(50);

fn command(options: &Options, seed: u64, pace: &str, out: &Path) -> Result<Command, ChaosError> {
    let mut command = firsthand(&["run", &options.mission, "--json", "--pace", pace]);
    command.args(["--robot", &options.robot.to_string()]);
    command.args(["--seed", &seed.to_string(), "--out"]);
    command.arg(out);
    for setting in &options.set {
        command.args(["--set", setting]);
    }
    ours(command, out)
}

/// The run whose supervisor was hit, once more.
fn resume(directory: &Path) -> Result<Command, ChaosError> {
    let mut command = firsthand(&["run", "--json", "--resume"]);
    command.arg(directory);
    ours(command, directory)
}

/// A run that ends with us, and tells us alone; what it says on the way, and at last should it fall over, beside its
/// directory.
fn ours(mut command: Command, directory: &Path) -> Result<Command, ChaosError> {
    let said = directory.with_extension("stderr");
    let said = File::options().create(true).append(true).open(said);
    let said = said.map_err(system("keep what a mission says"))?;
    command.args(["--parent", &std::process::id().to_string()]);
    command.stdout(Stdio::piped()).stderr(said);
    Ok(command)
}

fn parse(stdout: &[u8]) -> Result<Value, ChaosError> {
    let text = String::from_utf8_lossy(stdout);
    serde_json::from_str(text.trim()).map_err(|_| ChaosError::NoSummary(text.into_owned()))
}

/// The same mission left alone: what there is to compare with.
pub(super) fn undisturbed(options: &Options, seed: u64) -> Result<Value, ChaosError> {
    let directory = options.directory.join("calm");
    let output = command(options, seed, "max", &directory)?
        .output()
        .map_err(system("start a mission"))?;
    fs::remove_dir_all(directory).map_err(system("remove its directory"))?;
    parse(&output.stdout)
}

/// The same mission under attack; what happened goes into `report`. What the mission wrote is kept if it went wrong.
pub(super) fn attack(
    options: &Options,
    seed: u64,
    chance: &mut Chance,
    report: &mut Report,
    calm: &Value,
) -> Result<(), ChaosError> {
    let before = report.kills();
    let place = options.directory.join(format!("seed-{seed}"));
    fs::create_dir(&place).map_err(system("make a directory"))?;
    let directory = place.join("run");
    let mut robot = options
        .supervisor
        .then(|| robot(options, seed, &place.join("robot")))
        .transpose()?;
    let mut start = command(options, seed, &options.pace.to_string(), &directory)?;
    if let Some(robot) = &robot {
        let address = robot.address();
        start.args(["--set", &format!("robot.address='udp://{address}'")]);
    }
    let mut attack = Attack::default();
    let began = Instant::now();
    let summary = loop {
        let summary = life(options, start, robot.as_mut(), &mut attack, chance, report)?;
        // A supervisor that was hit leaves no summary, one that was spared by a hair does.
        if attack.supervisor_hit().is_none() || !summary.is_empty() || began.elapsed() >= PATIENCE {
            break parse(&summary)?;
        }
        start = resume(&directory)?;
    };
    let number = |of: &Value, key: &str| of[key].as_f64().unwrap_or_default();
    let kills = report.kills() - before;
    let mut end = End {
        seed,
        outcome: summary["outcome"].as_str().unwrap_or("lost").to_owned(),
        reason: summary["reason"].as_str().unwrap_or_default().to_owned(),
        collisions: summary["collisions"].as_u64().unwrap_or_default(),
        pose_excess_m: number(&summary, "pose_error_m") - number(calm, "pose_error_m"),
        unattended_s: number(&summary, "unattended_s"),
        // What a count that was lost may cost, for each of them.
        pose_allowance_m: f64::from(kills) * options.loaded.body().metres_per_count(),
        kills,
    };
    if let Some(mut robot) = robot {
        robot.stop()?;
        let truth = robot.truth();
        let last = truth.last();
        end.collisions = last.map_or(0, |tick| tick.contacts);
        end.unattended_s = last.map_or(0.0, |tick| tick.unattended_s);
        let error = attack.pose_error(truth).unwrap_or(f64::INFINITY);
        end.pose_excess_m = error - number(calm, "pose_error_m");
    }
    if report.ended(&end) {
        fs::remove_dir_all(&place).map_err(system("remove its directory"))?;
    }
    Ok(())
}

/// A robot that does not die with its supervisor.
fn robot(options: &Options, seed: u64, directory: &Path) -> Result<Simulator, ChaosError> {
    fs::create_dir(directory).map_err(system("make a directory"))?;
    let mission = Mission {
        seed,
        ..options.loaded.clone()
    };
    Ok(Simulator::start(directory, &mission, options.pace)?)
}

/// One life of a supervisor under attack; what it says at its end.
fn life(
    options: &Options,
    start: Command,
    robot: Option<&mut Simulator>,
    attack: &mut Attack,
    chance: &mut Chance,
    report: &mut Report,
) -> Result<Vec<u8>, ChaosError> {
    let mut child = Process::spawn(start).map_err(system("start a mission"))?;
    let stdout = child.take_stdout();
    // Read beside, or a long summary could block it.
    let summary = std::thread::spawn(move || {
        let mut text = Vec::new();
        if let Some(mut stdout) = stdout {
            let _ = std::io::Read::read_to_end(&mut stdout, &mut text);
        }
        text
    });
    let attacked = attack.until_the_end(options, &mut child, robot, chance, report);
    child.end(Duration::from_secs(2));
    let summary = summary.join().unwrap_or_default();
    attacked.map(|()| summary)
}

/// A stage that was hit, until its successor works.
struct Wound {
    stage: &'static str,
    kind: Kind,
    generation: u32,
    at: Instant,
    ready: bool,
    again: Again,
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
struct Attack {
    entries: Vec<RosterEntry>,
    supervisor: u32,
    /// It was hit: what it said before, and its stages until they follow it, is no sign of its successor.
    felled: bool,
    driving: bool,
    wounds: Vec<Wound>,
    /// Who was hit lately.
    hits: Vec<(&'static str, Instant)>,
    pose: Option<PoseSample>,
    /// Of the supervisor that lives: when its robot began to drive, and when it was last looked at.
    held: Option<[Possessions; 2]>,
}

/// The attacker's place on the bus, for one life of the supervisor.
struct Ears {
    roster: SliceReader<RosterHeader, RosterEntry>,
    health: Reader<HealthSample>,
    wheels: Reader<WheelSample>,
    pose: Reader<PoseSample>,
    grid: SliceReader<GridHeader, u8>,
    guidance: Reader<GuidanceSample>,
    command: Reader<CommandSample>,
    waiter: Waiter,
}

impl Attack {
    fn until_the_end(
        &mut self,
        options: &Options,
        child: &mut Process,
        mut robot: Option<&mut Simulator>,
        chance: &mut Chance,
        report: &mut Report,
    ) -> Result<(), ChaosError> {
        let began = Instant::now();
        self.felled = false;
        self.driving = false;
        self.entries.clear();
        self.held = None;
        // The stages of a supervisor that was hit go with it.
        self.wounds.retain(|wound| wound.stage == SUPERVISOR);
        let mut ears = loop {
            if child.try_reap().map_err(system("reap"))?.is_some() || began.elapsed() >= PATIENCE {
                return Ok(());
            }
            match Ears::join(options, child.id()) {
                Ok(Some(ears)) => break ears,
                // Not up yet.
                Ok(None) | Err(_) => std::thread::park_timeout(LOOK),
            }
        };
        let mut next = Instant::now() + chance.pause();
        while child.try_reap().map_err(system("reap"))?.is_none() && began.elapsed() < PATIENCE {
            // A hit that is overdue waits for the robot to drive, which is heard.
            let due = next.checked_duration_since(Instant::now());
            let patience = due.unwrap_or(LOOK).min(self.time_to_successor());
            ears.waiter.wait(patience.min(LOOK))?;
            if let Some(robot) = &mut robot {
                robot.tend()?;
            }
            self.listen(&mut ears, report)?;
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

    /// When the supervisor was hit, unless its successor works already.
    fn supervisor_hit(&self) -> Option<Instant> {
        let mut wounds = self.wounds.iter();
        wounds
            .find(|wound| wound.stage == SUPERVISOR)
            .map(|wound| wound.at)
    }

    /// How far the last pose heard of was from the truth of its tick, metres. Wheel counts are what both know.
    fn pose_error(&self, truth: &[TruthTick]) -> Option<f64> {
        let pose = self.pose?;
        let counts = (pose.left_counts, pose.right_counts);
        let same = |tick: &&TruthTick| (tick.left_counts, tick.right_counts) == counts;
        let tick = truth.iter().rev().find(same)?;
        Some((pose.x_m - tick.x).hypot(pose.y_m - tick.y))
    }

    /// Take what came: who runs, who beats, who speaks.
    fn listen(&mut self, ears: &mut Ears, report: &mut Report) -> Result<(), ChaosError> {
        while let Some(entries) = ears.roster.take()? {
            self.driving = Order::from_byte(entries.header().order) == Order::Drive;
            self.supervisor = entries.header().supervisor_pid;
            self.entries = entries.to_vec();
            if self.driving {
                self.heal_supervisor(true, report);
                // What the dead held is given back once their successors work.
                if self.wounds.is_empty()
                    && let Some(held) = Possessions::of(self.supervisor)
                {
                    let [first, _] = self.held.unwrap_or([held; 2]);
                    self.held = Some([first, held]);
                }
            }
        }
        while let Some(health) = ears.health.take()? {
            if HealthState::from_byte(health.state) == HealthState::Ready {
                self.heal(name_str(&health.stage), health.stamp, true, report);
            }
        }
        while let Some(sample) = ears.wheels.take()? {
            self.heal(topics::WHEELS.spec().writer, *sample.stamp(), false, report);
        }
        while let Some(sample) = ears.pose.take()? {
            self.heal(topics::POSE.spec().writer, *sample.stamp(), false, report);
            self.pose = Some(sample);
        }
        while let Some(sample) = ears.grid.take()? {
            let stamp = *sample.header().stamp();
            self.heal(topics::GRID.spec().writer, stamp, false, report);
        }
        while let Some(sample) = ears.guidance.take()? {
            let writer = topics::GUIDANCE.spec().writer;
            self.heal(writer, *sample.stamp(), false, report);
        }
        while let Some(sample) = ears.command.take()? {
            let writer = topics::COMMAND.spec().writer;
            self.heal(writer, *sample.stamp(), false, report);
            self.heal_supervisor(false, report);
        }
        Ok(())
    }

    fn heal_supervisor(&mut self, beat: bool, report: &mut Report) {
        if !self.felled {
            self.heal(SUPERVISOR, AFTER_ANY, beat, report);
        }
    }

    /// A sign of life of `stage`: a beat that says ready, or a sample of a tick.
    fn heal(&mut self, stage: &str, stamp: Stamp, beat: bool, report: &mut Report) {
        let is_it = |wound: &Wound| wound.stage == stage && stamp.generation > wound.generation;
        let Some(at) = self.wounds.iter().position(is_it) else {
            return;
        };
        let wound = &mut self.wounds[at];
        let took = wound.at.elapsed().as_nanos() as u64;
        let recovery = report.recovery(wound.stage);
        if !wound.ready {
            wound.ready = true;
            if wound.kind == Kind::Freeze {
                recovery.thawless.record(took);
            } else {
                recovery.ready.record(took);
            }
        }
        if !beat {
            if wound.kind != Kind::Freeze {
                recovery.output.record(took);
            }
            self.wounds.remove(at);
        }
    }

    /// Hit a stage that runs and has no open wound, or the supervisor.
    fn hit(&mut self, options: &Options, chance: &mut Chance, report: &mut Report) {
        if options.supervisor && chance.supervisor() {
            let kind = chance.supervisor_kind();
            if self.supervisor_hit().is_none() && send(self.supervisor, kind) {
                report.hit(SUPERVISOR, kind);
                self.wounds.push(Wound {
                    stage: SUPERVISOR,
                    kind,
                    generation: 0,
                    at: Instant::now(),
                    ready: false,
                    again: Again::No,
                });
                self.felled = true;
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
        let hurt = self.wounds.iter().any(|wound| wound.stage == stage);
        self.hits.retain(|(_, at)| at.elapsed() < HOLD_WINDOW);
        let lately = self.hits.iter().filter(|(hit, _)| *hit == stage).count();
        if hurt || lately >= MOST_HITS || !send(entry.pid, kind) {
            return;
        }
        report.hit(stage, kind);
        self.hits.push((stage, Instant::now()));
        self.wounds.push(Wound {
            stage,
            kind,
            generation: entry.generation,
            at: Instant::now(),
            ready: false,
            again: match again {
                Some(after) if options.startup && kind != Kind::Freeze => Again::After(after),
                _ => Again::No,
            },
        });
    }

    /// Find the successors that are to be hit, once they have started.
    fn await_successors(&mut self) {
        for wound in &mut self.wounds {
            let successor = self.entries.iter().find(|entry| {
                name_str(&entry.stage) == wound.stage
                    && entry.generation > wound.generation
                    && entry.pid != 0
            });
            if let (Again::After(after), Some(entry)) = (wound.again, successor) {
                let age = Duration::from_nanos(entry.uptime_ns);
                wound.again = Again::At {
                    when: Instant::now() + after.saturating_sub(age),
                    process: entry.pid,
                    generation: entry.generation,
                };
            }
        }
    }

    /// Until one of them is to be hit.
    fn time_to_successor(&self) -> Duration {
        let times = self.wounds.iter().filter_map(|wound| match wound.again {
            Again::At { when, .. } => Some(when.saturating_duration_since(Instant::now())),
            Again::No | Again::After(_) => None,
        });
        times.min().unwrap_or(Duration::MAX)
    }

    /// Hit those whose time has come.
    fn hit_successors(&mut self, report: &mut Report) {
        for wound in &mut self.wounds {
            let Again::At {
                when,
                process,
                generation,
            } = wound.again
            else {
                continue;
            };
            if Instant::now() < when {
                continue;
            }
            wound.again = Again::No;
            if send(process, Kind::KillAtStart) {
                report.hit(wound.stage, Kind::KillAtStart);
                self.hits.push((wound.stage, Instant::now()));
                wound.generation = generation;
                wound.kind = Kind::KillAtStart;
                wound.at = Instant::now();
                wound.ready = false;
            }
        }
    }
}

impl Ears {
    /// None on the bus of another than `supervisor`: one that died leaves its bus to its successor to remove.
    fn join(options: &Options, supervisor: u32) -> Result<Option<Self>, ChaosError> {
        let bus = Bus::join(&Domain::of(options.robot.clone()), "chaos")?;
        let mut waiter = Waiter::default();
        waiter.on(bus.alarm(&topics::ROSTER)?);
        waiter.on(bus.alarm(&topics::HEALTH)?);
        waiter.on(bus.alarm(&topics::COMMAND)?);
        let mut ears = Self {
            roster: bus.slice_reader(&topics::ROSTER)?,
            health: bus.reader(&topics::HEALTH)?,
            wheels: bus.reader(&topics::WHEELS)?,
            pose: bus.reader(&topics::POSE)?,
            grid: bus.slice_reader(&topics::GRID)?,
            guidance: bus.reader(&topics::GUIDANCE)?,
            command: bus.reader(&topics::COMMAND)?,
            waiter,
        };
        let began = Instant::now();
        while began.elapsed() < 2 * topics::RESTATE {
            while let Some(entries) = ears.roster.take()? {
                if entries.header().supervisor_pid == supervisor {
                    return Ok(Some(ears));
                }
            }
            ears.waiter.wait(LOOK)?;
        }
        Ok(None)
    }
}

/// Whether the signal reached a process.
fn send(pid: u32, kind: Kind) -> bool {
    Pid::from_raw(pid.cast_signed()).is_some_and(|pid| kill_process(pid, kind.signal()).is_ok())
}
