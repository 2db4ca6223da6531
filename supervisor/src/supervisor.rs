//! One robot's supervisor: brings its stages up, lets it drive, watches, brings all down again.

use std::{
    fmt, io,
    os::unix::fs::symlink,
    path::PathBuf,
    rc::Rc,
    time::{Duration, Instant},
};

use common::{
    address::{Address, AddressError},
    bus::{Bus, BusError, Reader, SliceWriter, Writer},
    checkpoint::CheckpointError,
    clock::{MissionClock, MissionTime, Pace, monotonic_ns},
    domain::{Domain, RobotName},
    mission::Mission,
    run::{Run, RunError},
    samples::{
        Action, Cause, DeathSample, DirectiveSample, HoldReason, LinkSample, Order, RequestKind,
        RequestSample, RosterEntry, RosterHeader, StallSample, name_str,
    },
    signals::{SIGHUP, SIGINT, SIGTERM, Signals},
    topics,
    waiter::Waiter,
};
use thiserror::Error;
use x80_link::failsafe;

use crate::{
    death,
    domain::{DomainError, Held},
    fleet::{Fleet, FleetError, Starter},
    kept::{Interrupted, Keeper},
    observer::{Observer, Record},
    report::{Ending, Outcome, Summary},
    service::ServiceManager,
    simulator::{Simulator, SimulatorError},
    stages,
    stall::{
        Rung, StallWatch,
        record::{self, StallRecord},
    },
};

/// On a clock of ticks nothing waits for wall-clock: a pipeline that makes no tick for so long is stuck.
const NO_PROGRESS: Duration = Duration::from_secs(15);
/// Time the link has to say that the robot was told to stand, before it is asked to go.
const STAND_CONFIRMED: Duration = Duration::from_millis(100);
/// How often the bus is cleared of consumers that died.
const CLEAR_UP: Duration = Duration::from_secs(1);

/// What a run is made from.
pub(crate) struct Options {
    /// What to do.
    pub(crate) mission: Mission,
    /// For whom.
    pub(crate) robot: RobotName,
    /// How mission time passes; a real robot only knows wall-clock.
    pub(crate) pace: Pace,
    /// Where logs, checkpoints and results go; must exist.
    pub(crate) directory: PathBuf,
    /// Who starts the stages.
    pub(crate) starter: Starter,
    /// The run in that directory, to go on with; none begins one.
    pub(crate) interrupted: Option<Interrupted>,
}

