//! The whole robot in one process, from one seed.
//!
//! The five stages, the supervisor, the stop guard and the simulated robot run as they do in their
//! processes, on a simulated [machine](common::machine) in one thread, without sockets, files,
//! shared memory or clock. Bytes on the wire, samples and checkpoints are the real ones.
//!
//! A seed draws how late each process runs, what the wire loses, doubles, reorders and delays, which
//! process is killed, frozen or hangs, what operators ask, and how the robot is faulty. After every
//! event the [invariants](invariant) are checked. The same seed of the same program gives the same
//! events, so a failure is a seed.
//!
//! # Limits
//! A turn of a process is one event: a process does not run beside another. The operator's stop
//! without middleware, systemd, signals to the supervisor and the middleware itself need real
//! processes.

#![allow(unreachable_pub)]

mod disturbance;
mod draw;
mod fault_injector;
mod guard;
mod invariant;
mod load;
mod machine;
mod process;
mod random;
mod robot_fault;
mod surroundings;
mod wire;

use std::{cell::RefCell, path::PathBuf, rc::Rc, time::Duration};

use common::{
    bus::Bus, clock::Pace, domain::RobotName, ground_truth::GroundTruthTick, mission::Mission,
    samples::Cause,
};
use mission_control::{Finished, Heard, Options, recovery::RecoveredRun};
use processes::Starter;
use summary::{Hearer, Summary};
use x80_sim::InMemory;

pub use self::{
    disturbance::{Disturbance, Request, What},
    fault_injector::lie::Lie,
    invariant::Broken,
    load::Load,
    random::Random,
    robot_fault::{Promise, RobotFault},
    wire::{Quality, Way},
};
use self::{machine::SimulatedMachine, surroundings::Simulated};

/// Longest run, beyond the timeouts of its targets.
const LATE: Duration = Duration::from_secs(120);
/// Time that is watched after a run.
const AFTERWARDS: Duration = Duration::from_secs(6);
/// Address of a robot that outlives its supervisor.
const ADDRESS: &str = "192.0.2.1:10001";

/// A run to simulate.
#[derive(Clone, Debug)]
pub struct Scenario {
    pub seed: u64,
    pub mission: Mission,
    pub pace: Pace,
    pub load: Load,
    pub disturbances: Vec<Disturbance>,
    /// Given one by one whenever a robot that stays waits for a target. Then the run is asked to
    /// end.
    pub while_waiting: Vec<Request>,
}

impl Scenario {
    pub fn robot() -> RobotName {
        RobotName::default()
    }

    /// Returns the directory of the run, which exists only on the simulated machine.
    pub fn directory() -> PathBuf {
        PathBuf::from("/simulation/run")
    }

    /// Returns the undisturbed run of a simulated robot in lockstep, as `firsthand run` drives it.
    pub fn lockstep(mission: &Mission) -> Self {
        Self {
            seed: mission.seed,
            mission: mission.clone(),
            pace: Pace::Max,
            load: Load::NONE,
            disturbances: Vec::new(),
            while_waiting: Vec::new(),
        }
    }

    /// Returns the undisturbed run in wall-clock time of a robot that outlives its supervisor, on
    /// an idle machine.
    pub fn calm(mission: &Mission) -> Self {
        let mut mission = mission.clone();
        mission.robot.address = Some(ADDRESS.to_owned());
        Self { pace: Pace::Rate(1.0), load: Load::IDLE, ..Self::lockstep(&mission) }
    }

    /// Draws the robot, the load and the disturbances of such a run.
    pub fn draw(mission: &Mission, seed: u64) -> Self {
        let mut drawn = Self::calm(mission);
        let mut random = Random::new(seed, 3);
        (drawn.seed, drawn.mission.seed) = (seed, seed);
        draw::robot(&mut random, &mut drawn.mission);
        drawn.load = draw::load(&mut random);
        drawn.disturbances = draw::disturbances(&mut random, &drawn.mission);
        drawn.while_waiting = draw::while_waiting(&mut random, &drawn.mission);
        drawn
    }

    /// Runs the scenario.
    pub fn run(&self) -> Ran {
        self.run_before(None)
    }

    /// Runs the scenario before an observer, which its owner reads after the run.
    pub fn run_before(&self, observer: Option<Rc<RefCell<dyn Observer>>>) -> Ran {
        let heard = Rc::<RefCell<Hearer>>::default();
        let machine = SimulatedMachine::new(self, observer);
        let finished = common::machine::simulate(Rc::<SimulatedMachine>::clone(&machine), || {
            self.conduct(&machine, &heard)
        });
        let summarize = |finished| Summary::new(&self.mission, finished, &heard.borrow());
        let summary = finished.as_ref().map(summarize);
        machine.take_ran(finished, summary)
    }

    /// Returns the mission with what the disturbances do to the robot itself.
    fn shoved(&self) -> Mission {
        let mut random = Random::new(self.seed, 5);
        let mut mission = self.mission.clone();
        let faults = self.disturbances.iter().filter_map(|it| match it.what {
            What::Fault(fault) => Some((it.at.as_secs_f64(), fault)),
            _ => None,
        });
        let mut faults: Vec<_> = faults.collect();
        faults.sort_by(|one, other| one.0.total_cmp(&other.0));
        for (nth, &(at_s, fault)) in faults.iter().enumerate() {
            let until_s = faults.get(nth + 1).map(|(next_s, _)| *next_s);
            let shove = fault.and_then(|fault| fault.shove(at_s, until_s, &mut random));
            mission.simulation.shoves.extend(shove);
        }
        mission
    }

