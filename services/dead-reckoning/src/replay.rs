//! Dead reckoning without its process: the same step, fed with what it took.

use common::{
    inputs,
    replay::{Beginning, Output, Replay, ReplayError, entry},
    samples::WheelSample,
    step::Step as _,
    topics,
};
use serde::{Deserialize, Serialize};

use crate::step::{DeadReckoning, State};

/// What the step takes. A generation starts from the saved [`State`], if there was one.
#[derive(Debug, Serialize, Deserialize)]
pub struct Input {
    /// The counts of a tick.
    #[serde(with = "inputs::sample")]
    pub wheels: WheelSample,
}

struct Generation {
    reckoning: DeadReckoning,
}

/// Begin the replay of a generation.
///
/// # Errors
/// Those of [`common::replay::Begin`].
pub fn begin(beginning: Beginning<'_>) -> Result<Box<dyn Replay>, ReplayError> {
    let mut reckoning = DeadReckoning::new(&beginning.run.mission);
    if let Some(state) = entry::<Option<State>>(beginning.start)? {
        // The process went on without a foreign one, too.
        let _ = reckoning.restore(state);
    }
    Ok(Box::new(Generation { reckoning }))
}

impl Replay for Generation {
    fn take(&mut self, body: &[u8]) -> Result<Vec<Output>, ReplayError> {
        let Input { wheels } = entry(body)?;
        let (tick, time) = (wheels.stamp.tick, wheels.stamp.time());
        let pose = self.reckoning.step(&wheels, time).pose;
        Ok(vec![Output::of(&topics::POSE, tick, time, pose)])
    }

    fn describe(&self, body: &[u8]) -> Result<String, ReplayError> {
        Ok(format!("{:?}", entry::<Input>(body)?))
    }
}