/// Why a run could not be carried out.
#[derive(Debug, Error)]
pub(crate) enum SupervisorError {
    /// The domain.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// The bus.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// A stage.
    #[error(transparent)]
    Fleet(#[from] FleetError),
    /// The simulator.
    #[error(transparent)]
    Simulator(#[from] SimulatorError),
    /// The run file.
    #[error(transparent)]
    Run(#[from] RunError),
    /// What the supervisor keeps.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// The robot's address.
    #[error("robot.address: {0}")]
    Address(#[from] AddressError),
    /// The file system or the system.
    #[error("cannot {action}: {source}")]
    System {
        /// What was tried.
        action: String,
        /// The system's word.
        source: io::Error,
    },
}

fn system(action: impl Into<String>) -> impl FnOnce(io::Error) -> SupervisorError {
    let action = action.into();
    move |source| SupervisorError::System { action, source }
}

/// What a run leaves.
pub(crate) struct Finished {
    /// The numbers.
    pub(crate) summary: Summary,
    /// Whether it ended as its user wanted.
    pub(crate) asked_for: bool,
    /// What was heard.
    pub(crate) record: Record,
    /// What really happened, of a simulated robot.
    pub(crate) truth: Vec<common::truth::TruthTick>,
}

/// How far a run has come, for whoever watches.
pub(crate) struct Progress<'a> {
    /// What was heard so far.
    pub(crate) record: &'a Record,
    /// Stages alive, of how many.
    pub(crate) alive: (usize, usize),
    /// Whether the robot is ordered to drive.
    pub(crate) driving: bool,
    /// From the start to the target.
    straight_m: f64,
}

/// One line.
impl fmt::Display for Progress<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (alive, all) = self.alive;
        let record = self.record;
        let link = record.link.unwrap_or_default();
        if !self.driving && link.cause() == Cause::NotOrdered {
            return write!(f, "starting: {alive}/{all} stages alive");
        }
        let time = record.pose.map_or(0.0, |pose| pose.stamp.time().seconds());
        let speed = record.pose.map_or(0.0, |pose| pose.v_m_s);
        let distance = record
            .command
            .map_or(self.straight_m, |command| command.distance_m);
        let events = record
            .newest_guidance()
            .map_or(0, |guidance| guidance.safety_events);
        write!(
            f,
            "{time:6.1} s  {distance:5.2} m to go  {speed:5.2} m/s  {events:3} safety events  {alive}/{all} stages alive"
        )?;
        match link.action() {
            Action::Go => Ok(()),
            action => {
                let cause = failsafe::name(link.cause()).to_uppercase();
                write!(f, ", {cause}: the robot {}", failsafe::effect(action))
            }
        }
    }
}

/// Carry out a run. `watch` is called a few times a second.
pub(crate) fn run(
    options: &Options,
    watch: &mut dyn FnMut(&Progress<'_>),
) -> Result<Finished, SupervisorError> {
    let mut signals =
        Signals::catch(&[SIGINT, SIGTERM, SIGHUP]).map_err(system("catch signals"))?;
    let mut held = Held::acquire(
        Domain::of(options.robot.clone()),
        options.mission.grid_frame().area(),
    )?;
    let mut supervisor = Supervisor::start(options, bus_of(&held)?)?;
    let ending = loop {
        match supervisor.drive(&mut signals, watch) {
            Ok(Some(ending)) => break Ok(ending),
            Ok(None) => supervisor = supervisor.renew(&mut held)?,
            Err(error) => break Err(error),
        }
    };
    // Whatever went wrong, the robot is stopped first and the stages go in order.
    let stopped = supervisor.stop();
    let ending = ending?;
    stopped?;
    Ok(supervisor.finish(&ending))
}

fn bus_of(held: &Held) -> Result<Rc<Bus>, SupervisorError> {
    let bus = held.bus();
    bus.ok_or_else(|| system("keep the bus")(io::ErrorKind::NotConnected.into()))
}

struct Supervisor<'a> {
    options: &'a Options,
    bus: Rc<Bus>,
    // Dropped in this order: the stages go before the robot they speak to.
    fleet: Fleet,
    simulator: Option<Simulator>,
    observer: Observer,
    waiter: Waiter,
    directive: Writer<DirectiveSample>,
    roster: SliceWriter<RosterHeader, RosterEntry>,
    deaths: Writer<DeathSample>,
    stalls: Writer<StallSample>,
    requests: Reader<RequestSample>,
    last_request: u64,
    keeper: Keeper,
    /// The first tick that is not made yet, and mission time by then, as long as none was heard of.
    beginning: (u64, MissionTime),
    order: Order,
    /// Why it is not [`Order::Drive`].
    reason: HoldReason,
    /// All was ready once: from then on only what is said here holds the robot.
    ready: bool,
    stall: StallWatch,
    judged_tick: Option<u64>,
    restated: Option<Instant>,
    progressed: (Option<u64>, Instant),
    cleared_up: Instant,
    /// Processes whose remains are not cleared up yet.
    unburied: Vec<u32>,
    clock: MissionClock,
    address: Address,
    service: ServiceManager,
}

impl<'a> Supervisor<'a> {
    /// The robot, the run file, the stages.
    fn start(options: &'a Options, bus: Rc<Bus>) -> Result<Self, SupervisorError> {
        let directory = &options.directory;
        let mission = &options.mission;
        let mut keeper = Keeper::open(directory)?;
        let (simulator, address) = match &mission.robot.address {
            Some(address) => (None, address.parse::<Address<String>>()?.resolve()?),
            None => {
                let simulator = Simulator::start(directory, mission, options.pace)?;
                let address = Address::Udp(simulator.address());
                (Some(simulator), address)
            }
        };
        let (clock, beginning) = match (&options.interrupted, options.pace) {
            (Some(interrupted), _) => {
                keeper.kept.resumes += 1;
                let (tick, time) = (interrupted.first_tick, interrupted.time);
                tracing::warn!(tick, seconds = time.seconds(), "the run goes on");
                (interrupted.clock(), (tick, time))
            }
            (None, Pace::Max) if simulator.is_some() => {
                let period_ns = (1e9 / mission.robot.rate_hz) as u64;
                (
                    MissionClock::Ticks { period_ns },
                    (0, MissionTime::default()),
                )
            }
            // A real robot's time passes as it does.
            (None, pace) => {
                let rate = match pace {
                    Pace::Rate(rate) if simulator.is_some() => rate,
                    _ => 1.0,
                };
                let epoch_ns = monotonic_ns();
                (
                    MissionClock::Wall { epoch_ns, rate },
                    (0, MissionTime::default()),
                )
            }
        };
        let run = Run {
            robot: options.robot.clone(),
            address: address.clone(),
            clock,
            mission: mission.clone(),
        };
        run.save(directory)?;
        let mut waiter = Waiter::default();
        let observer = Observer::new(&bus, &mut waiter)?;
        waiter.on(bus.alarm(&topics::REQUESTS)?);
        let mut supervisor = Self {
            options,
            fleet: Fleet::new(directory.clone(), options.starter),
            simulator,
            observer,
            waiter,
            directive: bus.writer(&topics::DIRECTIVE, 1)?,
            roster: bus.slice_writer(&topics::ROSTER, 1, stages::TABLE.len())?,
            deaths: bus.writer(&topics::DEATHS, 1)?,
            stalls: bus.writer(&topics::STALLS, 1)?,
            requests: bus.reader(&topics::REQUESTS)?,
            bus,
            last_request: 0,
            keeper,
            beginning,
            order: Order::Hold,
            reason: HoldReason::Starting,
            ready: false,
            stall: StallWatch::new(mission),
            judged_tick: None,
            restated: None,
            progressed: (None, Instant::now()),
            cleared_up: Instant::now(),
            unburied: Vec::new(),
            clock,
            address,
            service: ServiceManager::of_environment(),
        };
        supervisor.restate()?;
        supervisor.fleet.start_all(beginning.0)?;
        if options.starter == Starter::Another {
            let link = Domain::of(options.robot.clone()).run_link();
            symlink(directory, &link).map_err(system(format!("make {}", link.display())))?;
            // The stages come after this.
            supervisor.service.ready();
        }
        Ok(supervisor)
    }

