//! The simulated machine: clock, processes, and what runs next.
//!
//! The supervisor is the caller. Whenever it waits, the machine runs the events of the others until
//! the supervisor's inputs are ready: turns of stages, datagrams, the robot, and disturbances, each
//! at its time. Events at one time run in a fixed order, so a seed decides everything.

use std::{
    cell::{Cell, RefCell},
    collections::BTreeMap,
    net::{Ipv4Addr, SocketAddr},
    rc::{Rc, Weak},
    time::Duration,
};

use common::{
    bus::{Bus, Memory},
    clock::Pace,
    ground_truth::GroundTruthTick,
    machine::{Files, Machine, MachineWire},
    mission::Mission,
    run::Run,
    samples::PoseSample,
    shell::Simulated,
    start::Generation,
};
use mission_control::Finished;
use processes::{activity::Activity, process::ExitCause, stages};
use rustix::process::Signal;
use summary::Summary;
use x80_sim::{InMemory, SimError};

use crate::{
    Observer, Ran, Scenario,
    disturbance::{Disturbance, Request, What, inject, say_beacon},
    fault_injector::FaultInjector,
    guard::Guard,
    invariant::{Broken, Checked, Invariants},
    load::Load,
    process::{Process, killed_by},
    random::Random,
    wire::{HostEnd, Port, Way, Wires},
};

/// Monotonic clock at the start, nanoseconds.
const BEGIN_NS: u64 = 1_000_000_000_000;
const FIRST_PROCESS: u32 = 1000;
/// Process that publishes operators' requests, and the one that checks the invariants.
const OPERATOR: u32 = 1;
const OBSERVER: u32 = 2;
const GUARD: u32 = 3;
pub const LINK: &str = "link";
/// Ticks that a pose may be late.
const RECENT_TICKS: usize = 400;
/// Most events of a second; in lockstep a run takes little more.
const MOST_EVENTS: u64 = 200_000;
/// Time of a supervisor's turn: even one that never waits lets time pass.
const LEAST_WAIT: Duration = Duration::from_micros(20);

enum Event {
    Disturbance,
    ToRobot,
    ToHost,
    Robot,
    Guard,
    Turn(u32),
}

#[derive(Default)]
pub struct SimulatedMachine {
    own: Weak<Self>,
    now_ns: Cell<u64>,
    running: Cell<u32>,
    supervisor: Cell<u32>,
    supervisors: Cell<u32>,
    ends_ns: Cell<u64>,
    processes_started: Cell<u32>,
    /// Operations that a process still completes before its death.
    doomed: RefCell<BTreeMap<u32, u32>>,
    files: Files,
    memory: RefCell<Rc<Memory>>,
    wires: Rc<RefCell<Wires>>,
    robot: RefCell<Option<InMemory>>,
    /// `None` for a robot that stays healthy.
    faults: Option<RefCell<FaultInjector>>,
    guard: RefCell<Guard>,
    processes: RefCell<BTreeMap<u32, Process>>,
    random: RefCell<Random>,
    load: Load,
    /// The soonest last.
    disturbances: RefCell<Vec<Disturbance>>,
    invariants: RefCell<Invariants>,
    observer: Option<Rc<RefCell<dyn Observer>>>,
    broken: RefCell<Option<Broken>>,
    is_ended: Cell<bool>,
    events: Cell<u64>,
    /// Second of the clock, and the events before it.
    second: Cell<(u64, u64)>,
}

