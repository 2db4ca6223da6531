//! Model check of every history of eleven events around an operator's stop: the real step beside a
//! plain model of its peers.
//!
//! The search is breadth first, and continues equal states once. States are equal if everything
//! that stops and starts the robot is, with times as ages. Evidence of motion monitors (odometry,
//! ranges, response, other commanders) is ignored: the modelled robot obeys, too slowly to be
//! judged.

use std::{collections::HashSet, sync::LazyLock, thread};

use common::{
    bus::{Admitted, Author, Writers},
    topics::DIRECTIVE,
};
use x80_driver::X80;

use super::*;
use crate::failsafe::{
    TABLE,
    monitor::{Condition, Monitor as _},
};

/// Least clock reading, above all other numbers.
const BEGAN_NS: u64 = 1_000_000_000_000_000;
const DEPTH: usize = 11;
const TICK_MS: u64 = 100;
/// Longest deadline: greater ages are equal.
const OLD_NS: u64 = 2_400_000_000;
/// Beyond a command's 250 ms ages are equal.
const OLD_COMMAND_NS: u64 = 300_000_000;

#[derive(Clone, Copy, Debug)]
enum Happens {
    Tick,
    /// Long enough for the cause to apply.
    Pause,
    CauseBegins,
    CauseEnds,
    /// Requests reach the link and the supervisor separately, in any order.
    Stop,
    Resume,
    SupervisorHearsStop,
    SupervisorHearsResume,
    /// The last command before the stop, late or again.
    OldCommand,
    LinkRestarts,
    SupervisorRestarts,
    SecondSupervisor,
}

use Happens::*;

const ALL: [Happens; 12] = [
    Tick,
    Pause,
    CauseBegins,
    CauseEnds,
    Stop,
    Resume,
    SupervisorHearsStop,
    SupervisorHearsResume,
    OldCommand,
    LinkRestarts,
    SupervisorRestarts,
    SecondSupervisor,
];

/// Causes, and the milliseconds within which each must hold the robot.
const CAUSES: [(Cause, u64); 6] = [
    (Cause::RobotLost, 750),
    (Cause::FramesSilent, 750),
    (Cause::CommandStale, 250),
    (Cause::StageHeld, 2 * TICK_MS),
    (Cause::SupervisorSilent, 2000),
    (Cause::BatteryEmpty, 2000 + 2 * TICK_MS),
];

#[derive(Clone, Debug, Default)]
struct Supervisor {
    process: u32,
    is_starting: bool,
    operator_stop: bool,
    resumed_ns: u64,
    /// When an operator asked; not yet received.
    asked_stop: Option<u64>,
    asked_resume: Option<u64>,
    said: Option<Order>,
}

struct World {
    link: Link,
    now_ns: u64,
    is_marked: bool,
    supervisor: Supervisor,
    counts: [f64; 2],
    told: [i16; 2],
    cause: (Cause, u64),
    cause_since: Option<u64>,
    stopped_ns: u64,
    is_stopped: bool,
    newest: Option<CommandSample>,
    old: Option<CommandSample>,
    moved: u64,
    history: Vec<Happens>,
}

/// Read once, as that takes longer than a step.
static MISSION: LazyLock<Mission> = LazyLock::new(x80);

fn started(now_ns: u64, next_tick: u64) -> Link {
    let mut link = super::started(&MISSION, Pace::Rate(1.0), next_tick);
    link.now = MissionTime(now_ns);
    link
}

impl Clone for World {
    fn clone(&self) -> Self {
        let link = &self.link;
        // Whole datagrams leave nothing in a driver that a stop depends on.
        let link = Link {
            base: Box::new(X80::new(&MISSION)),
            drivers: Vec::new(),
            effects: Vec::new(),
            sensors: link.sensors.clone(),
            speeds: link.speeds.clone(),
            failsafe: link.failsafe.clone(),
            restart: link.restart.clone(),
            trim: link.trim.clone(),
            open: link.open.clone(),
            ..*link
        };
        Self { link, supervisor: self.supervisor.clone(), history: self.history.clone(), ..*self }
    }
}

impl World {
    fn new(cause: (Cause, u64)) -> Self {
        let supervisor = Supervisor { process: 1, is_starting: true, ..Supervisor::default() };
        let mut world = Self {
            link: started(BEGAN_NS, 0),
            now_ns: BEGAN_NS,
            is_marked: false,
            supervisor,
            counts: [0.0; 2],
            told: [0; 2],
            cause,
            cause_since: None,
            stopped_ns: 0,
            is_stopped: false,
            newest: None,
            old: None,
            moved: 0,
            history: Vec::new(),
        };
        (0..5).for_each(|_| world.tick());
        assert!(world.moved > 0, "it drives at first");
        world
    }

