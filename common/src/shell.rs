//! The process shell every stage runs in: open the topics, wait, turn, beat, stop on a signal.
//!
//! A stage's own shell file implements [`Process`]: it wires topics to its pure step, and nothing else.

use std::{fs::File, os::fd::OwnedFd, path::PathBuf, time::Duration};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use thiserror::Error;

use crate::{
    bus::{Bus, BusError, Writer},
    checkpoint::CheckpointError,
    clock::{MissionClock, MissionTime, monotonic_ns},
    domain::{Domain, RobotName},
    external,
    faults::{Asked, Requests},
    run::{self, Run, RunError},
    samples::{FaultAnswer, FaultKind, HealthSample, HealthState, name},
    signals::{SIGTERM, Signals},
    topics,
    waiter::Waiter,
};

/// How often a stage beats, and the longest it waits: a tenth of the tightest deadline set on beats,
/// and a hundredth of a percent of a core.
pub const BEAT: Duration = Duration::from_millis(20);

/// On a wall clock, quiet of this length means that the tick is over: it takes a tenth of that.
const LULL: Duration = Duration::from_millis(5);

/// Which life of which stage this process is.
#[derive(Clone, Debug)]
pub struct Generation {
    /// The stage's name in the table.
    pub stage: &'static str,
    /// Where `run.toml` and the checkpoints lie.
    pub directory: PathBuf,
    /// 1 for the first generation.
    pub number: u32,
    /// Ticks before this one are another life's.
    pub first_tick: u64,
}

/// How a stage's process came to be.
#[derive(Clone, Debug)]
pub enum Start {
    /// The supervisor started it.
    Child {
        /// Which life it is.
        generation: Generation,
        /// The supervisor's process, which must live for this one to live.
        supervisor: u32,
    },
    /// Somebody else started it, for a supervisor that only watches; the rest it finds itself.
    External {
        /// Which stage to be.
        stage: &'static str,
        /// For whom.
        robot: RobotName,
    },
}

/// A process in its place.
pub(crate) struct Joined {
    pub(crate) generation: Generation,
    pub(crate) run: Run,
    pub(crate) bus: Bus,
    /// Becomes readable when the supervisor is gone; a child is signalled instead.
    pub(crate) supervisor: Option<OwnedFd>,
    pub(crate) stage_lock: File,
}

/// Why a stage's process ended.
#[derive(Debug, Error)]
pub enum StageError {
    /// Shared memory.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The run file.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The stage's checkpoint.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// The stage's own affairs.
    #[error("{0}")]
    Other(String),
    /// Signals or process attributes.
    #[error("cannot {action}: {source}; this needs Linux 5.4 or newer")]
    System {
        /// What was tried.
        action: &'static str,
        /// The system's word.
        source: std::io::Error,
    },
}

/// What a stage's process is opened with.
#[derive(Debug)]
pub struct Context {
    /// Which generation.
    pub generation: Generation,
    /// The run.
    pub run: Run,
    /// The robot's bus.
    pub bus: Bus,
    /// What wakes the process; the stage adds its inputs.
    pub waiter: Waiter,
}

impl Context {
    /// Where this stage's checkpoint lies.
    #[must_use]
    pub fn checkpoint_file(&self) -> PathBuf {
        run::checkpoint_file(&self.generation.directory, self.generation.stage)
    }
}

/// How far a stage has come: what its heartbeats are stamped with.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Progress {
    /// The tick last worked on.
    pub tick: u64,
    /// Its mission time.
    pub time: MissionTime,
}

/// A stage wired to its topics.
pub trait Process: Sized {
    /// Open the topics, restore the checkpoint.
    ///
    /// # Errors
    /// When one of them cannot be had.
    fn open(context: &mut Context) -> Result<Self, StageError>;

    /// Take what came, step, publish. Called whenever something may have come, and each [`BEAT`].
    ///
    /// # Errors
    /// When the stage cannot go on; it will be restarted.
    fn turn(&mut self) -> Result<Progress, StageError>;

    /// Open what nobody waits for. Called once, after the first beat that says ready.
    ///
    /// # Errors
    /// When it cannot be had.
    fn after_ready(&mut self, context: &Context) -> Result<(), StageError> {
        let _ = context;
        Ok(())
    }