    /// Conducts the run to its end, with a new supervisor for each that is killed.
    fn conduct(
        &self,
        machine: &Rc<SimulatedMachine>,
        heard: &Rc<RefCell<Hearer>>,
    ) -> Option<Finished> {
        let robot = InMemory::start(&self.shoved(), self.pace);
        machine.place(machine.or_break_off("the robot starts", robot)?);
        // Each target has its own timeout.
        let is_target =
            |it: &&Disturbance| matches!(it.what, What::Ask(Request::Goto(_) | Request::Append(_)));
        let asked = self.disturbances.iter().filter(is_target).count() + self.while_waiting.len();
        let targets = self.mission.targets.len().max(1) + asked;
        machine.end_after(Duration::from_secs_f64(self.mission.timeout_s * targets as f64) + LATE);
        let directory = Self::directory();
        let mut random = Random::new(self.seed, 4);
        let mut recovered = None;
        loop {
            let mut surroundings = Simulated::new(machine, &self.while_waiting);
            let hearer = Rc::clone(heard);
            let hear = move |heard: Heard<'_>| hearer.borrow_mut().hear(&heard);
            let options = Options {
                mission: self.mission.clone(),
                robot: Self::robot(),
                pace: self.pace,
                directory: directory.clone(),
                starter: Starter::Supervisor,
                recovered,
                stands: false,
                place: None,
            };
            let conducted = mission_control::simulate(&options, &mut surroundings, Box::new(hear));
            if machine.is_over() {
                return None;
            }
            if machine.supervisor_is_killed() {
                machine.pass(draw::a_while(&mut random, 0.1));
                let run = RecoveredRun::load(&directory);
                recovered = Some(machine.or_break_off("a killed run can be resumed", run)?);
                continue;
            }
            let finished = machine.or_break_off("a run ends with its result", conducted)?;
            machine.check_end(&self.mission, &finished);
            // Whatever has ended, the robot comes to rest.
            machine.pass(AFTERWARDS);
            return Some(finished);
        }
    }

    /// Removes disturbances as long as the same invariant breaks.
    pub fn shrink(&self, broken: &Broken) -> Self {
        let mut least = self.clone();
        let mut at = 0;
        while at < least.disturbances.len() {
            let mut fewer = least.clone();
            fewer.disturbances.remove(at);
            let breaks = fewer.run().broken;
            if breaks.is_some_and(|now| now.invariant == broken.invariant) {
                least = fewer;
            } else {
                at += 1;
            }
        }
        least
    }
}

/// Sees everything that is published, without a part in it.
pub trait Observer {
    /// Is given each new bus, before anything is published on it.
    fn on_bus(&mut self, _bus: &Bus) {}

    /// Is called after each event.
    fn observe(&mut self) {}

    /// Runs a turn of a stage that has opened its topics.
    fn turn(&mut self, _stage: &str, turn: &mut dyn FnMut()) {
        turn();
    }
}

/// What came of a run.
pub struct Ran {
    /// `None` if an invariant broke or the scenario ended.
    pub finished: Option<Finished>,
    pub summary: Option<Summary>,
    pub broken: Option<Broken>,
    pub events: u64,
    pub simulated: Duration,
    /// Number of supervisors, one more than were killed.
    pub supervisors: u32,
    pub truth: Vec<GroundTruthTick>,
    /// Time of the last command that moves the robot.
    pub moved: Option<Duration>,
    /// Why the link stops the robot, or that it does not, and since when.
    pub causes: Vec<(Duration, Option<Cause>)>,
}

impl Ran {
    /// Returns a broken invariant that shows after the run.
    pub fn broken_at_end(&self, invariant: &'static str, detail: String) -> Broken {
        Broken { invariant, detail, event: self.events, at: self.simulated }
    }
}

#[cfg(test)]
mod tests {
    use std::{any::Any, time::UNIX_EPOCH};

    use common::topics;

    use super::*;

    fn mission() -> Mission {
        let text =
            "target = [3, 0]\ntimeout_s = 120\nworld.drum = [{at = [1.5, 0.1], radius_m = 0.2}]";
        Mission::parse(text, "simulation.toml").unwrap()
    }

    #[derive(Default)]
    struct Viewer(Vec<Box<dyn Any>>);

    impl Observer for Viewer {
        fn on_bus(&mut self, bus: &Bus) {
            let roster = bus.reader(&topics::ROSTER).unwrap();
            let map = bus.reader(&topics::GRID).unwrap();
            self.0.push(Box::new((roster, map, bus.reader(&topics::FIELD).unwrap())));
        }
    }

    #[test]
    fn a_seed_gives_the_same_events_watched_or_not_and_another_others() {
        let run = |seed, observer: Option<Rc<RefCell<dyn Observer>>>| {
            let ran = Scenario::draw(&mission(), seed).run_before(observer);
            assert!(ran.broken.is_none(), "seed {seed}: {:?}", ran.broken);
            (ran.events, ran.truth)
        };
        let [first, second, _] = [7, 8, 9].map(|seed| {
            let watched = run(seed, Some(Rc::<RefCell<Viewer>>::default()));
            assert_eq!(watched, run(seed, None), "{seed}");
            watched
        });
        assert_ne!(first, second);
    }

    /// `firsthand-lab simulate --seed S` repeats a failure, with this mission as a file.
    #[test]
    fn new_seeds_break_no_invariant() {
        let first = UNIX_EPOCH.elapsed().unwrap().as_nanos() as u64;
        for seed in first..first + 40 {
            let broken = Scenario::draw(&mission(), seed).run().broken;
            assert!(broken.is_none(), "simulation: seed {seed}: {}", broken.unwrap());
        }
    }
}
