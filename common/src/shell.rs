//! Process shell of every stage: join the run, open the declared topics, wait, take a turn, publish
//! heartbeats, stop on a signal.

mod fault_requests;

use std::{
    env, fmt,
    io::{self, Write as _},
    os::fd::{AsFd, OwnedFd},
    path::PathBuf,
    process::ExitCode,
    time::Duration,
};

use serde::{Deserialize, Serialize, de::DeserializeOwned};

use self::fault_requests::Requests;
use crate::{
    bus::{Bus, Stamp, Writer, Writers},
    checkpoint::Checkpoint,
    clock::{Instant, MissionClock, MissionTime, monotonic_ns},
    driver::Refusal,
    external,
    journal::{Journal, Restored},
    machine,
    outputs::Saved,
    poll,
    roster::{NAMED_WITHIN, Roster},
    run::{self, Run},
    samples::{ComplaintSample, FaultAnswer, FaultKind, HealthSample, HealthState, name, name_str},
    signals::{SIGTERM, Signals},
    stage_command,
    start::{self, Generation, Joined, Start, system},
    topics,
    waiter::Waiter,
    wiring::{Persists, Readers, Topics, Wiring},
};

pub use crate::start::{Result, StageError};

/// Pause without input that marks the end of a tick on a wall clock; a tick takes a tenth of it.
const TICK_OVER: Duration = Duration::from_millis(5);
/// Longest wait of idle work for such a pause. A starved stage has none, and its journal would grow
/// without bound.
const IDLE_WITHIN: Duration = Duration::from_secs(1);

pub struct Context {
    pub generation: Generation,
    pub run: Run,
    pub waiter: Waiter,
    pub(crate) bus: Bus,
    /// Open file until the process's outputs take it.
    pub(crate) saved: Saved,
    pub(crate) wiring: &'static Wiring,
}

impl Context {
    pub fn writers(&self) -> Option<Writers> {
        self.bus.writers().cloned()
    }

    pub fn saved_state<T: DeserializeOwned>(&mut self) -> Result<Option<T>> {
        let Persists::State(bytes) = self.wiring.persists else {
            return Ok(None);
        };
        let (checkpoint, state) = Checkpoint::open(&self.checkpoint_file(), bytes)?;
        self.saved = Saved::State(checkpoint);
        Ok(state)
    }

    /// Returns what the stage's last process saved. The state has at most `bytes`.
    pub fn saved_journal<S: DeserializeOwned, E: DeserializeOwned>(
        &mut self,
        bytes: usize,
        entry_bytes: usize,
    ) -> Result<Restored<S, E>> {
        let (journal, restored) = Journal::open(&self.checkpoint_file(), bytes, entry_bytes)?;
        self.saved = Saved::Journal(journal);
        Ok(restored)
    }

    fn checkpoint_file(&self) -> PathBuf {
        run::checkpoint_file(&self.generation.directory, self.generation.stage)
    }
}

/// Current tick of a stage, which its heartbeats carry in their stamps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    pub tick: u64,
    pub time: MissionTime,
}

impl Progress {
    pub const fn of(stamp: &Stamp) -> Self {
        Self { tick: stamp.tick, time: stamp.time() }
    }
}

/// Stage wired to its topics. An error ends the process.
pub trait Process: Sized {
    const NAME: &'static str;
    const WAKES: Topics;
    const OUTPUTS: Topics;
    const PERSISTS: Persists = Persists::Nothing;
    type Readers: Readers;

