//! What a run has around it: bus, processes, robot and the request to end. The system's are those of
//! a real run; a simulation has its own.

use std::{
    net::Ipv4Addr,
    os::fd::{AsFd as _, BorrowedFd},
    path::Path,
    rc::Rc,
};

use common::{
    address::Address, bus::Bus, domain::Domain, ground_truth::GroundTruthTick, mission::Mission,
    signals::Signals,
};
use processes::{
    domain::DomainLock,
    host::{Host, System},
};

use crate::{
    error::{Result, system},
    run::Consumer,
    simulator::{Simulator, SimulatorError},
    supervisor::Options,
};

pub trait SimulatedRobot {
    fn truth(&self) -> &[GroundTruthTick];

    /// Returns whether the robot still runs.
    fn poll(&mut self) -> Result<bool, SimulatorError>;

    /// Ends the robot, which comes to rest, and keeps the ground truth.
    fn stop(&mut self) -> Result<(), SimulatorError>;

    /// Returns what becomes readable at its end; none on a simulated machine. Ground truth is read
    /// at the end of a tick.
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        None
    }
}

pub struct Robot {
    pub simulator: Option<Box<dyn SimulatedRobot>>,
    pub address: Address,
}

impl Robot {
    pub(crate) fn truth(&self) -> &[GroundTruthTick] {
        self.simulator.as_ref().map_or(&[], |simulator| simulator.truth())
    }

    pub(crate) fn poll(&mut self) -> Result<bool> {
        Ok(self.simulator.as_mut().map_or(Ok(true), |simulator| simulator.poll())?)
    }

    /// `None` if it states none.
    pub fn at_address(mission: &Mission) -> Result<Option<Self>> {
        let Some(address) = &mission.robot.address else { return Ok(None) };
        let address = address.parse::<Address<String>>()?.resolve()?;
        Ok(Some(Self { simulator: None, address }))
    }
}

pub trait Surroundings {
    /// Returns the bus, with the services of all topics.
    fn bus(&self) -> Result<Rc<Bus>>;

    fn recreate_bus(&mut self) -> Result;

    fn host(&self, options: &Options) -> Box<dyn Host>;

    fn start_robot(&mut self, options: &Options) -> Result<Robot>;

    fn is_asked_to_end(&self) -> bool;

    /// Also answers the request.
    fn take_request_to_end(&mut self) -> bool;

    /// Returns what becomes readable when the run is asked to end.
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        None
    }

    /// Starts the consumer of all samples, after the bus and before the stages.
    fn attach_consumer(&mut self) {}

    /// Waits until the consumer has read all samples.
    fn let_catch_up(&mut self) {}

    /// Lets others find the run's directory, and programs start its stages if `external`.
    fn link_to_run(&mut self, _directory: &Path, _external: bool) -> Result {
        Ok(())
    }

    fn restore(&mut self) {}
}

pub(crate) struct Real<'a> {
    pub domain: Domain,
    pub lock: &'a mut DomainLock,
    pub signals: Signals,
    pub consumer: &'a mut dyn Consumer,
}

impl Surroundings for Real<'_> {
    fn bus(&self) -> Result<Rc<Bus>> {
        let not_open = || system("open the bus")(std::io::ErrorKind::NotConnected.into());
        self.lock.bus().ok_or_else(not_open)
    }

    fn recreate_bus(&mut self) -> Result {
        Ok(self.lock.recreate_bus()?)
    }

    fn host(&self, options: &Options) -> Box<dyn Host> {
        Box::new(System { directory: options.directory.clone() })
    }

    fn start_robot(&mut self, options: &Options) -> Result<Robot> {
        if let Some(robot) = Robot::at_address(&options.mission)? {
            return Ok(robot);
        }
        let started = Simulator::start(
            processes::process::firsthand(&[]),
            Some(&options.robot),
            &options.directory,
            &options.mission,
            options.pace,
            Some(self.signals.as_fd()),
        );
        if let Err(SimulatorError::GivenUp) = started {
            // The run ends before it contacts a robot.
            let nowhere = (Ipv4Addr::UNSPECIFIED, 0).into();
            return Ok(Robot { simulator: None, address: Address::Udp(nowhere) });
        }
        let simulator = started?;
        let address = Address::Udp(simulator.address());
        Ok(Robot { simulator: Some(Box::new(simulator)), address })
    }

    fn is_asked_to_end(&self) -> bool {
        self.signals.pending()
    }

    fn take_request_to_end(&mut self) -> bool {
        self.signals.came()
    }

    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        Some(self.signals.as_fd())
    }

    fn attach_consumer(&mut self) {
        self.consumer.attach(&self.signals);
    }

    fn let_catch_up(&mut self) {
        self.consumer.catch_up(&self.signals);
    }

    fn link_to_run(&mut self, directory: &Path, external: bool) -> Result {
        let link = if external { self.domain.run_link() } else { self.domain.run_directory() };
        Ok(self.lock.link_to_run(directory, link)?)
    }

    fn restore(&mut self) {
        self.lock.restore();
    }
}
