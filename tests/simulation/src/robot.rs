//! The simulated robot on a simulated machine, with its ground truth.

use std::net::{Ipv4Addr, SocketAddr};

use common::{clock::Pace, ground_truth::GroundTruthTick, mission::Mission};
use x80_sim::{InMemory, SimError};

use crate::wire::Port;

pub(crate) struct Robot {
    robot: InMemory,
    pub truth: Vec<GroundTruthTick>,
}

impl Robot {
    pub(crate) fn start(mission: &Mission, pace: Pace) -> Result<Self, SimError> {
        let mut robot = Self { robot: InMemory::start(mission, pace)?, truth: Vec::new() };
        robot.observe();
        Ok(robot)
    }

    pub(crate) fn observe(&mut self) {
        self.truth.extend(self.robot.truth());
    }

    pub(crate) fn hear(&mut self, from: Port, bytes: &[u8]) -> Result<(), SimError> {
        self.robot.hear(SocketAddr::from((Ipv4Addr::LOCALHOST, from)), bytes)
    }

    pub(crate) fn pass(&mut self) -> Result<(), SimError> {
        self.robot.pass()
    }

    pub(crate) fn next_ns(&self) -> Option<u64> {
        self.robot.next_due_ns()
    }

    pub(crate) fn sent(&mut self) -> Vec<(Port, Vec<u8>)> {
        self.robot.sent().map(|(to, bytes)| (to.port(), bytes)).collect()
    }
}