impl SimulatedMachine {
    pub fn new(scenario: &Scenario, observer: Option<Rc<RefCell<dyn Observer>>>) -> Rc<Self> {
        let Scenario { seed, load, .. } = *scenario;
        let mut disturbances = scenario.disturbances.clone();
        disturbances.sort_by_key(|disturbance| std::cmp::Reverse(disturbance.at));
        let is_fault = |it: &Disturbance| matches!(it.what, What::Fault(Some(_)));
        let protocol = scenario.mission.robot.protocol();
        let invariants = Invariants::new(protocol, scenario.pace == Pace::Max);
        let faults = disturbances.iter().any(is_fault);
        let faults = faults.then(|| RefCell::new(FaultInjector::new(&scenario.mission, seed)));
        Rc::new_cyclic(|own| Self {
            own: own.clone(),
            now_ns: Cell::new(BEGIN_NS),
            running: Cell::new(OBSERVER),
            supervisor: Cell::new(OBSERVER),
            ends_ns: Cell::new(u64::MAX),
            wires: Rc::new(RefCell::new(Wires::new(seed))),
            faults,
            random: RefCell::new(Random::new(seed, 0)),
            load,
            disturbances: RefCell::new(disturbances),
            invariants: RefCell::new(invariants),
            observer,
            ..Self::default()
        })
    }

    pub fn now(&self) -> Duration {
        Duration::from_nanos(self.monotonic_ns() - BEGIN_NS)
    }

    pub fn place(&self, robot: InMemory) {
        self.robot.replace(Some(robot));
    }

    pub fn truth(&self) -> Option<GroundTruthTick> {
        self.robot.borrow().as_ref()?.truth.last().copied()
    }

    /// Returns the ground truth of a recent pose, by its counts.
    pub fn truth_of(&self, pose: &PoseSample) -> Option<GroundTruthTick> {
        let robot = self.robot.borrow();
        let recent = robot.as_ref()?.truth.iter().rev().take(RECENT_TICKS);
        recent.copied().find(|tick| tick.is_of(pose))
    }

    /// Takes what came of the run.
    pub fn take_ran(&self, finished: Option<Finished>, summary: Option<Summary>) -> Ran {
        let mut invariants = self.invariants.borrow_mut();
        Ran {
            finished,
            summary,
            broken: self.broken.take(),
            events: self.events.get(),
            simulated: self.now(),
            supervisors: self.supervisors.get(),
            truth: self.robot.take().map(|robot| robot.truth).unwrap_or_default(),
            moved: invariants.moved,
            causes: std::mem::take(&mut invariants.causes),
        }
    }

    /// Copies the ground truth that `to` does not have yet.
    pub fn add_truth(&self, to: &mut Vec<GroundTruthTick>) {
        if let Some(robot) = &*self.robot.borrow() {
            to.extend_from_slice(robot.truth.get(to.len()..).unwrap_or_default());
        }
    }

    /// Sets the time after which a run that goes on breaks an invariant.
    pub fn end_after(&self, time: Duration) {
        self.ends_ns.set(BEGIN_NS + time.as_nanos() as u64);
    }

    /// Returns whether the scenario has ended or an invariant is broken.
    pub fn is_over(&self) -> bool {
        self.is_ended.get() || self.broken.borrow().is_some()
    }

    pub fn check_end(&self, mission: &Mission, finished: &Finished) {
        self.judge(self.invariants.borrow().check_end(self, mission, finished));
    }

    /// Begins the life of a supervisor, with a new bus. Returns the bus.
    pub fn start_supervisor(&self) -> Bus {
        let process = self.new_process();
        self.supervisors.update(|supervisors| supervisors + 1);
        self.supervisor.set(process);
        self.running.set(process);
        self.new_bus()
    }

    /// Makes a bus for the supervisor and its next stages.
    pub fn new_bus(&self) -> Bus {
        let memory = Rc::<Memory>::default();
        self.memory.replace(Rc::clone(&memory));
        self.invariants.borrow_mut().on_bus(&memory);
        if let Some(observer) = &self.observer {
            observer.borrow_mut().on_bus(&Bus::in_memory(Rc::clone(&memory), None));
        }
        Bus::in_memory(memory, Some(self.supervisor.get()))
    }

    pub fn supervisor_is_killed(&self) -> bool {
        self.has_met_doom(self.supervisor.get())
    }

    fn has_met_doom(&self, process: u32) -> bool {
        self.doomed.borrow().get(&process) == Some(&0)
    }