    const WIRING: &'static Wiring = &Wiring {
        stage: Self::NAME,
        inputs: Self::Readers::INPUTS,
        feedback: Self::Readers::FEEDBACK,
        wakes: Self::WAKES,
        outputs: Self::OUTPUTS,
        persists: Self::PERSISTS,
    };

    /// Restores the checkpoint and opens everything except readers.
    fn open(context: &mut Context, readers: Self::Readers) -> Result<Self>;

    /// Takes pending inputs, steps and publishes. Called on input and for each heartbeat.
    fn turn(&mut self) -> Result<Progress>;

    /// Opens resources that no process waits for. Called once, after the first ready heartbeat.
    fn after_ready(&mut self, _context: &mut Context) -> Result {
        Ok(())
    }

    fn has_idle_work(&self) -> bool {
        false
    }

    /// Returns the time without input after which to check the clock; `None` for a stage that only
    /// answers inputs.
    fn looks_again_after(&self) -> Option<Duration> {
        None
    }

    /// Does work that no process waits for: publishes a whole map again, saves a snapshot.
    ///
    /// To leave the processor to the stage just woken, on a wall clock it runs in the pause after a
    /// tick, or after a second without one, if [`Process::has_idle_work`] says so. In lockstep,
    /// without pauses, it runs after each turn.
    fn idle(&mut self) -> Result {
        Ok(())
    }

    /// Injects a fault. Returns false if the stage has no such fault, or nothing to inject it into
    /// yet.
    fn inject(&mut self, _fault: FaultKind) -> Result<bool> {
        Ok(false)
    }

    /// What the user must mend before the stage can work as it should. The shell publishes it again and again.
    fn trouble(&mut self) -> Option<Refusal> {
        None
    }

    fn stop(&mut self) -> Result {
        Ok(())
    }
}

/// Implements `main` of a stage's executable. The supervisor saves standard error as the stage's
/// log.
pub fn main<P: Process>() -> ExitCode {
    let stage = P::WIRING.stage;
    let start = match stage_command::start(stage, env::args_os().skip(1)) {
        Ok(start) => start,
        Err(error) => {
            complain(&error);
            return ExitCode::from(WRONG_USAGE);
        }
    };
    match run_stage::<P>(&start) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            complain(&format_args!("{stage}: {error}"));
            ExitCode::from(error.exit_code())
        }
    }
}

/// If that fails, the exit code still reports it.
fn complain(error: &dyn fmt::Display) {
    let _ = writeln!(io::stderr(), "{error}");
}

/// Exit code for a wrong command line; `firsthand` has the same.
const WRONG_USAGE: u8 = 2;

/// Time for readers to connect to a stage that cannot start, whose samples end with it.
const CONNECTED_WITHIN: Duration = Duration::from_millis(200);

pub fn run_stage<P: Process>(start: &Start) -> Result {
    let terminated = Signals::catch(&[SIGTERM]).map_err(system("catch SIGTERM"))?;
    let Joined { generation, run, bus, supervisor, stage_lock: _stage_lock } = match start {
        Start::Child { generation, supervisor } => start::join_as_child(generation, *supervisor)?,
        Start::External { stage, robot } => external::join(stage, robot)?,
    };
    let mut waiter = Waiter::default();
    waiter.on_readable(&terminated)?;
    if let Some(supervisor) = &supervisor {
        waiter.on_readable(supervisor)?;
    }
    let mut stop = StopRequest { terminated, supervisor };
    let (mut host, mut roster) = Host::announce::<P>(generation, run, bus, waiter)?;
    if !roster.await_named(&host.context.bus, NAMED_WITHIN)? {
        tracing::warn!(
            "the supervisor's roster lacks this process; check whether the supervisor is frozen"
        );
    }
    roster.admit(&host.context.bus);
    let mut opened = false;
    let worked = host.open::<P>().and_then(|mut work| {
        opened = true;
        let worked = work.until_stopped(&mut host, &mut stop);
        // After an error, too, the stage is stopped in order: the link then stops the robot.
        let stopped = work.process.stop();
        tracing::info!("stopped");
        worked.and(stopped)
    });
    if let Err(error) = &worked {
        // The stage's log has the error in any case.
        let _ = host.heartbeat.complain(&error.to_string().into());
        if !opened {
            stop.wait(CONNECTED_WITHIN);
        }
    }
    worked
}

