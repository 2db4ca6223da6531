//! The odometer without its process: the same step, fed with what it took.

use common::{
    inputs,
    replay::{Beginning, Output, Replay, ReplayError, entry},
    samples::PoseSample,
    step::Step as _,
};
use serde::{Deserialize, Serialize};

use crate::rows::{DISTANCE, DistanceSample};
use crate::step::{Odometer, State};

/// What the step takes. A generation starts from the saved [`State`], if there was one.
#[derive(Debug, Serialize, Deserialize)]
pub struct Input {
    /// The pose of a tick.
    #[serde(with = "inputs::sample")]
    pub pose: PoseSample,
}

/// What is published of the sums.
pub(crate) fn sample(sums: State) -> DistanceSample {
    DistanceSample {
        driven_m: sums.driven_m,
        moving_s: sums.moving_s,
        ..DistanceSample::default()
    }
}

struct Generation {
    odometer: Odometer,
}

/// Begin the replay of a generation.
///
/// # Errors
/// Those of [`common::replay::Begin`].
pub fn begin(beginning: Beginning<'_>) -> Result<Box<dyn Replay>, ReplayError> {
    let mut odometer = Odometer::new(&beginning.run.mission);
    if let Some(state) = entry::<Option<State>>(beginning.start)? {
        // The process went on without a foreign one, too.
        let _ = odometer.restore(state);
    }
    Ok(Box::new(Generation { odometer }))
}

impl Replay for Generation {
    fn take(&mut self, body: &[u8]) -> Result<Vec<Output>, ReplayError> {
        let Input { pose } = entry(body)?;
        let (tick, time) = (pose.stamp.tick, pose.stamp.time());
        let sums = self.odometer.step(&pose, time);
        Ok(vec![Output::of(&DISTANCE, tick, time, sample(sums))])
    }

    fn describe(&self, body: &[u8]) -> Result<String, ReplayError> {
        Ok(format!("{:?}", entry::<Input>(body)?))
    }
}