    /// Do what nobody waits for: a map told whole again, a snapshot. The scheduler may let a stage that
    /// goes on computing keep the processor from the one it has just woken, so on a wall clock this waits
    /// for a lull; on a clock of ticks, where ticks follow each other without one, it comes after each turn.
    ///
    /// # Errors
    /// When the stage cannot go on; it will be restarted.
    fn idle(&mut self) -> Result<(), StageError> {
        Ok(())
    }

    /// Break like this, on purpose. Says whether it could be done: whether the fault is one of this stage's, and
    /// what it breaks is there.
    ///
    /// # Errors
    /// When the stage cannot go on; it will be restarted.
    fn inject(&mut self, fault: FaultKind) -> Result<bool, StageError> {
        let _ = fault;
        Ok(false)
    }

    /// Say goodbye.
    ///
    /// # Errors
    /// When that fails.
    fn stop(&mut self) -> Result<(), StageError> {
        Ok(())
    }
}

/// Run a stage until told to stop.
///
/// # Errors
/// What [`Process`] says, or what keeps it from being opened.
pub fn run_stage<P: Process>(start: &Start) -> Result<(), StageError> {
    let terminated = Signals::catch(&[SIGTERM]).map_err(system("catch SIGTERM"))?;
    let Joined {
        generation,
        run,
        bus,
        supervisor,
        stage_lock: _stage_lock,
    } = match start {
        Start::Child {
            generation,
            supervisor,
        } => join_as_child(generation, *supervisor)?,
        Start::External { stage, robot } => external::join(stage, robot)?,
    };
    let mut waiter = Waiter::default();
    waiter.on_readable(&terminated)?;
    if let Some(supervisor) = &supervisor {
        waiter.on_readable(supervisor)?;
    }
    let mut end = End {
        terminated,
        supervisor,
    };
    let mut heart = Heart::new(&bus, &generation)?;
    heart.beat(HealthState::Starting, Progress::default())?;
    let number = generation.number;
    let mut context = Context {
        generation,
        run,
        bus,
        waiter,
    };
    let mut process = P::open(&mut context)?;
    tracing::info!(generation = number, "ready");
    let worked = work(&mut process, &mut heart, &context, &mut end);
    // Whatever went wrong, goodbye is said: the link's stops the robot.
    let stopped = process.stop();
    tracing::info!("stopped");
    worked.and(stopped)
}

fn join_as_child(generation: &Generation, supervisor: u32) -> Result<Joined, StageError> {
    become_child(generation.stage, supervisor)?;
    let run = Run::load(&generation.directory)?;
    let domain = Domain::of(run.robot.clone());
    let stage_lock = enter(&domain)?;
    let bus = Bus::join(&domain, generation.stage)?;
    Ok(Joined {
        generation: generation.clone(),
        run,
        bus,
        supervisor: None,
        stage_lock,
    })
}

pub(crate) fn enter(domain: &Domain) -> Result<File, StageError> {
    domain
        .enter()
        .map_err(system("enter the robot's directory"))
}

/// What ends a stage in order: SIGTERM, or the end of a supervisor that is not its parent.
struct End {
    terminated: Signals,
    supervisor: Option<OwnedFd>,
}

impl End {
    fn came(&mut self) -> bool {
        self.terminated.came() || self.supervisor.as_ref().is_some_and(readable)
    }
}

/// Whether `descriptor` is readable now.
fn readable(descriptor: &OwnedFd) -> bool {
    let mut polled = [PollFd::new(descriptor, PollFlags::IN)];
    matches!(poll(&mut polled, Some(&Timespec::default())), Ok(ready) if ready > 0)
}