/// A stage's process on a simulated machine, which gives it turns.
pub trait Simulated {
    /// Returns the time after which the next is due without input; `None` if the process hangs by
    /// request.
    fn turn(&mut self) -> Result<Option<Duration>>;

    /// The wires of the link wake it apart from this.
    fn is_woken(&self) -> bool;

    fn stop(&mut self) -> Result;
}

struct Simulation<P> {
    host: Host,
    /// Until a roster names the process, and since when it waits.
    starting: Option<(Roster, Instant)>,
    work: Option<Work<P>>,
}

pub fn simulate<P: Process + 'static>(
    generation: Generation,
    run: Run,
    bus: Bus,
) -> Result<Box<dyn Simulated>> {
    let (host, roster) = Host::announce::<P>(generation, run, bus, Waiter::default())?;
    Ok(Box::new(Simulation::<P> { host, starting: Some((roster, Instant::now())), work: None }))
}

impl<P: Process> Simulated for Simulation<P> {
    fn turn(&mut self) -> Result<Option<Duration>> {
        let host = &mut self.host;
        if let Some((mut roster, since)) = self.starting.take() {
            let named = roster.await_named(&host.context.bus, Duration::ZERO)?;
            if !named && since.elapsed() < NAMED_WITHIN {
                self.starting = Some((roster, since));
                return Ok(Some(NAMED_WITHIN.saturating_sub(since.elapsed())));
            }
            roster.admit(&host.context.bus);
            assert!(self.work.is_none());
            let work = self.work.insert(host.open::<P>()?);
            work.begin(host)?;
            return Ok(Some(work.patience(host)));
        }
        let Some(work) = &mut self.work else { return Ok(None) };
        let came = host.context.waiter.is_woken();
        host.context.waiter.wait(Duration::ZERO)?;
        match work.turn(host, came)? {
            Some(FaultKind::Spin | FaultKind::Mute) => {
                self.work = None;
                Ok(None)
            }
            _ => Ok(Some(work.patience(host))),
        }
    }

    fn is_woken(&self) -> bool {
        match &self.starting {
            Some((roster, _)) => roster.waiter.is_woken(),
            None => self.host.context.waiter.is_woken(),
        }
    }

    fn stop(&mut self) -> Result {
        let Some(work) = &mut self.work else { return Ok(()) };
        self.host.heartbeat.beat(HealthState::Stopping, work.progress)?;
        work.process.stop()
    }
}

/// Sources of a stop request: SIGTERM, or the end of a supervisor that is not the parent.
struct StopRequest {
    terminated: Signals,
    supervisor: Option<OwnedFd>,
}

impl StopRequest {
    fn came(&mut self) -> bool {
        let ended = |supervisor| poll::is_readable(supervisor, Duration::ZERO).unwrap_or(false);
        self.terminated.came() || self.supervisor.as_ref().is_some_and(ended)
    }

    fn wait(&self, patience: Duration) {
        let mut sources = vec![self.terminated.as_fd()];
        sources.extend(self.supervisor.as_ref().map(AsFd::as_fd));
        let _ = poll::readable(&sources, Some(patience));
    }
}

struct Host {
    context: Context,
    heartbeat: Heartbeat,
}

impl Host {
    /// Publishes the first heartbeat, which the supervisor answers with a roster.
    fn announce<P: Process>(
        generation: Generation,
        run: Run,
        bus: Bus,
        waiter: Waiter,
    ) -> Result<(Self, Roster)> {
        let mut heartbeat = Heartbeat::new(&bus, &generation, run.clock)?;
        let roster = Roster::open(&bus)?;
        heartbeat.beat(HealthState::Starting, Progress::default())?;
        let context =
            Context { generation, run, bus, waiter, saved: Saved::default(), wiring: P::WIRING };
        Ok((Self { context, heartbeat }, roster))
    }

