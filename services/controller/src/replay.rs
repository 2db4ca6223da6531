//! The controller without its process: the same step, fed with what it took.

use common::{
    inputs,
    replay::{Beginning, Output, Replay, ReplayError, entry},
    samples::GuidanceSample,
    step::Step as _,
    topics,
};
use serde::{Deserialize, Serialize};

use crate::step::Controller;

/// What the step takes.
#[derive(Debug, Serialize, Deserialize)]
pub struct Input {
    /// The newest guidance.
    #[serde(with = "inputs::sample")]
    pub guidance: GuidanceSample,
}

struct Generation {
    controller: Controller,
}

/// Begin the replay of a generation.
///
/// # Errors
/// Those of [`common::replay::Begin`].
pub fn begin(beginning: Beginning<'_>) -> Result<Box<dyn Replay>, ReplayError> {
    Ok(Box::new(Generation {
        controller: Controller::new(&beginning.run.mission),
    }))
}

impl Replay for Generation {
    fn take(&mut self, body: &[u8]) -> Result<Vec<Output>, ReplayError> {
        let Input { guidance } = entry(body)?;
        let (tick, time) = (guidance.stamp.tick, guidance.stamp.time());
        let command = self.controller.step(&guidance, time);
        Ok(vec![Output::of(&topics::COMMAND, tick, time, command)])
    }

    fn describe(&self, body: &[u8]) -> Result<String, ReplayError> {
        Ok(format!("{:?}", entry::<Input>(body)?))
    }
}