    /// Gives `event` to the link; judges, obeys and acknowledges its output. Returns its effects.
    fn give(&mut self, event: Event<'_>) -> Vec<Effect> {
        let entry = Entry { event, machine_ns: self.now_ns, now: MissionTime(self.now_ns) };
        let effects = self.link.step(entry);
        // The process does so after each turn.
        self.is_marked = self.link.is_stopped_by_operator();
        for velocity in velocities(&effects) {
            let counts = velocity.map(Option::unwrap_or_default);
            self.told = [counts[0].saturating_neg(), counts[1]];
            if counts != [0, 0] {
                self.moved += 1;
                self.judge_motion();
            }
        }
        let decision = self.link.decision;
        let is_held = !self.is_cause_due() || decision.stops();
        assert!(is_held, "{:?} holds: {decision:?}, {:?}", self.cause, self.history);
        if !self.has(Cause::RobotLost) {
            let acknowledged = ack().repeat(sent(&effects).len());
            if !acknowledged.is_empty() {
                self.give(Event::Datagram(&acknowledged));
            }
        }
        effects
    }

    fn judge_motion(&self) {
        let history = &self.history;
        assert!(!self.is_stopped, "it moves although an operator stopped it: {history:?}");
        let obeyed = self.link.newest_command.unwrap().stamp.stamp_ns;
        assert!(obeyed > self.stopped_ns, "it obeys a command from before the stop: {history:?}");
        let said = self.supervisor.said;
        assert_eq!(said, Some(Order::Drive), "it obeys another supervisor: {history:?}");
        assert!(!self.is_cause_due(), "it moves under {:?}: {history:?}", self.cause);
    }

    fn is_cause_due(&self) -> bool {
        self.cause_since.is_some_and(|since| self.now_ns - since > self.cause.1 * MS)
    }

    fn has(&self, cause: Cause) -> bool {
        self.cause_since.is_some() && self.cause.0 == cause
    }

    fn pass(&mut self, ms: u64) {
        self.now_ns += ms * MS;
        for (counts, told) in self.counts.iter_mut().zip(self.told) {
            *counts += f64::from(told) * ms as f64 * 1e-3;
        }
    }

    fn order(&mut self, process: u32, order: Order, reason: HoldReason) {
        let own = Writers::of(self.supervisor.process);
        let mut admitted = Admitted::of(DIRECTIVE.spec(), Some(&own));
        if admitted.admits(Author { process, generation: u32::MAX }).unwrap() {
            self.give(Event::Order(order, reason));
        }
    }

    fn tick(&mut self) {
        self.pass(TICK_MS / 2);
        self.give(Event::Quiet);
        self.pass(TICK_MS / 2 - 1);
        if !self.has(Cause::SupervisorSilent) {
            let supervisor = &mut self.supervisor;
            let (order, reason) = if std::mem::take(&mut supervisor.is_starting) {
                (Order::Hold, HoldReason::Starting)
            } else if supervisor.operator_stop {
                (Order::Hold, HoldReason::Operator)
            } else if self.cause.0 == Cause::StageHeld && self.cause_since.is_some() {
                (Order::Hold, HoldReason::StageHeld)
            } else {
                (Order::Drive, HoldReason::None)
            };
            supervisor.said = Some(order);
            let process = supervisor.process;
            self.order(process, order, reason);
        }
        self.pass(1);
        if !self.has(Cause::RobotLost) {
            let board_battery = if self.has(Cause::BatteryEmpty) { 2000 } else { 3900 };
            let mut reports =
                vec![Report::Standard(StandardSensors { board_battery, ..standard(255) })];
            if !self.has(Cause::FramesSilent) {
                let [left, right] = self.counts;
                reports.push(motor([-left, right].map(on_wire)));
            }
            let effects = self.give(Event::Datagram(&encoded(reports)));
            for (tick, ..) in ticks(&effects) {
                if !self.has(Cause::CommandStale) {
                    // Below 0.03 m/s at the rim, so no monitor judges it.
                    let command = command(tick, self.now_ns, [0.3; 2]);
                    self.newest = Some(command);
                    self.give(Event::Command(command));
                }
            }
        }
    }