fn work(
    process: &mut impl Process,
    heart: &mut Heart,
    context: &Context,
    end: &mut End,
) -> Result<(), StageError> {
    let without_lulls = matches!(context.run.clock, MissionClock::Ticks { .. });
    let mut progress = process.turn()?;
    heart.beat(HealthState::Ready, progress)?;
    process.after_ready(context)?;
    let simulated = context.run.mission.robot.address.is_none();
    let mut faults = Requests::open(&context.bus, &context.generation, simulated)?;
    let mut busy = true;
    while !end.came() {
        let came = context.waiter.wait(if busy { LULL } else { BEAT })?;
        progress = process.turn()?;
        if without_lulls || busy && !came {
            process.idle()?;
        }
        busy = came;
        if heart.beat_if_due(progress)? {
            while let Some(Asked { id, fault }) = faults.take()? {
                let answer = inject(process, fault)?;
                tracing::warn!(?fault, ?answer, "asked for a fault");
                heart.answer(id, answer, progress)?;
                while fault == Ok(FaultKind::Spin) && !end.came() {
                    std::hint::spin_loop();
                }
                while fault == Ok(FaultKind::Mute) && !end.came() {
                    std::thread::sleep(BEAT);
                    heart.beat(HealthState::Ready, progress)?;
                }
            }
        }
    }
    heart.beat(HealthState::Stopping, progress)
}

/// Put the fault that was asked for into `process`, if that may be.
fn inject(
    process: &mut impl Process,
    request: Result<FaultKind, FaultAnswer>,
) -> Result<FaultAnswer, StageError> {
    Ok(match request {
        Err(answer) => answer,
        // Those that every stage has are done in the work loop.
        Ok(FaultKind::Spin | FaultKind::Mute) => FaultAnswer::Taken,
        Ok(fault) if process.inject(fault)? => FaultAnswer::Taken,
        Ok(_) => FaultAnswer::Impossible,
    })
}

fn system(action: &'static str) -> impl FnOnce(std::io::Error) -> StageError {
    move |source| StageError::System { action, source }
}

/// Take a name that `ps` and `pkill` show, and get SIGTERM when `supervisor` dies.
///
/// # Errors
/// When the supervisor is gone already, or the system is no Linux.
pub fn become_child(process_name: &str, supervisor: u32) -> Result<(), StageError> {
    name_process(process_name)?;
    rustix::process::set_parent_process_death_signal(Some(rustix::process::Signal::TERM))
        .map_err(|errno| system("tie the process to its supervisor")(errno.into()))?;
    // It may have died before that took hold.
    let parent = rustix::process::getppid().map_or(0, |pid| pid.as_raw_nonzero().get() as u32);
    if parent == supervisor {
        Ok(())
    } else {
        Err(StageError::Other(format!(
            "supervisor {supervisor} is gone; start stages through `firsthand run`"
        )))
    }
}

/// Take a name that `ps` and `pkill` show.
pub(crate) fn name_process(name: &str) -> Result<(), StageError> {
    // A name with a zero byte cannot come from the table.
    if let Ok(name) = std::ffi::CString::new(name) {
        rustix::thread::set_name(&name)
            .map_err(|errno| system("name the process")(errno.into()))?;
    }
    Ok(())
}

/// Beats from inside the work loop: a stage that hangs or spins stops beating.
struct Heart {
    writer: Writer<HealthSample>,
    sample: HealthSample,
    last_beat_ns: u64,
}

impl Heart {
    fn new(bus: &Bus, generation: &Generation) -> Result<Self, StageError> {
        Ok(Self {
            writer: bus.writer(&topics::HEALTH, generation.number)?,
            sample: HealthSample {
                stage: name(generation.stage),
                pid: std::process::id(),
                ..HealthSample::default()
            },
            last_beat_ns: 0,
        })
    }

    fn beat(&mut self, state: HealthState, progress: Progress) -> Result<(), StageError> {
        self.sample.state = state.into();
        self.last_beat_ns = monotonic_ns();
        self.writer
            .publish(progress.tick, progress.time, self.sample)?;
        Ok(())
    }

    /// Says whether it was due.
    fn beat_if_due(&mut self, progress: Progress) -> Result<bool, StageError> {
        self.sample.turns += 1;
        let due = monotonic_ns() - self.last_beat_ns >= BEAT.as_nanos() as u64;
        if due {
            self.beat(HealthState::Ready, progress)?;
        }
        Ok(due)
    }

    /// Say what was made of the fault that was asked for under `id`.
    fn answer(
        &mut self,
        id: u64,
        answer: FaultAnswer,
        progress: Progress,
    ) -> Result<(), StageError> {
        self.sample.last_fault = id;
        self.sample.fault_answer = answer.into();
        self.beat(HealthState::Ready, progress)
    }
}