    /// Passes time without a supervisor, whose stages end in order.
    pub fn pass(&self, time: Duration) {
        self.running.set(OBSERVER);
        for process in self.processes.borrow_mut().values_mut() {
            (process.is_terminated, process.due_ns) = (true, self.monotonic_ns());
        }
        self.run_until(self.monotonic_ns() + time.as_nanos() as u64, &mut || false);
    }

    fn new_process(&self) -> u32 {
        self.processes_started.update(|started| started + 1);
        FIRST_PROCESS + self.processes_started.get()
    }

    pub fn start(&self, generation: &Generation, run: Run) -> u32 {
        let process = self.new_process();
        if generation.stage == LINK {
            self.guard.borrow_mut().run = Some(run.clone());
        }
        let due_ns = self.monotonic_ns() + self.lateness().0;
        let started = Process::new(generation, run, due_ns);
        self.processes.borrow_mut().insert(process, started);
        process
    }

    pub fn signal(&self, process: u32, signal: Signal) {
        let mut processes = self.processes.borrow_mut();
        let Some(process) = processes.get_mut(&process).filter(|process| process.is_live()) else {
            return;
        };
        match signal {
            // A stopped process takes no other signal than SIGKILL.
            _ if process.frozen && signal != Signal::KILL => {}
            Signal::KILL | Signal::ABORT => self.end(process, killed_by(signal)),
            Signal::TERM if process.turns.is_none() => self.end(process, killed_by(signal)),
            _ => (process.is_terminated, process.due_ns) = (true, self.monotonic_ns()),
        }
    }

    /// Returns how the process ended, if it did, and forgets it.
    pub fn reap(&self, process: u32) -> Option<ExitCause> {
        let mut processes = self.processes.borrow_mut();
        let exit = processes.get_mut(&process)?.exit.take()?;
        processes.remove(&process);
        Some(exit)
    }

    /// Returns the activity of a live process since its start.
    pub fn activity(&self, process: u32) -> Option<Activity> {
        let processes = self.processes.borrow();
        let process = processes.get(&process).filter(|process| process.is_live())?;
        Some(process.activity(self.monotonic_ns()))
    }

    /// Draws the time from a wakeup to its turn, and which part of it the process starves.
    fn lateness(&self) -> (u64, Duration) {
        let mut random = self.random.borrow_mut();
        let starved = match self.load.starved {
            (share, mean) if share > 0.0 && random.chance(share) => random.exponential(mean),
            _ => Duration::ZERO,
        };
        let latency = random.exponential(self.load.latency);
        ((latency + starved).as_nanos() as u64, starved)
    }

    /// Returns the soonest event, of those at one time the first.
    fn next(&self) -> Option<(u64, Event)> {
        let disturbances = self.disturbances.borrow();
        let disturbs = disturbances.last().map(|it| BEGIN_NS + it.at.as_nanos() as u64);
        let wires = self.wires.borrow();
        let others = [
            (disturbs, Event::Disturbance),
            (wires.next_ns(Way::ToRobot), Event::ToRobot),
            (wires.next_ns(Way::ToHost), Event::ToHost),
            (self.robot.borrow().as_ref().and_then(InMemory::next_due_ns), Event::Robot),
            (self.guard.borrow().due_ns, Event::Guard),
        ];
        let processes = self.processes.borrow();
        let turns = processes.iter().map(|(nth, process)| (process.next_ns(), Event::Turn(*nth)));
        let all = others.into_iter().chain(turns);
        all.filter_map(|(at_ns, event)| Some((at_ns?, event))).min_by_key(|(at_ns, _)| *at_ns)
    }