    /// Returns None if that cannot happen now.
    fn happen(&mut self, what: Happens) -> Option<()> {
        self.history.push(what);
        // Simultaneous requests have distinct times.
        let asked_ns = self.now_ns + self.history.len() as u64;
        match what {
            Tick => self.tick(),
            Pause => (0..self.cause.1 / TICK_MS + 2).for_each(|_| self.tick()),
            CauseBegins if self.cause_since.is_none() => self.cause_since = Some(self.now_ns),
            CauseEnds if self.cause_since.is_some() => self.cause_since = None,
            Stop => {
                (self.is_stopped, self.stopped_ns) = (true, self.now_ns);
                self.old = self.newest;
                self.supervisor.asked_stop = Some(asked_ns);
                self.give(Event::Operator(Request::Stop));
            }
            Resume if self.is_stopped => {
                self.is_stopped = false;
                self.supervisor.asked_resume = Some(asked_ns);
                self.give(Event::Operator(Request::Resume));
            }
            SupervisorHearsStop => {
                let asked_ns = self.supervisor.asked_stop.take()?;
                self.supervisor.operator_stop |= asked_ns >= self.supervisor.resumed_ns;
            }
            SupervisorHearsResume => {
                self.supervisor.resumed_ns = self.supervisor.asked_resume.take()?;
                self.supervisor.operator_stop = false;
            }
            OldCommand => drop(self.give(Event::Command(self.old?))),
            LinkRestarts => self.restart_link(),
            SupervisorRestarts => {
                // Its bus and link restart, and it remembers the operator's stop alone.
                let Supervisor { process, operator_stop, .. } = self.supervisor;
                self.supervisor = Supervisor {
                    process: process + 1,
                    is_starting: true,
                    operator_stop,
                    ..Supervisor::default()
                };
                self.restart_link();
            }
            SecondSupervisor => {
                let own = self.supervisor.process;
                for other in [own - 1, own + 1] {
                    self.order(other, Order::Drive, HoldReason::None);
                }
            }
            CauseBegins | CauseEnds | Resume => return None,
        }
        Some(())
    }

    fn restart_link(&mut self) {
        self.link = started(self.now_ns, self.link.state.next_tick);
        self.supervisor.said = None;
        if self.has(Cause::BatteryEmpty) {
            // The next link must see it again; the supervisor ended the mission.
            self.cause_since = Some(self.now_ns);
        }
        if self.is_marked {
            self.give(Event::Operator(Request::Stop));
        }
    }

    fn key(&self) -> String {
        let machine_ns = self.now_ns;
        let moment = Moment { time: MissionTime(machine_ns), machine_ns, ..Moment::default() };
        let (link, supervisor) = (&self.link, &self.supervisor);
        let all = &link.failsafe;
        let applied = Vec::from_iter(TABLE.iter().map(|row| link.failsafe.applied(row.cause)));
        let does_not_stop = all.stop.condition(Cause::RobotDoesNotStop, moment);
        let presence = (all.presence.connected, all.presence.is_silent(self.now_ns));
        // The last send's time matters only for late acknowledgements.
        let latency = format!("{:?}", all.latency);
        let latency = latency.split("came_late").last();
        let command = |command: Option<CommandSample>| {
            let age = |then_ns: u64| (self.now_ns - then_ns).min(OLD_COMMAND_NS);
            let stamp = command.map(|command| command.stamp.stamp_ns);
            let stood = link.stood.map(|stood| stood.0);
            (stamp.map(age), stamp.map(|at| [at > self.stopped_ns, Some(at) > stood]))
        };
        let resumed_ns = supervisor.resumed_ns;
        let newer = |asked: Option<u64>| asked.map(|asked_ns| asked_ns >= resumed_ns);
        let asked = (newer(supervisor.asked_stop), newer(supervisor.asked_resume));
        let in_order = supervisor.asked_stop < supervisor.asked_resume;
        let held_ns = self.cause_since.map(|since| self.now_ns - since);
        let state = (
            (&all.orders, presence, latency, &all.battery, all.streams.motor_frames(self.now_ns)),
            (does_not_stop == Condition::Holds, all.stop.method, applied, link.decision),
            (link.repeat.map(|repeat| repeat.due <= link.now), link.open.is_some()),
            (command(link.newest_command), command(self.old), command(self.newest)),
            (self.is_marked, supervisor.is_starting, supervisor.operator_stop, asked, in_order),
            (self.is_stopped, supervisor.said, held_ns.map(|ns| ns.min(self.cause.1 * MS + 1))),
        );
        let is_mark = |letter: char| !letter.is_alphanumeric();
        let as_age = |word: &str| match word.trim_end_matches(is_mark).parse::<u64>() {
            Ok(ns) if ns >= BEGAN_NS => format!("{} ", self.now_ns.saturating_sub(ns).min(OLD_NS)),
            _ => word.to_owned(),
        };
        format!("{state:?}").split_inclusive(is_mark).map(as_age).collect()
    }
}

fn explore(cause: (Cause, u64)) {
    let first = World::new(cause);
    let mut seen = HashSet::from([first.key()]);
    let (mut newest, mut moved) = (vec![first], 0);
    for _ in 0..DEPTH {
        let mut next = Vec::new();
        for world in newest {
            for what in ALL {
                let mut world = world.clone();
                let before = world.moved;
                if world.happen(what).is_some() {
                    moved += world.moved - before;
                    if seen.insert(world.key()) {
                        next.push(world);
                    }
                }
            }
        }
        newest = next;
    }
    let states = seen.len();
    assert!(states > 100 && moved > 100, "{cause:?}: {states} states, {moved} moves");
}

#[test]
fn no_history_moves_a_robot_against_a_cause_an_operators_stop_or_its_own_supervisor() {
    thread::scope(|threads| {
        for cause in CAUSES {
            threads.spawn(move || explore(cause));
        }
    });
}