    fn open<P: Process>(&mut self) -> Result<Work<P>> {
        let context = &mut self.context;
        for topic in P::WIRING.wakes {
            context.waiter.on(context.bus.wakeup(*topic)?);
        }
        let readers = P::Readers::open_readers(&context.bus)?;
        let process = P::open(context, readers)?;
        tracing::info!(generation = context.generation.number, "ready");
        Ok(Work {
            process,
            progress: Progress::default(),
            faults: None,
            busy: true,
            idled: Instant::now(),
            foreign: 0,
            lost: 0,
        })
    }

    const fn ticks_follow_at_once(&self) -> bool {
        matches!(self.context.run.clock, MissionClock::Ticks { .. })
    }
}

struct Work<P> {
    process: P,
    progress: Progress,
    /// `None` before the first ready heartbeat.
    faults: Option<Requests>,
    busy: bool,
    idled: Instant,
    /// Process whose samples were ignored last.
    foreign: u32,
    lost: u64,
}

impl<P: Process> Work<P> {
    fn until_stopped(&mut self, host: &mut Host, stop: &mut StopRequest) -> Result {
        self.begin(host)?;
        while !stop.came() {
            let came = host.context.waiter.wait(self.patience(host))?;
            let endless = self.turn(host, came)?;
            while endless == Some(FaultKind::Spin) && !stop.came() {
                std::hint::spin_loop();
            }
            while endless == Some(FaultKind::Mute) && !stop.came() {
                std::thread::park_timeout(host.heartbeat.period);
                host.heartbeat.beat(HealthState::Ready, self.progress)?;
            }
        }
        host.heartbeat.beat(HealthState::Stopping, self.progress)
    }

    fn begin(&mut self, host: &mut Host) -> Result {
        self.progress = self.process.turn()?;
        if host.ticks_follow_at_once() {
            // Idle work belongs to the previous tick.
            self.process.idle()?;
        }
        host.heartbeat.beat(HealthState::Ready, self.progress)?;
        let context = &mut host.context;
        self.process.after_ready(context)?;
        let simulated = context.run.mission.robot.address.is_none();
        let faults = Requests::open(&context.bus, context.generation.stage, simulated)?;
        self.faults = Some(faults);
        self.idled = Instant::now();
        Ok(())
    }

    fn patience(&self, host: &Host) -> Duration {
        const { assert!(TICK_OVER.as_millis() < IDLE_WITHIN.as_millis()) };
        let pause = (self.busy && self.process.has_idle_work()).then_some(TICK_OVER);
        let waits = [pause, self.process.looks_again_after()];
        waits.into_iter().flatten().fold(host.heartbeat.time_to_beat(), Duration::min)
    }

    /// Takes a turn after a wait in which input `came`. Returns a requested fault that never ends.
    fn turn(&mut self, host: &mut Host, came: bool) -> Result<Option<FaultKind>> {
        self.progress = self.process.turn()?;
        let overdue = self.process.has_idle_work() && self.idled.elapsed() >= IDLE_WITHIN;
        if host.ticks_follow_at_once() || self.busy && !came || overdue {
            self.process.idle()?;
        }
        if !self.process.has_idle_work() {
            self.idled = Instant::now();
        }
        self.busy = came;
        if !host.heartbeat.beat_if_due(self.progress)? {
            return Ok(None);
        }
        let Host { heartbeat, context } = host;
        if let Some(trouble) = self.process.trouble() {
            heartbeat.complain(&trouble)?;
        }
        let ignored = context.bus.writers().map(Writers::ignored).unwrap_or_default();
        if ignored.process != self.foreign {
            self.foreign = ignored.process;
            let what = "its samples are ignored, because the supervisor's roster lacks it";
            let trouble = Refusal {
                input: format!("process {}", self.foreign),
                what: what.to_owned(),
                remedy: "end it".to_owned(),
            };
            tracing::warn!("{trouble}");
            heartbeat.complain(&trouble)?;
        }
        if context.bus.lost() > 2 * self.lost {
            self.lost = context.bus.lost();
            let trouble = "/dev/shm is full and samples are lost; remove files from it".into();
            tracing::warn!(self.lost, "{trouble}");
            heartbeat.complain(&trouble)?;
        }
        while let Some((id, fault)) =
            self.faults.as_mut().map(Requests::take).transpose()?.flatten()
        {
            let answer = inject(&mut self.process, fault)?;
            tracing::warn!(?fault, ?answer, "a fault was requested");
            heartbeat.answer(id, answer, self.progress)?;
            if let Ok(endless @ (FaultKind::Spin | FaultKind::Mute)) = fault {
                return Ok(Some(endless));
            }
        }
        Ok(None)
    }
}

