//! What holds after every event, whatever was disturbed.

use std::{rc::Rc, time::Duration};

use common::{
    bus::{Bus, BusError, Memory, Reader},
    grid::Replica,
    json_wire,
    mission::{Mission, Protocol},
    samples::{
        Cause, CommandSample, DeathSample, DirectiveSample, GridHeader, LinkSample, Order,
        PoseSample, RosterEntry, RosterHeader, name_str,
    },
    topics,
    wire::{Command, Decoder, Quantity, Targets},
};
use mission_control::{Finished, outcome::Outcome, target_list::TargetOutcome};
use thiserror::Error;

use crate::{
    disturbance::{Request, What},
    machine::{LINK, SimulatedMachine},
    robot_fault::RobotFault,
    wire::{Quality, Way},
};

/// Longest pause between two orders to a robot that moves: a hung link is found, and a successor
/// starts.
const TOLD_EVERY: Duration = Duration::from_secs(4);
/// Speed of a robot that moves, m/s.
const MOVES_M_S: f64 = 0.05;
/// Time to come to rest after the last motion command, on a wire that loses nothing.
const RESTS_WITHIN: Duration = Duration::from_secs(3);
/// Pose error beyond four standard deviations, metres.
const POSE_SLACK_M: f64 = 0.3;

#[derive(Clone, Debug, Error)]
#[error("invariant '{invariant}' broken at event {event}, {:.6} s: {detail}", at.as_secs_f64())]
pub struct Broken {
    pub invariant: &'static str,
    pub detail: String,
    pub event: u64,
    pub at: Duration,
}

/// Readers of one supervisor's bus.
struct Observed {
    directive: Reader<DirectiveSample>,
    link: Reader<LinkSample>,
    pose: Reader<PoseSample>,
    command: Reader<CommandSample>,
    deaths: Reader<DeathSample>,
    /// The supervisor states its roster again for a new reader, so a viewer of the roster, such as a
    /// recorder, would change the run. There is always one.
    _roster: Reader<RosterHeader, RosterEntry>,
    /// Two readers of the map: one from the start, one that joins again and again.
    grids: [(Reader<GridHeader, u8>, Replica<u8>); 2],
    bus: Bus,
}

impl Observed {
    fn open(memory: &Rc<Memory>) -> Result<Self, BusError> {
        let bus = Bus::in_memory(Rc::clone(memory), None);
        let grid = || Ok((bus.reader(&topics::GRID)?, Replica::default()));
        Ok(Self {
            directive: bus.reader(&topics::DIRECTIVE)?,
            link: bus.reader(&topics::LINK)?,
            pose: bus.reader(&topics::POSE)?,
            command: bus.reader(&topics::COMMAND)?,
            deaths: bus.reader(&topics::DEATHS)?,
            _roster: bus.reader(&topics::ROSTER)?,
            grids: [grid()?, grid()?],
            bus,
        })
    }
}