    /// Runs events until `deadline_ns`, or until `is_ready`, whose turn comes late like others'.
    fn run_until(&self, deadline_ns: u64, is_ready: &mut dyn FnMut() -> bool) {
        let mut until_ns = None;
        while !self.is_over() {
            if until_ns.is_none() && is_ready() {
                until_ns = Some((self.monotonic_ns() + self.lateness().0).min(deadline_ns));
            }
            let due = self.next().filter(|(at_ns, _)| *at_ns <= until_ns.unwrap_or(deadline_ns));
            let Some((at_ns, event)) = due else { break };
            self.pass_to(at_ns);
            if self.monotonic_ns() > self.ends_ns.get() {
                self.break_off("a run ends", "it outlasts its mission's timeout".to_owned());
            }
            self.execute(&event);
        }
        // Time passes after the last event, too, so that the supervisor does what ends it.
        self.pass_to(until_ns.unwrap_or(deadline_ns));
    }

    fn pass_to(&self, time_ns: u64) {
        self.now_ns.set(self.monotonic_ns().max(time_ns));
    }

    fn execute(&self, event: &Event) {
        let before = self.running.replace(OBSERVER);
        self.events.update(|events| events + 1);
        let (second, since) = self.second.get();
        if second != self.now().as_secs() {
            self.second.set((self.now().as_secs(), self.events.get()));
        } else if self.events.get() - since > MOST_EVENTS {
            self.break_off("time passes", format!("{MOST_EVENTS} events in a second"));
        }
        match event {
            Event::Disturbance => {
                if let Some(Disturbance { what, .. }) = self.disturbances.borrow_mut().pop() {
                    self.disturb(&what);
                }
            }
            Event::ToRobot => {
                let datagram = self.wires.borrow_mut().take(Way::ToRobot);
                if let Some((from, mut bytes)) = datagram {
                    if let Some(faults) = &self.faults {
                        bytes = faults.borrow_mut().order(&bytes);
                    }
                    let from = SocketAddr::from((Ipv4Addr::LOCALHOST, from));
                    self.with_robot(|robot| robot.hear(from, &bytes));
                }
            }
            Event::ToHost => self.wires.borrow_mut().deliver_to_host(),
            Event::Robot => self.with_robot(InMemory::pass),
            Event::Guard => {
                self.running.set(GUARD);
                let is_succeeded = self.link_is_open();
                self.guard.borrow_mut().turn(self.monotonic_ns(), is_succeeded);
            }
            Event::Turn(process) => self.turn(*process),
        }
        self.wake();
        self.running.set(OBSERVER);
        if let Some(observer) = &self.observer {
            observer.borrow_mut().observe();
        }
        self.judge(self.invariants.borrow_mut().check(self));
        self.running.set(before);
    }

    fn with_robot(&self, act: impl FnOnce(&mut InMemory) -> Result<(), SimError>) {
        let mut robot = self.robot.borrow_mut();
        let Some(robot) = &mut *robot else { return };
        self.or_break_off("the robot runs", act(robot));
        let mut wires = self.wires.borrow_mut();
        let lane = wires.lane(Way::ToHost);
        for (to, datagram) in robot.sent() {
            let to = to.port();
            let Some(faults) = &self.faults else {
                lane.send(to, &datagram, self.monotonic_ns());
                continue;
            };
            for late in faults.borrow_mut().report(&datagram, self.now()) {
                lane.send(to, &late.bytes, BEGIN_NS + late.at.as_nanos() as u64);
            }
        }
    }

    pub fn send_to_robot(&self, from: Port, bytes: &[u8]) {
        self.invariants.borrow_mut().on_sent(bytes, self.now());
        self.wires.borrow_mut().lane(Way::ToRobot).send(from, bytes, self.monotonic_ns());
    }

    fn judge(&self, checked: Checked) {
        if let Err((invariant, detail)) = checked {
            self.break_off(invariant, detail);
        }
    }

    /// Returns what an invariant wants, or breaks off without it.
    pub fn or_break_off<T>(
        &self,
        invariant: &'static str,
        result: Result<T, impl ToString>,
    ) -> Option<T> {
        result.map_err(|error| self.break_off(invariant, error.to_string())).ok()
    }