    /// Until the mission ends, one way or another; or, without an ending, until the bus must be made anew.
    fn drive(
        &mut self,
        signals: &mut Signals,
        watch: &mut dyn FnMut(&Progress<'_>),
    ) -> Result<Option<Ending>, SupervisorError> {
        self.waiter.on_readable(&*signals)?;
        loop {
            if signals.came() {
                return Ok(Some(Ending {
                    outcome: Outcome::Aborted,
                    reason: "told to stop".to_owned(),
                    asked_for: true,
                }));
            }
            if let Some(ending) = self.turn()? {
                return Ok(Some(ending));
            }
            if self.fleet.is_jammed() {
                return Ok(None);
            }
            if self.restate_if_due()? {
                let progress = Progress {
                    record: &self.observer.record,
                    alive: self.fleet.alive(),
                    driving: self.order == Order::Drive,
                    straight_m: self.options.mission.target.length(),
                };
                watch(&progress);
                self.service.show(|| progress.to_string());
                // Consumers die, too, and nobody tells us.
                if self.cleared_up.elapsed() >= CLEAR_UP {
                    self.clear_up();
                }
            }
            self.service.feed();
            self.wait()?;
        }
    }

    /// Wait for the bus, a child, a signal, a deadline.
    fn wait(&self) -> Result<(), SupervisorError> {
        let mut descriptors = self.fleet.descriptors();
        if let Some(simulator) = &self.simulator {
            descriptors.extend(simulator.descriptors());
        }
        let deadlines = [self.fleet.time_to_deadline(), self.service.time_to_feed()];
        let soonest = deadlines.into_iter().flatten().min();
        let patience = soonest.map_or(topics::RESTATE, |soonest| soonest.min(topics::RESTATE));
        self.waiter.wait_also_for(&descriptors, patience)?;
        Ok(())
    }

    /// Take what came, tend the stages, judge.
    fn turn(&mut self) -> Result<Option<Ending>, SupervisorError> {
        let became_ready = self.observer.take(&mut self.fleet)?;
        let first_tick = self.first_tick();
        let asked = self.take_requests(first_tick)?;
        let died = self.tend(first_tick)?;
        let driven = self.order == Order::Drive;
        self.fleet.judge_outputs(driven, first_tick)?;
        if let Some(simulator) = &mut self.simulator
            && !simulator.tend()?
        {
            return Ok(Some(fault("the simulated robot ended; see x80-sim.log")));
        }
        if self.decide_order() || became_ready || died || asked {
            self.restate()?;
        }
        self.judge()
    }

    /// What a new life of a stage begins with: the first tick that nobody has made.
    fn first_tick(&self) -> u64 {
        let newest = self.observer.record.newest_tick();
        // The link speaks of tick 0 before its first.
        newest.map_or(0, |tick| tick + 1).max(self.beginning.0)
    }

    /// Reap and restart; tell each death once, on the bus, in the log and in the run directory. Says whether one was.
    fn tend(&mut self, first_tick: u64) -> Result<bool, SupervisorError> {
        let deaths = self.fleet.tend(&self.bus, first_tick)?;
        let pose = self.observer.record.pose.unwrap_or_default();
        for death in &deaths {
            death.log();
            self.deaths
                .publish(pose.stamp.tick, pose.stamp.time(), death.sample())?;
            let file = self.options.directory.join(death::FILE_NAME);
            death
                .append_to(&self.options.directory)
                .map_err(system(format!("write {}", file.display())))?;
        }
        if !deaths.is_empty() {
            self.unburied.extend(deaths.iter().map(|death| death.pid));
            self.clear_up();
        }
        Ok(!deaths.is_empty())
    }

    /// Free what the dead held, while their successors start; what cannot be freed makes the bus slower, not wrong.
    fn clear_up(&mut self) {
        self.cleared_up = Instant::now();
        match self.bus.clear_up(&self.unburied) {
            Ok(true) => self.unburied.clear(),
            Ok(false) => {}
            Err(error) => {
                let dead = std::mem::take(&mut self.unburied);
                tracing::warn!(%error, ?dead, "cannot remove what the dead left on the bus");
            }
        }
    }

    /// Do what operators ask. Says whether anything was asked.
    fn take_requests(&mut self, first_tick: u64) -> Result<bool, SupervisorError> {
        let mut asked = false;
        while let Some(request) = self.requests.take()? {
            asked = true;
            self.last_request = request.id;
            let stage = name_str(&request.stage);
            match RequestKind::from_byte(request.kind) {
                RequestKind::Nothing => {}
                RequestKind::Restart => {
                    tracing::warn!(stage, "an operator asks for a fresh life");
                    self.fleet.replace(stage, first_tick)?;
                }
                RequestKind::Stop => {
                    tracing::warn!("an operator says stop");
                    self.hold_for_operator(true)?;
                }
                RequestKind::Resume => {
                    tracing::warn!("an operator says resume");
                    self.hold_for_operator(false)?;
                }
            }
        }
        Ok(asked)
    }

    /// Kept at once: a robot that was told to stand still stands when another supervises it.
    fn hold_for_operator(&mut self, hold: bool) -> Result<(), SupervisorError> {
        self.keeper.kept.operator_stop = hold;
        Ok(self.keeper.keep()?)
    }

    /// Whether the robot may drive, and if not, why. Says whether that changed.
    fn decide_order(&mut self) -> bool {
        if self.order == Order::Stop {
            return false;
        }
        if !self.ready && self.fleet.all_running() && self.can_drive() {
            tracing::info!("all stages ready");
            self.ready = true;
            self.service.ready();
        }
        let reason = if !self.ready {
            HoldReason::Starting
        } else if self.keeper.kept.operator_stop {
            HoldReason::Operator
        } else if self.fleet.held().next().is_some() {
            HoldReason::StageHeld
        } else {
            HoldReason::None
        };
        if reason == self.reason {
            return false;
        }
        tracing::info!(?reason, "order");
        self.reason = reason;
        self.order = if reason == HoldReason::None {
            Order::Drive
        } else {
            Order::Hold
        };
        self.progressed = (None, Instant::now());
        true
    }

    /// Whether the robot answers, and there is a field to follow: the first tick should not wait for it.
    fn can_drive(&self) -> bool {
        self.robot_answers() && self.observer.record.field.frame().is_some()
    }

    fn robot_answers(&self) -> bool {
        let link = self.observer.record.link;
        link.is_some_and(|link| link.connected == 1)
    }

    fn judge(&mut self) -> Result<Option<Ending>, SupervisorError> {
        let record = &self.observer.record;
        if let Some(arrival) = record.arrival {
            return Ok(Some(Ending {
                outcome: Outcome::Reached,
                reason: format!("{:.2} m from the target", arrival.distance_m),
                asked_for: true,
            }));
        }
        if let Some(ending) = record.link.as_ref().and_then(ended_by_the_link) {
            return Ok(Some(ending));
        }
        let truth = self
            .simulator
            .as_ref()
            .and_then(|simulator| simulator.truth().last());
        if let Some(truth) = truth
            && truth.contacts > 0
        {
            return Ok(Some(Ending {
                outcome: Outcome::Collision,
                reason: format!("touched something near ({:.2}, {:.2})", truth.x, truth.y),
                asked_for: false,
            }));
        }
        let time = match self.clock {
            MissionClock::Ticks { .. } => record
                .pose
                .map_or(MissionTime::default(), |pose| pose.stamp.time()),
            // A robot that is away, a pose that does not come: time passes all the same.
            MissionClock::Wall { .. } => self.clock.at(0, monotonic_ns()),
        };
        if time.seconds() >= self.options.mission.timeout_s {
            return Ok(Some(Ending {
                outcome: Outcome::Timeout,
                reason: format!("not there after {} s", self.options.mission.timeout_s),
                asked_for: false,
            }));
        }
        if self.makes_no_progress() {
            let held: Vec<_> = self.fleet.held().collect();
            let missing = self.fleet.missing();
            let reason = if self.options.starter == Starter::Another && !missing.is_empty() {
                let (robot, missing) = (&self.options.robot, missing.join(", "));
                format!(
                    "not running: {missing}; start each with `firsthand stage NAME --robot {robot}`"
                )
            } else if !held.is_empty() {
                let (held, file) = (held.join(", "), death::FILE_NAME);
                format!("{held} died again and again and is held; see {file} in the run directory")
            } else if !self.ready && !self.robot_answers() {
                let address = &self.address;
                format!("no robot answers at {address}; is it on, is robot.address right?")
            } else {
                "the pipeline makes no progress; see the stages' logs".to_owned()
            };
            return Ok(Some(fault(&reason)));
        }
        self.watch_for_stalls()
    }

    const fn in_ticks(&self) -> bool {
        matches!(self.clock, MissionClock::Ticks { .. })
    }

    /// On a clock of ticks, whether no tick was made for too long.
    fn makes_no_progress(&mut self) -> bool {
        let tick = self.observer.record.newest_tick();
        if tick != self.progressed.0 {
            self.progressed = (tick, Instant::now());
        }
        // A real robot may be away for as long as it likes, and an operator may think.
        let waits = self.simulator.is_none() && self.order == Order::Drive
            || self.reason == HoldReason::Operator
            || self.reason == HoldReason::StageHeld && !self.in_ticks();
        !waits && self.progressed.1.elapsed() >= NO_PROGRESS
    }

    fn watch_for_stalls(&mut self) -> Result<Option<Ending>, SupervisorError> {
        let record = &self.observer.record;
        let (Some(pose), Some(guidance)) = (record.pose, record.newest_guidance()) else {
            return Ok(None);
        };
        if self.order != Order::Drive || self.judged_tick == Some(pose.stamp.tick) {
            return Ok(None);
        }
        self.judged_tick = Some(pose.stamp.tick);
        let stopped = record.link.is_none_or(|link| link.stopped());
        let held = stopped || !self.fleet.all_running();
        let guidance = *guidance;
        let Some(stall) = self.stall.step(&pose, &guidance, held) else {
            return Ok(None);
        };
        let record = StallRecord::new(stall, &pose, &self.stall);
        record.log();
        self.stalls
            .publish(pose.stamp.tick, pose.stamp.time(), record.sample())?;
        let directory = &self.options.directory;
        record.append_to(directory).map_err(system(format!(
            "write {}",
            directory.join(record::FILE_NAME).display()
        )))?;
        match stall.rung {
            Rung::Replan => {
                self.fleet.replace("planner", self.first_tick())?;
            }
            Rung::Forget { .. } => self.restate()?,
            Rung::GiveUp => {
                return Ok(Some(Ending {
                    outcome: Outcome::Unreachable,
                    reason: format!("target unreachable: {}", record.words()),
                    asked_for: false,
                }));
            }
        }
        Ok(None)
    }

    /// Say again what late joiners need; a few times a second. Says whether it did.
    fn restate_if_due(&mut self) -> Result<bool, SupervisorError> {
        let due = self
            .restated
            .is_none_or(|last| last.elapsed() >= topics::RESTATE);
        if due {
            self.restate()?;
        }
        Ok(due)
    }

    fn restate(&mut self) -> Result<(), SupervisorError> {
        self.restated = Some(Instant::now());
        self.keeper.keep()?;
        // A stage that another starts takes its first tick from here: it must not be one that was made.
        let tick = self.first_tick().saturating_sub(1);
        let pose = self.observer.record.pose;
        let time = pose.map_or(self.beginning.1, |pose| pose.stamp.time());
        let directive = DirectiveSample {
            order: self.order.into(),
            reason: self.reason.into(),
            epoch: self.stall.epoch(),
            ..DirectiveSample::default()
        };
        self.directive.publish(tick, time, directive)?;
        let header = RosterHeader {
            supervisor_pid: std::process::id(),
            order: self.order.into(),
            reason: self.reason.into(),
            simulated: self.simulator.is_some().into(),
            last_request: self.last_request,
            ..RosterHeader::default()
        };
        self.roster
            .publish(tick, time, header, self.fleet.roster().into_iter())?;
        Ok(())
    }

    /// The robot to rest, then the stages down in reverse order, the link last, then the robot itself.
    fn stop(&mut self) -> Result<(), SupervisorError> {
        self.service.stopping();
        (self.order, self.reason) = (Order::Stop, HoldReason::Ending);
        self.stand()?;
        self.fleet.want_no_more();
        self.stop_stages()?;
        if let Some(simulator) = &mut self.simulator {
            simulator.stop()?;
        }
        Ok(())
    }

    /// Make the bus anew under all stages: what the middleware keeps of it lets one of them begin no life. The mission
    /// goes on from what the stages have kept.
    ///
    /// A consumer of the old bus hears nothing more, and one that leaves it as its topic's last takes the topic's file
    /// of the new one for its own: then that topic takes in nobody until the bus is made anew again.
    fn renew(mut self, held: &mut Held) -> Result<Self, SupervisorError> {
        tracing::error!("the bus is made anew; consumers must join it again");
        (self.order, self.reason) = (Order::Hold, HoldReason::Starting);
        self.ready = false;
        self.stand()?;
        self.stop_stages()?;
        // The old ends go before the new bus is made: they would take its files for theirs.
        drop((self.waiter, self.directive, self.roster));
        drop((self.deaths, self.stalls, self.requests, self.bus));
        let record = self.observer.close();
        held.renew()?;
        let bus = bus_of(held)?;
        let mut waiter = Waiter::default();
        let mut observer = Observer::new(&bus, &mut waiter)?;
        observer.record = record;
        waiter.on(bus.alarm(&topics::REQUESTS)?);
        let mut supervisor = Self {
            observer,
            waiter,
            directive: bus.writer(&topics::DIRECTIVE, 1)?,
            roster: bus.slice_writer(&topics::ROSTER, 1, stages::TABLE.len())?,
            deaths: bus.writer(&topics::DEATHS, 1)?,
            stalls: bus.writer(&topics::STALLS, 1)?,
            requests: bus.reader(&topics::REQUESTS)?,
            bus,
            ..self
        };
        supervisor.restate()?;
        supervisor.fleet.start_all(supervisor.first_tick())?;
        supervisor.progressed = (None, Instant::now());
        Ok(supervisor)
    }

    /// Say that the robot is to stand, and wait a moment for the link to say that it was told.
    fn stand(&mut self) -> Result<(), SupervisorError> {
        self.restate()?;
        let began = Instant::now();
        loop {
            self.observer.take(&mut self.fleet)?;
            let confirmed = self.observer.record.link.is_none_or(|link| link.stopped());
            if confirmed || began.elapsed() >= STAND_CONFIRMED {
                break;
            }
            self.waiter.wait(STAND_CONFIRMED)?;
        }
        Ok(())
    }

    /// One after the other, in reverse order.
    fn stop_stages(&mut self) -> Result<(), SupervisorError> {
        while self.fleet.stop_last()? {
            self.wait()?;
            self.observer.take(&mut self.fleet)?;
            self.tend(0)?;
            if let Some(simulator) = &mut self.simulator {
                // Its pipe must not fill: it could not say goodbye either.
                simulator.tend()?;
            }
        }
        Ok(())
    }

    fn finish(self, ending: &Ending) -> Finished {
        let record = self.observer.record;
        let truth = self
            .simulator
            .map_or_else(Vec::new, |simulator| simulator.truth().to_vec());
        let restarts = self.fleet.restarts();
        let resumes = self.keeper.kept.resumes;
        let mission = &self.options.mission;
        let mut summary = Summary::of(mission, ending, &record, &truth, restarts, resumes);
        (summary.replans, summary.resets) = (self.stall.replans(), self.stall.resets());
        // The truth comes through a pipe of its own: a touch on the way may be seen after the arrival.
        let touched =
            summary.outcome == Outcome::Reached && summary.collisions.is_some_and(|n| n > 0);
        if touched {
            summary.outcome = Outcome::Collision;
            summary.reason = "touched something on the way to the target".to_owned();
        }
        Finished {
            summary,
            asked_for: ending.asked_for && !touched,
            record,
            truth,
        }
    }
}

/// The ending that the link's failsafe asks for, if it does.
fn ended_by_the_link(link: &LinkSample) -> Option<Ending> {
    let rule = failsafe::rule(link.cause())?;
    let words = format!("{}: {}", rule.name, rule.when);
    (link.action() == Action::End).then(|| fault(&words))
}

fn fault(reason: &str) -> Ending {
    Ending {
        outcome: Outcome::Aborted,
        reason: reason.to_owned(),
        asked_for: false,
    }
}