fn inject(
    process: &mut impl Process,
    request: Result<FaultKind, FaultAnswer>,
) -> Result<FaultAnswer> {
    Ok(match request {
        Err(answer) => answer,
        // The work loop injects the faults that every stage has.
        Ok(FaultKind::Spin | FaultKind::Mute) => FaultAnswer::Taken,
        Ok(fault) if process.inject(fault)? => FaultAnswer::Taken,
        Ok(_) => FaultAnswer::Impossible,
    })
}

/// Heartbeat from inside the work loop, so a stage that hangs or spins falls silent.
struct Heartbeat {
    writer: Writer<HealthSample>,
    sample: HealthSample,
    /// Opened before there is trouble: readers need time to connect.
    complaints: Writer<ComplaintSample>,
    /// Longest time between beats, and the longest wait for input.
    period: Duration,
    last: Instant,
    tick: u64,
    clock: MissionClock,
}

impl Heartbeat {
    fn new(bus: &Bus, generation: &Generation, clock: MissionClock) -> Result<Self> {
        let period = topics::HEALTH.spec().restated_every();
        assert!(!period.is_zero());
        Ok(Self {
            writer: bus.writer(&topics::HEALTH, generation.number)?,
            sample: HealthSample {
                stage: name(generation.stage),
                pid: machine::process(),
                ..HealthSample::default()
            },
            complaints: bus.writer(&topics::COMPLAINTS, generation.number)?,
            period,
            last: Instant::now(),
            tick: 0,
            clock,
        })
    }

    fn beat(&mut self, state: HealthState, progress: Progress) -> Result {
        self.beat_quietly(state, progress)?;
        Ok(self.writer.wake()?)
    }

    fn beat_quietly(&mut self, state: HealthState, progress: Progress) -> Result {
        self.sample.state = state.into();
        self.last = Instant::now();
        self.tick = progress.tick;
        Ok(self.writer.publish_quietly(progress.tick, progress.time, self.sample, &[])?)
    }

    /// Publishes `trouble` with the present time: readers drop old trouble, and the stage may have
    /// had no tick yet.
    fn complain(&mut self, trouble: &Refusal) -> Result {
        let complaint = ComplaintSample::of(name_str(&self.sample.stage), trouble);
        let now = self.clock.at(self.tick, monotonic_ns());
        Ok(self.complaints.publish_quietly(self.tick, now, complaint, &[])?)
    }

    fn time_to_beat(&self) -> Duration {
        self.period.saturating_sub(self.last.elapsed())
    }

    /// Sends a due heartbeat and returns whether it did.
    ///
    /// After a tick the stage is awake and beats early and quietly: this saves a wakeup, and the
    /// end of the tick wakes the supervisor.
    fn beat_if_due(&mut self, progress: Progress) -> Result<bool> {
        self.sample.turns += 1;
        let age = self.last.elapsed();
        if progress.tick != self.tick && age >= self.period / 2 {
            self.beat_quietly(HealthState::Ready, progress)?;
        } else if age >= self.period {
            self.beat(HealthState::Ready, progress)?;
        } else {
            return Ok(false);
        }
        Ok(true)
    }

    fn answer(&mut self, id: u64, answer: FaultAnswer, progress: Progress) -> Result {
        self.sample.last_fault = id;
        self.sample.fault_answer = answer.into();
        self.beat(HealthState::Ready, progress)
    }
}
