//! Plays a recording on a robot's bus: any consumer reads it like a robot. Live stages, in processes of their own, replace
//! recorded ones and read the played samples.
//!
//! With `--pace max` a tick is over when every live stage has answered it on the topics on which the recorded one did, so
//! time stands still while a debugger holds a stage. At another pace time does not wait.
//!
//! A live stage starts as at the beginning of a mission, and is not restarted. The link has no live process: a robot that
//! drives as recorded and not as commanded would be implausible to it.

mod error;
mod order;
mod report;
mod stage;

use std::{
    collections::BTreeMap,
    io,
    os::unix::fs::symlink,
    rc::Rc,
    time::{Duration, Instant},
};

use common::{
    bus::{Bus, BusError, EncodedWriter, Reader, SliceWriter},
    clock::{MissionClock, MissionTime, Pace},
    domain::{Domain, RobotName},
    mission::Mission,
    roster,
    run::Run,
    samples::{HealthSample, HealthState, RosterEntry, RosterHeader, name_str},
    topics::{self, AnyTopic, EncodedTopic},
    waiter::Waiter,
};
use processes::{
    domain::DomainLock,
    stages::{self, Stage},
};
use tempfile::TempDir;

use self::{order::ByTick, stage::LiveStage};
use crate::{
    Message, Recording, RecordingError,
    replay::samples::{First, tick_of, time_of},
};

pub use self::{
    error::LiveError,
    report::{LiveReport, LiveStageReport},
};

/// Topics that are not played: processes and requests. The process ids belong to other processes now.
static NOT_PLAYED: [&dyn AnyTopic; 5] =
    [&topics::ROSTER, &topics::HEALTH, &topics::INPUTS, &topics::REQUESTS, &topics::FAULTS];
/// Most elements of a slice of a topic that is no map.
const LONGEST_PIECE: usize = 1 << 16;
/// Longest wait until a stop request is seen.
const POLL: Duration = Duration::from_millis(50);
/// The length of a wait for an answer after which it is reported.
const TELL_AFTER: Duration = Duration::from_secs(2);

pub struct Options {
    /// Name of the robot whose place the recording takes.
    pub robot: RobotName,
    /// The stages that run in processes of their own.
    pub stages: Vec<&'static Stage>,
    pub pace: Pace,
    /// The time until which the recording is played as fast as possible.
    pub from: MissionTime,
    /// The mission of the live stages, if it is not the recorded one.
    pub mission: Option<Mission>,
}

/// Events for the caller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Happened {
    /// A stage is ready, in this process.
    Ready(&'static str, u32),
    Playing,
    /// A stage has not answered this tick yet.
    Waiting(&'static str, u64),
}

/// Play `recording` until its end, or until `stop` returns true.
pub fn play(
    recording: &Recording,
    options: &Options,
    stop: &mut dyn FnMut() -> bool,
    tell: &mut dyn FnMut(Happened),
) -> Result<LiveReport, LiveError> {
    if options.stages.iter().any(|stage| stage.name == error::NEVER_LIVE) {
        return Err(LiveError::Link);
    }
    let mut player = Player::open(recording, options)?;
    if !player.wait_until_ready(stop, tell)? {
        return Ok(player.report());
    }
    tell(Happened::Playing);
    player.began = Instant::now();
    for message in ByTick::new(recording.messages(&[])?) {
        let message = message?;
        let Some(writer) = writer_of(&message.topic) else {
            continue;
        };
        let tick = tick_of(&message.data);
        if tick > player.tick {
            let (answered, come) = (
                player.await_answers(stop, tell)?,
                player.await_time(time_of(&message.data), stop)?,
            );
            if !(answered && come) {
                return Ok(player.report());
            }
            player.tick = tick;
        }
        player.play(recording, writer, &message)?;
    }
    player.await_answers(stop, tell)?;
    Ok(player.report())
}

/// The topic of a message, if it is played.
fn writer_of(topic: &str) -> Option<&'static dyn EncodedTopic> {
    let named = |known: &str| known == topic;
    if NOT_PLAYED.iter().any(|other| named(other.spec().name)) {
        return None;
    }
    let mut known = topics::ENCODED.iter();
    known.find(|known| named(known.spec().name)).copied()
}

