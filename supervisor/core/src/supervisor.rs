//! One robot's supervisor: brings its stages up, lets it drive, watches, brings all down again.
//!
//! Here is its loop; beside it whether the robot may drive ([`order`]), whether the mission has ended ([`judge`]), and
//! how things end ([`end`]).

mod end;
mod error;
mod judge;
mod order;
mod progress;

use std::{
    io,
    os::unix::fs::symlink,
    path::PathBuf,
    rc::Rc,
    time::{Duration, Instant},
};

pub use self::{end::Finished, error::SupervisorError, progress::Progress};
use self::{error::system, judge::fault};
use crate::{
    death::{self, Death},
    domain::DomainLock,
    observer::Observer,
    outcome::{Ending, Outcome},
    recovery::{RecoveredRun, StateFile},
    service_manager::ServiceManager,
    simulator::Simulator,
    stage_processes::{StageProcesses, Starter},
    stages,
    stall::StallWatch,
};
use common::{
    address::Address,
    bus::{Bus, Reader, SliceWriter, Writer},
    clock::{MissionClock, MissionTime, Pace, monotonic_ns},
    domain::{Domain, RobotName},
    mission::Mission,
    run::Run,
    samples::{
        DeathSample, DirectiveSample, HoldReason, Order, RequestSample, RosterEntry, RosterHeader,
        StallSample,
    },
    signals::{SIGHUP, SIGINT, SIGTERM, Signals},
    topics,
    waiter::Waiter,
};

/// How often the bus is cleared at least: of consumers that died.
const CLEAR_UP: Duration = Duration::from_secs(1);

/// A death is often followed by another within this: its successor's, or a sibling's.
const CLEANUP_DELAY: Duration = Duration::from_millis(50);

/// What a run is made from.
pub struct Options {
    /// What to do.
    pub mission: Mission,
    /// For whom.
    pub robot: RobotName,
    /// How mission time passes; a real robot only knows wall-clock.
    pub pace: Pace,
    /// Where logs, checkpoints and results go; must exist.
    pub directory: PathBuf,
    /// Who starts the stages.
    pub starter: Starter,
    /// The run in that directory, to go on with; none begins one.
    pub recovered: Option<RecoveredRun>,
}

/// Carry out a run. `watch` is called a few times a second.
pub fn run(
    options: &Options,
    watch: &mut dyn FnMut(&Progress<'_>),
) -> Result<Finished, SupervisorError> {
    let mut signals =
        Signals::catch(&[SIGINT, SIGTERM, SIGHUP]).map_err(system("catch signals"))?;
    let mut lock = DomainLock::acquire(
        Domain::of(options.robot.clone()),
        options.mission.grid_frame().area(),
    )?;
    let mut supervisor = Supervisor::start(options, bus_of(&lock)?)?;
    let ending = loop {
        match supervisor.drive(&mut signals, watch) {
            Ok(Some(ending)) => break Ok(ending),
            Ok(None) => supervisor = supervisor.recreate_bus(&mut lock)?,
            Err(error) => break Err(error),
        }
    };
    // Whatever went wrong, the robot is stopped first and the stages go in order.
    let stopped = supervisor.stop();
    let ending = ending?;
    stopped?;
    Ok(supervisor.finish(ending))
}

fn bus_of(lock: &DomainLock) -> Result<Rc<Bus>, SupervisorError> {
    let bus = lock.bus();
    bus.ok_or_else(|| system("keep the bus")(io::ErrorKind::NotConnected.into()))
}

struct Supervisor<'a> {
    options: &'a Options,
    // Dropped in this order: the stages go before the robot they speak to.
    stages: StageProcesses,
    simulator: Option<Simulator>,
    observer: Observer,
    waiter: Waiter,
    ends: Ends,
    last_request: u64,
    state_file: StateFile,
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
    /// Stages that died since, and when the last one did.
    died: (usize, Instant),
    /// Processes whose remains are not cleared up yet.
    pending_cleanup: Vec<u32>,
    clock: MissionClock,
    address: Address,
    service: ServiceManager,
}

/// The supervisor's own ends on the bus.
struct Ends {
    bus: Rc<Bus>,
    directive: Writer<DirectiveSample>,
    roster: SliceWriter<RosterHeader, RosterEntry>,
    deaths: Writer<DeathSample>,
    stalls: Writer<StallSample>,
    requests: Reader<RequestSample>,
}

impl Ends {
    /// All of them; `waiter` wakes for requests.
    fn open(bus: Rc<Bus>, waiter: &mut Waiter) -> Result<Self, SupervisorError> {
        waiter.on(bus.wakeup(&topics::REQUESTS)?);
        Ok(Self {
            directive: bus.writer(&topics::DIRECTIVE, 1)?,
            roster: bus.slice_writer(&topics::ROSTER, 1, stages::TABLE.len())?,
            deaths: bus.writer(&topics::DEATHS, 1)?,
            stalls: bus.writer(&topics::STALLS, 1)?,
            requests: bus.reader(&topics::REQUESTS)?,
            bus,
        })
    }
}

