//! A run from start to end: lock the domain, start the stages, drive the mission, stop everything.

use std::collections::BTreeMap;

use common::{ground_truth::GroundTruthTick, signals::Signals};
use processes::{
    domain::DomainLock,
    last_resort::{self, Turns},
    records,
};

use crate::{
    decisive::{self, Timeout},
    error::{Result, system},
    observer::{Listener, Record},
    outcome::{Ending, Outcome, Wheels, allowed_m},
    progress::Progress,
    supervisor::{Options, Supervisor},
    surroundings::{Real, Surroundings},
    target_list::{self, TargetOutcome, TargetResult},
};

pub struct Finished {
    pub ending: Ending,
    /// `None` if no tick decided.
    pub last_tick: Option<u64>,
    /// Seconds of the robot's clock from the first motion order to the end. A resumed wall-clock
    /// run counts from its own start.
    pub duration_s: f64,
    pub record: Record,
    pub truth: Vec<GroundTruthTick>,
    pub drove: bool,
    /// Whether mission time followed the robot's ticks, as in lockstep.
    pub in_ticks: bool,
    pub restarts: BTreeMap<&'static str, u32>,
    pub resumes: u32,
    /// Planner generations started because of stalls.
    pub replans: u32,
    pub resets: u64,
    pub targets: Vec<TargetResult>,
}

/// Robot in motion after every stop method. Its link keeps trying each in turn.
pub struct StillMoving<'a> {
    supervisor: Supervisor<'a>,
    signals: Signals,
}

impl StillMoving<'_> {
    /// Waits until the robot rests or a signal ends the wait. Returns the robot's last state.
    pub fn watch(mut self) -> Result<&'static str> {
        let supervisor = &mut self.supervisor;
        let did = loop {
            supervisor.wait_turn()?;
            supervisor.take_requests()?;
            match supervisor.wheels() {
                Wheels::AtRest => break "rests",
                wheels if self.signals.came() => {
                    break if wheels == Wheels::Turning {
                        "was left while it moved"
                    } else {
                        "was left"
                    };
                }
                _ => supervisor.wait()?,
            }
        };
        supervisor.stop_processes()?;
        Ok(did)
    }
}

/// End signals of a run, for its loop and for the last resort.
pub type EndSignals = [Signals; 2];

/// Catches the signals from now on, before the run's first file, so that a signal leaves no files.
pub fn end_signals() -> Result<EndSignals> {
    let catch = || Signals::that_end().map_err(system("catch signals"));
    Ok([catch()?, catch()?])
}

/// Process that should receive every sample of a run, which waits for it.
///
/// Both calls return on a signal or after their own timeout. By default they do nothing.
pub trait Consumer {
    /// Starts the consumer, after the bus and before the stages.
    fn attach(&mut self, _signals: &Signals) {}

    /// Waits until the consumer has read all samples.
    ///
    /// Called in lockstep every [`CAUGHT_UP_EVERY`] ticks, fewer than the bus keeps, and always
    /// before the stages end: a writer's unread samples vanish with it.
    fn catch_up(&mut self, _signals: &Signals) {}
}

impl Consumer for () {}

pub(crate) const CAUGHT_UP_EVERY: u64 = 32;

/// `listener` receives the samples that the run reads. `show` is called a few times a second. The
/// robot's files stay until `lock` is dropped, after the consumers.
pub fn run<'a>(
    options: &'a Options,
    [signals, for_last_resort]: EndSignals,
    lock: &mut Option<DomainLock>,
    consumer: &mut dyn Consumer,
    listener: Listener,
    show: &mut dyn FnMut(&Progress<'_>),
) -> Result<(Finished, Option<StillMoving<'a>>)> {
    let turns = Turns::default();
    let domain = options.robot.domain();
    last_resort::watch(for_last_resort, turns.clone(), domain.clone());
    let cells = options.mission.grid_frame().area();
    let lock = lock.insert(DomainLock::acquire(domain.clone(), cells)?);
    let mut surroundings = Real { domain, lock, signals, consumer };
    let (finished, moving) = conduct(options, &mut surroundings, &turns, listener, show)?;
    let signals = surroundings.signals;
    Ok((finished, moving.map(|supervisor| StillMoving { supervisor, signals })))
}

/// Returns the supervisor of a robot that still moves.
pub(crate) fn conduct<'a>(
    options: &'a Options,
    surroundings: &mut dyn Surroundings,
    turns: &Turns,
    listener: Listener,
    show: &mut dyn FnMut(&Progress<'_>),
) -> Result<(Finished, Option<Supervisor<'a>>)> {
    let mut supervisor = Supervisor::start(options, surroundings, turns.clone(), listener)
        .inspect_err(|_| turns.rest(true))?;
    let ending = loop {
        let goes_on = match supervisor.drive(surroundings, show) {
            Ok(Some(ending)) => break ending,
            Ok(None) => supervisor.recreate_bus(surroundings),
            Err(error) => Err(error),
        };
        if let Err(error) = goes_on {
            break Ending::failed(Outcome::Aborted, error.to_string());
        }
    };
    let stopped = supervisor.end_mission(&mut || {
        turns.rest(true);
        surroundings.let_catch_up();
        turns.rest(false);
    });
    turns.rest(true);
    let wheels = stopped.unwrap_or_else(|error| Wheels::Unknown(error.to_string()));
    supervisor.end_following(TargetOutcome::Followed);
    let end_by_stall = supervisor.end_by_stall();
    let deadline = supervisor.deadline();
    let mut truth = supervisor.robot.truth().to_vec();
    let mut record = std::mem::take(&mut supervisor.record);
    let mut targets = supervisor.targets.clone();
    targets.compare(&record, &truth, allowed_m(&options.mission));
    record.arrival.take_if(|_| !targets.is_last());
    let decided = decisive::first(
        ending,
        &record,
        &truth,
        &options.mission,
        Timeout { deadline, by_robot: supervisor.clock.in_ticks() },
        end_by_stall,
    );
    let (replans, resets) = supervisor.stall_watch.recoveries(decided.last_tick);
    truth.truncate(decided.truth_ticks);
    let (ended, at_rest) = (truth.last(), record.pose.as_ref());
    let ending =
        decided.ending.checked(&options.mission, targets.current.position(), ended, at_rest);
    let recorded = targets.recorded;
    let targets = targets.results(&ending, decided.last_tick, record.arrival.as_ref(), ended);
    for result in targets.iter().skip(recorded) {
        records::append(&options.directory, records::TARGETS, result);
    }
    let ending = target_list::of_all(ending, &targets);
    let finished = Finished {
        duration_s: supervisor.clock.duration_s(decided.last_tick, &record, &truth),
        ending: ending.with(wheels.clone()),
        last_tick: decided.last_tick,
        record,
        truth,
        drove: supervisor.drove,
        restarts: supervisor.stages.restarts().collect(),
        in_ticks: supervisor.clock.in_ticks(),
        resumes: supervisor.state.resumes,
        replans,
        resets,
        targets,
    };
    Ok((finished, (wheels == Wheels::Turning).then_some(supervisor)))
}

pub fn simulate(
    options: &Options,
    surroundings: &mut dyn Surroundings,
    listener: Listener,
) -> Result<Finished> {
    conduct(options, surroundings, &Turns::default(), listener, &mut |_| {})
        .map(|(finished, _)| finished)
}