    /// Ends the simulation: the supervisor fails whatever it does next.
    pub fn break_off(&self, invariant: &'static str, detail: String) {
        let (event, at) = (self.events.get(), self.now());
        let broken = Broken { invariant, detail, event, at };
        self.broken.borrow_mut().get_or_insert(broken);
        self.kill_supervisor(0);
    }

    fn kill_supervisor(&self, operations: u32) {
        self.doomed.borrow_mut().insert(self.supervisor.get(), operations);
    }

    /// Gives every process whose input has come a turn.
    fn wake(&self) {
        let mail = self.wires.borrow().has_mail();
        for process in self.processes.borrow_mut().values_mut() {
            let has_mail = mail && process.stage == LINK;
            let woken = process.turns.as_ref().is_some_and(|it| it.is_woken() || has_mail);
            if woken && process.woken_ns.is_none() {
                self.make_ready(process);
            }
        }
    }

    /// Lets a process wait for a processor.
    fn make_ready(&self, process: &mut Process) {
        let (late_ns, starved) = self.lateness();
        process.starves = starved;
        let from_ns = self.monotonic_ns().max(process.busy_until_ns);
        process.woken_ns = Some(from_ns + late_ns);
    }

    fn turn(&self, number: u32) {
        if let Some(process) = self.processes.borrow_mut().get_mut(&number)
            && process.woken_ns.is_none()
            && process.turns.is_some()
        {
            self.make_ready(process);
            if process.woken_ns > Some(self.monotonic_ns()) {
                return;
            }
        }
        let Some(mut process) = self.processes.borrow_mut().remove(&number) else { return };
        self.running.set(number);
        process.woken_ns = None;
        process.starved += std::mem::take(&mut process.starves);
        let turned = match (&mut process.turns, process.starts.take()) {
            (_, Some((generation, run))) => self.open(generation, run).and_then(|mut turns| {
                let turned = turns.turn();
                process.turns = Some(turns);
                turned
            }),
            (Some(turns), _) if process.is_terminated => turns.stop().map(|()| None),
            (Some(turns), _) => match &self.observer {
                Some(observer) => {
                    let mut turned = Ok(None);
                    let mut turn = || turned = turns.turn();
                    observer.borrow_mut().turn(process.stage, &mut turn);
                    turned
                }
                None => turns.turn(),
            },
            (None, None) => Ok(None),
        };
        let work = self.load.work;
        process.ran += work;
        process.busy_until_ns = self.monotonic_ns() + work.as_nanos() as u64;
        match turned {
            _ if self.has_met_doom(number) => {
                self.end(&mut process, killed_by(Signal::KILL));
            }
            Err(error) => self.end(&mut process, ExitCause::Exited(error.exit_code().into())),
            Ok(Some(patience)) => {
                process.due_ns = process.busy_until_ns + patience.as_nanos() as u64;
            }
            Ok(None) if process.is_terminated => self.end(&mut process, ExitCause::Exited(0)),
            Ok(None) => process.spins_since_ns = Some(self.monotonic_ns()),
        }
        self.processes.borrow_mut().insert(number, process);
    }

    fn open(&self, generation: Generation, run: Run) -> common::start::Result<Box<dyn Simulated>> {
        let bus = Bus::in_memory(Rc::clone(&self.memory.borrow()), Some(self.supervisor.get()));
        match stages::find(generation.stage) {
            Some(stage) => (stage.simulate)(generation, run, bus),
            None => Err(common::start::StageError::Other("no such stage".to_owned())),
        }
    }

    pub fn process_of(&self, stage: &str) -> Option<u32> {
        let processes = self.processes.borrow();
        let mut live = processes.iter().filter(|(_, it)| it.stage == stage && it.is_live());
        live.next_back().map(|(number, _)| *number)
    }

    /// Returns whether the link's process has opened its topics.
    pub fn link_is_open(&self) -> bool {
        let processes = self.processes.borrow();
        processes.values().any(|it| it.stage == LINK && it.is_live() && it.turns.is_some())
    }

