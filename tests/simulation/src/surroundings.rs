//! Surroundings of a supervisor on a simulated machine.

use std::{
    collections::VecDeque,
    io,
    net::{Ipv4Addr, SocketAddr},
    path::Path,
    rc::Rc,
    time::Duration,
};

use common::{
    address::Address,
    bus::{Bus, Reader},
    ground_truth::GroundTruthTick,
    run::Run,
    samples::{DirectiveSample, HoldReason},
    start::Generation,
    topics,
};
use mission_control::{
    Options, SupervisorError,
    simulator::SimulatorError,
    surroundings::{Robot, SimulatedRobot, Surroundings},
};
use processes::{
    activity::{Activity, Times},
    host::{Host, Watched},
    process::ExitCause,
};
use rustix::process::Signal;

use crate::{disturbance::Request, machine::SimulatedMachine};

pub struct Simulated {
    machine: Rc<SimulatedMachine>,
    bus: Rc<Bus>,
    /// Of an operator at a robot that waits for a target.
    requests: VecDeque<Request>,
    directive: Option<Reader<DirectiveSample>>,
}

impl Simulated {
    pub fn new(machine: &Rc<SimulatedMachine>, while_waiting: &[Request]) -> Self {
        Self {
            machine: Rc::clone(machine),
            bus: Rc::new(machine.start_supervisor()),
            requests: while_waiting.iter().copied().collect(),
            directive: None,
        }
    }

    /// Returns whether the newest directive says that the robot waits for a target.
    fn waits(&mut self) -> bool {
        let Self { machine, directive, .. } = self;
        let newest = machine.as_operator(|bus| {
            if directive.is_none() {
                *directive = bus.reader(&topics::DIRECTIVE).ok();
            }
            directive.as_mut()?.newest().ok()?
        });
        newest.is_some_and(|directive| directive.reason() == HoldReason::Waiting)
    }
}

impl Surroundings for Simulated {
    fn bus(&self) -> Result<Rc<Bus>, SupervisorError> {
        Ok(Rc::clone(&self.bus))
    }

    fn recreate_bus(&mut self) -> Result<(), SupervisorError> {
        self.bus = Rc::new(self.machine.new_bus());
        self.directive = None;
        Ok(())
    }

    fn host(&self, _: &Options) -> Box<dyn Host> {
        Box::new(SimulatedHost(Rc::clone(&self.machine)))
    }

    fn start_robot(&mut self, options: &Options) -> Result<Robot, SupervisorError> {
        if let Some(robot) = Robot::at_address(&options.mission)? {
            return Ok(robot);
        }
        let address = SocketAddr::from((Ipv4Addr::LOCALHOST, 1));
        let robot = Truth { machine: Rc::clone(&self.machine), ticks: Vec::new() };
        Ok(Robot { simulator: Some(Box::new(robot)), address: Address::Udp(address) })
    }

    fn is_asked_to_end(&self) -> bool {
        false
    }

    fn take_request_to_end(&mut self) -> bool {
        // The supervisor answers a request in its next turn, with another directive.
        if !self.waits() {
            return false;
        }
        let request = self.requests.pop_front();
        request.is_none_or(|request| {
            self.machine.ask(request);
            false
        })
    }
}

/// The robot as its supervisor sees it.
struct Truth {
    machine: Rc<SimulatedMachine>,
    ticks: Vec<GroundTruthTick>,
}

impl SimulatedRobot for Truth {
    fn truth(&self) -> &[GroundTruthTick] {
        &self.ticks
    }

    fn poll(&mut self) -> Result<bool, SimulatorError> {
        self.machine.add_truth(&mut self.ticks);
        Ok(true)
    }

    fn stop(&mut self) -> Result<(), SimulatorError> {
        self.poll().map(drop)
    }
}

struct SimulatedHost(Rc<SimulatedMachine>);

impl Host for SimulatedHost {
    fn start(&mut self, _: Option<&Path>, generation: &Generation) -> io::Result<Box<dyn Watched>> {
        let run = Run::load(&generation.directory).map_err(io::Error::other)?;
        let number = self.0.start(generation, run);
        Ok(Box::new(SimulatedProcess { machine: Rc::clone(&self.0), number }))
    }

    fn adopt(&mut self, _: u32, _: &str) -> io::Result<Box<dyn Watched>> {
        Err(io::ErrorKind::NotFound.into())
    }
}

struct SimulatedProcess {
    machine: Rc<SimulatedMachine>,
    number: u32,
}

impl Watched for SimulatedProcess {
    fn id(&self) -> u32 {
        self.number
    }

    fn signal(&self, signal: Signal) {
        self.machine.signal(self.number, signal);
    }

    fn try_reap(&mut self) -> io::Result<Option<ExitCause>> {
        Ok(self.machine.reap(self.number))
    }

    fn end(&mut self, _: Duration) {
        self.machine.signal(self.number, Signal::KILL);
    }

    fn times(&self) -> Option<Times> {
        let Activity { ran, starved, .. } = self.machine.activity(self.number)?;
        Some(Times { ran, starved })
    }

    fn activity(&self, then: Times) -> Option<Activity> {
        let now = self.machine.activity(self.number)?;
        Some(Activity {
            ran: now.ran.saturating_sub(then.ran),
            starved: now.starved.saturating_sub(then.starved),
            ..now
        })
    }
}
