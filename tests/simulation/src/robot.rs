//! The simulated robot on a simulated machine, with its ground truth.

use common::{clock::Pace, ground_truth::GroundTruthTick, mission::Mission};
use x80_sim::{InMemory, SimError};

pub(crate) struct Robot {
    pub simulated: InMemory,
    pub truth: Vec<GroundTruthTick>,
}

impl Robot {
    pub(crate) fn start(mission: &Mission, pace: Pace) -> Result<Self, SimError> {
        let mut robot = Self { simulated: InMemory::start(mission, pace)?, truth: Vec::new() };
        robot.observe();
        Ok(robot)
    }

    pub(crate) fn observe(&mut self) {
        self.truth.extend(self.simulated.truth());
    }
}