    fn disturb(&self, what: &What) {
        use What::*;
        self.invariants.borrow_mut().on_disturbance(what, self.now());
        match what {
            Kill(stage) => {
                self.with(stage, |process| self.end(process, killed_by(Signal::KILL)));
            }
            KillAfter(stage, operations) => {
                if let Some(process) = self.process_of(stage) {
                    self.doomed.borrow_mut().insert(process, *operations);
                }
            }
            KillSupervisor(operations) => self.kill_supervisor(*operations),
            Freeze(stage) => self.with(stage, |process| process.frozen = true),
            Thaw(stage) => self.with(stage, |process| {
                process.frozen = false;
                process.due_ns = process.due_ns.max(self.monotonic_ns());
            }),
            Hang(stage) => {
                self.with(stage, |process| process.spins_since_ns = Some(self.monotonic_ns()));
            }
            Wire(way, quality) => self.wires.borrow_mut().lane(*way).quality = *quality,
            Ask(request) => self.ask(*request),
            // Nobody hears either while there is no bus.
            Break(stage, kind) => {
                let _ = self.as_operator(|bus| inject(bus, stage, *kind));
            }
            Beacon(place) => {
                let _ = self.as_operator(|bus| say_beacon(bus, *place));
            }
            Fault(fault) => {
                if let Some(faults) = &self.faults {
                    faults.borrow_mut().set(*fault);
                }
            }
            End => {
                self.is_ended.set(true);
                self.kill_supervisor(0);
            }
        }
    }

    /// Publishes an operator's request.
    pub fn ask(&self, request: Request) {
        let here = self.truth().map(|truth| truth.pose());
        // Nobody hears an operator while there is no supervisor.
        let _ = self.as_operator(|bus| request.publish(bus, here.unwrap_or_default()));
    }

    /// Acts as another process on the bus, whose operations are not counted as the running one's.
    pub fn as_operator<T>(&self, act: impl FnOnce(&Bus) -> T) -> T {
        let before = self.running.replace(OPERATOR);
        let done = act(&Bus::in_memory(Rc::clone(&self.memory.borrow()), None));
        self.running.set(before);
        done
    }

    /// Changes the live process of a stage, if there is one.
    fn with(&self, stage: &str, change: impl FnOnce(&mut Process)) {
        if let Some(process) = self.process_of(stage)
            && let Some(process) = self.processes.borrow_mut().get_mut(&process)
        {
            change(process);
        }
    }

    fn end(&self, process: &mut Process, cause: ExitCause) {
        (process.exit, process.turns, process.starts) = (Some(cause), None, None);
        if process.stage == LINK {
            self.guard.borrow_mut().on_link_ended(self.monotonic_ns());
        }
    }
}

impl Machine for SimulatedMachine {
    fn monotonic_ns(&self) -> u64 {
        self.now_ns.get()
    }

    fn process(&self) -> u32 {
        self.running.get()
    }

    fn wait(&self, timeout: Duration, is_ready: &dyn Fn() -> bool) -> bool {
        if self.running.get() != self.supervisor.get() {
            return is_ready();
        }
        let timeout_ns = timeout.max(LEAST_WAIT).as_nanos() as u64;
        let deadline_ns = self.monotonic_ns().saturating_add(timeout_ns);
        self.run_until(deadline_ns, &mut || self.supervisor_is_killed() || is_ready());
        is_ready()
    }

    fn is_killed(&self) -> bool {
        match self.doomed.borrow_mut().get_mut(&self.running.get()) {
            None => false,
            Some(0) => true,
            Some(left) => {
                *left -= 1;
                false
            }
        }
    }

    fn files(&self) -> &Files {
        &self.files
    }

    fn wire(&self, _: &str) -> Box<dyn MachineWire> {
        Box::new(HostEnd::open(&self.wires, self.own.clone()))
    }
}