impl<'a> Supervisor<'a> {
    /// The robot, the run file, the stages.
    fn start(options: &'a Options, bus: Rc<Bus>) -> Result<Self, SupervisorError> {
        let directory = &options.directory;
        let mission = &options.mission;
        let mut state_file = StateFile::open(directory)?;
        let (simulator, address) = match &mission.robot.address {
            Some(address) => (None, address.parse::<Address<String>>()?.resolve()?),
            None => {
                let simulator = Simulator::start(directory, mission, options.pace)?;
                let address = Address::Udp(simulator.address());
                (Some(simulator), address)
            }
        };
        let (clock, beginning) = match (&options.recovered, options.pace) {
            (Some(recovered), _) => {
                state_file.state.resumes += 1;
                let (tick, time) = (recovered.first_tick, recovered.time);
                tracing::warn!(tick, seconds = time.seconds(), "the run goes on");
                (recovered.clock(), (tick, time))
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
        let ends = Ends::open(bus, &mut waiter)?;
        let mut supervisor = Self {
            options,
            stages: StageProcesses::new(
                directory.clone(),
                options.starter,
                mission.grid_frame().area(),
            ),
            simulator,
            observer,
            waiter,
            ends,
            last_request: 0,
            state_file,
            beginning,
            order: Order::Hold,
            reason: HoldReason::Starting,
            ready: false,
            stall: StallWatch::new(mission),
            judged_tick: None,
            restated: None,
            progressed: (None, Instant::now()),
            cleared_up: Instant::now(),
            died: (0, Instant::now()),
            pending_cleanup: Vec::new(),
            clock,
            address,
            service: ServiceManager::of_environment(),
        };
        supervisor.restate()?;
        supervisor.stages.start_all(beginning.0)?;
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
            if self.stages.is_start_blocked() {
                return Ok(None);
            }
            if self.restate_if_due()? {
                let progress = Progress {
                    record: &self.observer.record,
                    alive: self.stages.alive(),
                    driving: self.order == Order::Drive,
                    straight_m: self.options.mission.target.length(),
                };
                watch(&progress);
                self.service.show(|| progress.to_string());
            }
            self.clear_up_if_due();
            self.service.feed();
            self.wait()?;
        }
    }

    /// Wait for the bus, a child, a signal, a deadline.
    fn wait(&self) -> Result<(), SupervisorError> {
        let mut descriptors = self.stages.descriptors();
        if let Some(simulator) = &self.simulator {
            descriptors.extend(simulator.descriptors());
        }
        let deadlines = [self.stages.time_to_deadline(), self.service.time_to_feed()];
        let soonest = deadlines.into_iter().flatten().min();
        let patience = soonest.map_or(topics::RESTATE, |soonest| soonest.min(topics::RESTATE));
        self.waiter.wait_also_for(&descriptors, patience)?;
        Ok(())
    }

    /// Take what came, tend the stages, judge.
    fn turn(&mut self) -> Result<Option<Ending>, SupervisorError> {
        let became_ready = self.observer.take(&mut self.stages)?;
        let first_tick = self.first_tick();
        let asked = self.take_requests(first_tick)?;
        let died = self.tend(first_tick)?;
        let driven = self.order == Order::Drive;
        self.stages.judge_outputs(driven, first_tick)?;
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
        let deaths = self.stages.tend(&self.ends.bus, first_tick)?;
        let pose = self.observer.record.pose.unwrap_or_default();
        for death in &deaths {
            death.log();
            self.ends
                .deaths
                .publish(pose.stamp.tick, pose.stamp.time(), death.sample())?;
            let file = self.options.directory.join(death::FILE_NAME);
            death
                .append_to(&self.options.directory)
                .map_err(system(format!("write {}", file.display())))?;
        }
        self.pending_cleanup
            .extend(deaths.iter().map(|death| death.pid));
        if !deaths.is_empty() {
            self.died = (self.died.0 + deaths.len(), Instant::now());
        }
        if deaths.iter().any(Death::was_refused) {
            // Its place may be one that the dead still hold.
            self.clear_up();
        }
        Ok(!deaths.is_empty())
    }

    /// Free what the dead held once their successors work and nobody dies any more: a start takes about as long, and
    /// would wait for it. But sooner when so many are dead that places on the bus may run out. And free what consumers
    /// held that died, of which nobody tells us.
    fn clear_up_if_due(&mut self) {
        let (died, last) = self.died;
        let quiet = died > 0 && last.elapsed() >= CLEANUP_DELAY && !self.stages.any_starting();
        let many = died >= stages::TABLE.len();
        if quiet || many || self.cleared_up.elapsed() >= CLEAR_UP {
            self.clear_up();
        }
    }

    /// What cannot be freed makes the bus slower, not wrong.
    fn clear_up(&mut self) {
        self.cleared_up = Instant::now();
        self.died.0 = 0;
        match self.ends.bus.clear_up(&self.pending_cleanup) {
            Ok(true) => self.pending_cleanup.clear(),
            Ok(false) => {}
            Err(error) => {
                let dead = std::mem::take(&mut self.pending_cleanup);
                tracing::warn!(%error, ?dead, "cannot remove what the dead left on the bus");
            }
        }
    }
}
