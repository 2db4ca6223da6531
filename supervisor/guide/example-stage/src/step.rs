//! Poses to metres driven and seconds in motion.

use common::{
    clock::MissionTime,
    mission::Mission,
    samples::PoseSample,
    step::{ForeignState, Step},
};
use serde::{Deserialize, Serialize};

/// Slower than this the robot stands, m/s: encoder noise.
const STANDS_M_S: f64 = 0.005;

/// What must survive the process: a sum cannot be recomputed from the next pose.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Tick, mission time and position of the newest pose; none before the first.
    last: Option<(u64, MissionTime, [f64; 2])>,
    /// Metres driven so far.
    pub driven_m: f64,
    /// Seconds of mission time in motion so far.
    pub moving_s: f64,
}

/// The odometer: its state is all it has.
#[derive(Clone, Debug)]
pub struct Odometer {
    state: State,
}

impl Step for Odometer {
    type Input<'a> = &'a PoseSample;
    /// The sums with this pose.
    type Output = State;
    type State = State;

    fn new(_: &Mission) -> Self {
        Self {
            state: State::default(),
        }
    }

    fn state(&self) -> &State {
        &self.state
    }

    fn restore(&mut self, state: State) -> Result<(), ForeignState> {
        self.state = state;
        Ok(())
    }

    /// Add the way from the last pose. A tick given twice adds nothing the second time.
    fn step(&mut self, pose: &PoseSample, now: MissionTime) -> State {
        let here = [pose.x_m, pose.y_m];
        if let Some((tick, time, there)) = self.state.last {
            if tick == pose.stamp.tick {
                return self.state;
            }
            let way_m = (here[0] - there[0]).hypot(here[1] - there[1]);
            let elapsed_s = now.since(time).as_secs_f64();
            self.state.driven_m += way_m;
            if way_m > STANDS_M_S * elapsed_s {
                self.state.moving_s += elapsed_s;
            }
        }
        self.state.last = Some((pose.stamp.tick, now, here));
        self.state
    }
}

#[cfg(test)]
mod tests;