/// The bus and the live stages of a played recording. The fields are dropped in this order, the bus last.
struct Player {
    stages: Vec<LiveStage>,
    writers: BTreeMap<&'static str, Box<dyn EncodedWriter>>,
    health: Reader<HealthSample>,
    roster: SliceWriter<RosterHeader, RosterEntry>,
    named: Vec<RosterEntry>,
    waiter: Waiter,
    bus: Rc<Bus>,
    _lock: DomainLock,
    /// Directory of the run file and of the live stages' logs.
    _directory: TempDir,
    longest: usize,
    pace: Pace,
    from: MissionTime,
    began: Instant,
    tick: u64,
    played: u64,
}

impl Player {
    fn open(recording: &Recording, options: &Options) -> Result<Self, LiveError> {
        let recorded = &recording.run;
        let mission = options.mission.as_ref().unwrap_or(&recorded.mission);
        let run = Run {
            robot: options.robot.clone(),
            // A live stage's behaviour follows from the played samples, not from the wall clock.
            clock: MissionClock::Ticks { period_ns: (1e9 / mission.robot.rate_hz) as u64 },
            mission: mission.clone(),
            ..recorded.clone()
        };
        let cells = run.mission.grid_frame().area();
        let domain = Domain::of(options.robot.clone());
        let link = domain.run_directory();
        let lock = DomainLock::acquire(domain, cells)?;
        let directory = tempfile::Builder::new().prefix("firsthand-replay-").tempdir();
        let directory = directory.map_err(LiveError::Directory)?;
        run.save(directory.path())?;
        symlink(directory.path(), link).map_err(LiveError::Directory)?;
        let bus = lock
            .bus()
            .ok_or_else(|| LiveError::Directory(io::Error::from(io::ErrorKind::NotConnected)))?;
        let mut waiter = Waiter::default();
        waiter.on(bus.wakeup(&topics::HEALTH)?);
        let health = bus.reader(&topics::HEALTH)?.of_all_generations();
        let roster = bus.slice_writer(&topics::ROSTER, 1, stages::TABLE.len())?;
        let start = |stage: &&'static Stage| {
            LiveStage::start(stage, &run, directory.path(), &bus, &mut waiter)
        };
        let stages = options.stages.iter().map(start);
        let stages = stages.collect::<Result<_, _>>()?;
        Ok(Self {
            stages,
            writers: BTreeMap::new(),
            health,
            roster,
            named: Vec::new(),
            waiter,
            bus,
            _lock: lock,
            _directory: directory,
            longest: cells.max(LONGEST_PIECE),
            pace: options.pace,
            from: options.from,
            began: Instant::now(),
            tick: 0,
            played: 0,
        })
    }

    /// Wait until every live stage beats as ready. Returns false if it was asked to stop.
    fn wait_until_ready(
        &mut self,
        stop: &mut dyn FnMut() -> bool,
        tell: &mut dyn FnMut(Happened),
    ) -> Result<bool, LiveError> {
        let mut waiting: Vec<_> = self.stages.iter().map(|live| live.stage.name).collect();
        while !waiting.is_empty() {
            while let Some(health) = self.health.take()? {
                self.name(&health)?;
                let ready = HealthState::from_byte(health.state) == HealthState::Ready;
                let named = |stage: &&str| *stage == name_str(&health.stage);
                if let Some(place) = waiting.iter().position(|stage| ready && named(stage)) {
                    tell(Happened::Ready(waiting.remove(place), health.pid));
                }
            }
            if stop() {
                return Ok(false);
            }
            self.check_stages()?;
            self.waiter.wait(POLL)?;
        }
        Ok(true)
    }

    /// Name a live stage in the roster, as a supervisor does, because the stage waits for that.
    fn name(&mut self, health: &HealthSample) -> Result<(), BusError> {
        let HealthSample { stamp, stage, pid, .. } = *health;
        let entry =
            RosterEntry { stage, pid, generation: stamp.generation, ..RosterEntry::default() };
        self.named.retain(|named| named.stage != stage);
        self.named.push(entry);
        if let Some(writers) = self.bus.writers() {
            writers.name(roster::named(&self.named));
        }
        let header = RosterHeader { supervisor_pid: std::process::id(), ..RosterHeader::default() };
        self.roster.publish(0, MissionTime::default(), header, self.named.iter().copied())
    }

    fn check_stages(&mut self) -> Result<(), LiveError> {
        for live in &mut self.stages {
            let stage = live.stage.name;
            let ended = live.ended();
            let ended = ended.map_err(|source| LiveError::Start { stage, source })?;
            if let Some((cause, log_tail)) = ended {
                return Err(LiveError::Ended { stage, tick: self.tick, cause, log_tail });
            }
        }
        Ok(())
    }

    /// Read the samples of the live stages. Returns one that has not answered the current tick.
    fn look(&mut self) -> Result<Option<&'static str>, LiveError> {
        // Heartbeats wake this process too, and are dropped.
        while self.health.take()?.is_some() {}
        let mut waiting = None;
        for live in &mut self.stages {
            if !live.has_answered(self.tick)? {
                waiting = waiting.or(Some(live.stage.name));
            }
        }
        self.check_stages()?;
        Ok(waiting)
    }

    /// End the current tick: with `--pace max` wait for the answers of the live stages; then compare. Returns whether to go on.
    fn await_answers(
        &mut self,
        stop: &mut dyn FnMut() -> bool,
        tell: &mut dyn FnMut(Happened),
    ) -> Result<bool, LiveError> {
        let began = Instant::now();
        let mut told = false;
        while let (Some(stage), Pace::Max) = (self.look()?, self.pace) {
            if stop() {
                return Ok(false);
            }
            if !told && began.elapsed() >= TELL_AFTER {
                told = true;
                tell(Happened::Waiting(stage, self.tick));
            }
            self.waiter.wait(POLL)?;
        }
        for live in &mut self.stages {
            live.compare(self.tick);
        }
        Ok(!stop())
    }

    /// Wait until `time`. Returns whether to go on.
    fn await_time(
        &mut self,
        time: MissionTime,
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<bool, LiveError> {
        let Pace::Rate(rate) = self.pace else {
            return Ok(true);
        };
        if time <= self.from {
            self.began = Instant::now();
            return Ok(true);
        }
        let due = Duration::try_from_secs_f64(time.since(self.from).as_secs_f64() / rate);
        let due = due.unwrap_or_default();
        loop {
            let left = due.saturating_sub(self.began.elapsed());
            if left.is_zero() {
                return Ok(true);
            }
            if stop() {
                return Ok(false);
            }
            self.look()?;
            self.waiter.wait(left.min(POLL))?;
        }
    }

    fn play(
        &mut self,
        recording: &Recording,
        topic: &'static dyn EncodedTopic,
        message: &Message,
    ) -> Result<(), LiveError> {
        let mut stages = self.stages.iter_mut();
        if stages.any(|live| live.recorded(&message.topic, &message.data)) {
            return Ok(());
        }
        let name = topic.spec().name;
        if !self.writers.contains_key(name) {
            let writer = topic.encoded_writer(&self.bus, self.longest)?;
            self.writers.insert(name, writer);
        }
        if let Some(writer) = self.writers.get_mut(name)
            && !writer.publish(&message.data)?
        {
            return Err(RecordingError::Message {
                file: recording.path.to_path_buf(),
                topic: name.to_owned(),
            }
            .into());
        }
        self.played += 1;
        Ok(())
    }

    fn report(&self) -> LiveReport {
        let mut report = LiveReport { played: self.played, ..LiveReport::default() };
        for live in &self.stages {
            let (found, first) = live.report();
            report.stages.insert(live.stage.name, found);
            let earlier = |found: &First| {
                let held = report.first.as_ref();
                held.is_none_or(|held| found.tick < held.tick)
            };
            if let Some(first) = first.filter(earlier) {
                report.first = Some(first);
            }
        }
        report
    }
}

/// The stages that can be live: all but the link.
pub fn live_stages() -> impl Iterator<Item = &'static Stage> {
    stages::TABLE.iter().filter(|stage| stage.name != error::NEVER_LIVE)
}