#[derive(Default)]
pub struct Invariants {
    protocol: Protocol,
    in_ticks: bool,
    observed: Option<Observed>,
    decoder: Decoder,
    /// Newest order of the supervisor that lives.
    order: Option<Order>,
    /// Why the link stops the robot, or that it does not, and since when.
    pub causes: Vec<(Duration, Option<Cause>)>,
    /// Whether the newest motion command of this event moves.
    sent: Option<bool>,
    told: Option<Duration>,
    pub moved: Option<Duration>,
    /// First order to stand after the last one to move.
    stood: Option<Duration>,
    /// Whether the wire to the robot keeps what it carries, whether the robot obeys, and when either
    /// last changed.
    wire_is_calm: bool,
    obeys: bool,
    obedience_changed: Duration,
    /// Whether a fault or a touch has made the robot's reports untrue.
    has_lied: bool,
    /// Whether the robot had a fault or touched something, or its wire lost or delayed something.
    was_faulty: bool,
    /// Stages that were disturbed, and when.
    disturbed: Vec<(&'static str, Duration)>,
    command: u64,
    /// Newest compared version of the map.
    compared: u64,
    joins: u64,
}

pub type Checked = Result<(), (&'static str, String)>;

fn holds(holds: bool, invariant: &'static str, detail: impl FnOnce() -> String) -> Checked {
    if holds { Ok(()) } else { Err((invariant, detail())) }
}

impl Invariants {
    pub fn new(protocol: Protocol, in_ticks: bool) -> Self {
        Self { protocol, in_ticks, wire_is_calm: true, obeys: true, ..Self::default() }
    }

    pub fn on_bus(&mut self, memory: &Rc<Memory>) {
        self.observed = Observed::open(memory).ok();
        (self.order, self.compared) = (None, 0);
    }

    pub fn on_disturbance(&mut self, what: &What, now: Duration) {
        use What::*;
        self.was_faulty |= matches!(what, Wire(..) | Fault(Some(_)));
        match what {
            Kill(stage)
            | KillAfter(stage, _)
            | Freeze(stage)
            | Thaw(stage)
            | Hang(stage)
            | Break(stage, _)
            | Ask(Request::Restart(stage)) => self.disturbed.push((stage, now)),
            Wire(Way::ToRobot, quality) => {
                self.wire_is_calm = *quality == Quality::default();
                self.obedience_changed = now;
            }
            Fault(fault) => {
                self.obeys = !fault.is_some_and(RobotFault::keeps_speed);
                self.obedience_changed = now;
                self.has_lied |= fault.is_some_and(RobotFault::lies);
            }
            KillSupervisor(_) | Wire(..) | Ask(_) | Beacon(_) | End => {}
        }
    }

    /// Notes what the link or its guard sends.
    pub fn on_sent(&mut self, bytes: &[u8], now: Duration) {
        let Some(moves) = self.moves(bytes) else { return };
        (self.sent, self.told) = (Some(moves), Some(now));
        if moves {
            (self.moved, self.stood) = (Some(now), None);
        } else {
            self.stood.get_or_insert(now);
        }
    }

    /// Returns whether a message makes the wheels turn; `None` for messages about other things.
    fn moves(&mut self, bytes: &[u8]) -> Option<bool> {
        match self.protocol {
            Protocol::X80 => {
                self.decoder.push(bytes);
                let mut moves = None;
                while let Some(frame) = self.decoder.next_frame() {
                    match Command::parse(&frame) {
                        Ok(Command::Motion(motion)) if motion.quantity == Quantity::Velocity => {
                            let Targets::All(speeds) = motion.targets else { continue };
                            moves = Some(speeds.iter().flatten().any(|speed| *speed != 0));
                        }
                        Ok(Command::Motion(_) | Command::Enable { on: false, .. }) => {
                            moves = Some(false);
                        }
                        _ => {}
                    }
                }
                moves
            }
            Protocol::Json => {
                let text = std::str::from_utf8(bytes).ok()?;
                let orders = text.lines().filter_map(|line| json_wire::parse(line.as_bytes()).ok());
                orders.fold(None, |moves, order| match order {
                    json_wire::Order::Drive { wheels, .. } => Some(wheels != [0.0; 2]),
                    _ => moves,
                })
            }
            Protocol::Arduino => {
                let text = std::str::from_utf8(bytes).ok()?;
                let mut speeds = text.split('\r').filter_map(|line| line.strip_prefix("m "));
                speeds.next_back().map(|speeds| speeds != "0 0")
            }
            Protocol::Ros2 => None,
        }
    }

    /// Checks every invariant after an event.
    pub fn check(&mut self, machine: &SimulatedMachine) -> Checked {
        let now = machine.now();
        let sent = self.sent.take();
        // The supervisor gives orders between events, so the link may have read the newest one.
        let drives = |order: Option<Order>| order.is_none_or(|order| order == Order::Drive);
        let before = self.order;
        self.read(machine, now)?;
        let may_move = drives(before) || drives(self.order);
        if self.in_ticks {
            return Ok(());
        }
        if sent == Some(true) {
            let drives = self.causes.last().is_some_and(|(_, cause)| cause.is_none());
            // A link that was killed in this turn sent, but did not publish why.
            holds(drives || !machine.link_is_open(), "zero command while held", || {
                "the link sends a motion command although its cause says stop".to_owned()
            })?;
            holds(may_move, "no command after the order to stop", || {
                format!("the link sends a motion command at the order {:?}", self.order)
            })?;
        }
        let Some(truth) = machine.truth() else { return Ok(()) };
        let moves = truth.v.abs() > MOVES_M_S;
        let age = |then: Duration| now.saturating_sub(then);
        if moves {
            let is_told = self.told.is_some_and(|told| age(told) < TOLD_EVERY);
            holds(is_told, "a robot that moves is told", || {
                format!("it moves at {:.2} m/s and hears nothing since {:?}", truth.v, self.told)
            })?;
            let obeys = self.wire_is_calm && self.obeys;
            let obeys = obeys && age(self.obedience_changed) > 2 * RESTS_WITHIN;
            let must_stand = self.stood.is_some_and(|stood| age(stood) > RESTS_WITHIN);
            holds(!(obeys && must_stand), "a robot that is told to stand stands", || {
                format!("it moves at {:.2} m/s, told to stand at {:?}", truth.v, self.stood)
            })?;
        }
        Ok(())
    }

    fn read(&mut self, machine: &SimulatedMachine, now: Duration) -> Checked {
        let unread = |error: BusError| ("the bus can be read", error.to_string());
        let Some(observed) = &mut self.observed else { return Ok(()) };
        while let Some(directive) = observed.directive.next_sample().map_err(unread)? {
            self.order = Some(directive.order());
        }
        while let Some(link) = observed.link.next_sample().map_err(unread)? {
            let is_told = link.connected == 1 || link.attempts < 2 || link.lost_ns > 0;
            holds(is_told, "the link says for how long it misses the robot", || {
                format!("{link:?}")
            })?;
            let cause = link.stopped().then(|| link.cause());
            let blames =
                matches!(cause, Some(Cause::RangeImplausible | Cause::OdometryImplausible));
            holds(!blames || self.was_faulty, "a healthy robot is not blamed", || {
                format!("{cause:?}")
            })?;
            if self.causes.last().is_none_or(|(_, before)| *before != cause) {
                self.causes.push((now, cause));
            }
        }
        while let Some(pose) = observed.pose.next_sample().map_err(unread)? {
            // Frames may be late, so the counts find the truth of a pose.
            let truth = machine.truth_of(&pose);
            // What touches the robot pushes it past its wheels.
            self.has_lied |= truth.is_some_and(|truth| truth.contacts > 0);
            self.was_faulty |= self.has_lied;
            let off_m = truth.map_or(0.0, |truth| truth.pose_error_m(&pose));
            let most_m = pose_bound_m(&pose);
            holds(self.has_lied || off_m <= most_m, "a pose is where the robot was", || {
                format!("{off_m:.2} m off, at most {most_m:.2} m, at tick {}", pose.stamp.tick)
            })?;
        }
        while let Some(command) = observed.command.next_sample().map_err(unread)? {
            let tick = command.stamp.tick;
            // A successor of the link continues from the newest tick that the supervisor has read.
            let continues = tick + 1 >= self.command || is_recent(&self.disturbed, LINK, now);
            holds(continues, "ticks do not go back", || {
                format!("tick {tick} is commanded after tick {}", self.command)
            })?;
            self.command = self.command.max(tick);
        }
        for (reader, replica) in &mut observed.grids {
            while let Some(grid) = reader.next_slice().map_err(unread)? {
                replica.apply(&grid.header().part, &grid);
            }
        }
        let [(_, whole), (_, joined)] = &observed.grids;
        let version = whole.version();
        if version == joined.version() && version != self.compared {
            self.compared = version;
            holds(whole.cells() == joined.cells(), "replicas of one version are equal", || {
                format!("two readers of the map differ at version {}", whole.version())
            })?;
            self.joins += 1;
            // The late reader joins again and begins with the next keyframe.
            if self.joins.is_multiple_of(64) {
                let reader = observed.bus.reader(&topics::GRID).map_err(unread)?;
                observed.grids[1] = (reader, Replica::default());
            }
        }
        while let Some(death) = observed.deaths.next_sample().map_err(unread)? {
            let stage = name_str(&death.stage);
            holds(
                death.hung == 0 || is_recent(&self.disturbed, stage, now),
                "no stage is ended without cause",
                || format!("{stage} was ended as hung"),
            )?;
        }
        Ok(())
    }

    /// Checks how a run ended.
    pub fn check_end(
        &self,
        machine: &SimulatedMachine,
        mission: &Mission,
        finished: &Finished,
    ) -> Checked {
        let targets = &finished.targets;
        let numbers: Vec<_> = targets.iter().map(|target| target.number).collect();
        let differ = numbers.is_sorted_by(|one, next| one != next);
        holds(differ, "every target has one result", || format!("{numbers:?}"))?;
        let (Outcome::Reached, Some(truth)) = (finished.ending.outcome, machine.truth()) else {
            return Ok(());
        };
        // A hand's target has no result.
        let last = targets.last().filter(|last| last.outcome != TargetOutcome::Replaced);
        let target = match last {
            Some(last) => [last.x_m, last.y_m],
            None if targets.is_empty() => mission.target.into(),
            None => return Ok(()),
        };
        let off_m = (truth.x - target[0]).hypot(truth.y - target[1]);
        let pose = finished.record.pose.unwrap_or_default();
        let most_m = mission.arrival_tolerance_m + pose_bound_m(&pose);
        holds(self.has_lied || off_m <= most_m, "reached is true", || {
            format!("{off_m:.2} m from the target, {most_m:.2} m at most")
        })
    }
}

/// Returns whether a stage was disturbed in the last 20 s.
fn is_recent(disturbed: &[(&'static str, Duration)], stage: &str, now: Duration) -> bool {
    let mut of_stage = disturbed.iter().filter(|(disturbed, _)| *disturbed == stage);
    of_stage.any(|(_, at)| now.saturating_sub(*at) < Duration::from_secs(20))
}

/// Returns the greatest error of a pose that knows how wrong it may be, metres.
fn pose_bound_m(pose: &PoseSample) -> f64 {
    4.0 * pose.position_rms_m() + POSE_SLACK_M
}
