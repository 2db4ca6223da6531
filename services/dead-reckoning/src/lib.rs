//! Dead reckoning: encoder counts to pose, equations (20) and (21).
//!
//! | module | holds |
//! |---|---|
//! | [`step`] | the pure step: a `wheels` sample to a `pose` |
//! | [`covariance`] | the covariance of the pose's error |
//!
//! The state is saved after the pose is published, so that the tick does not wait for the file. A process that is killed in between
//! has published a pose that its saved state does not contain. That is safe: the counts are cumulative, and the link's last sample
//! stays on the bus, so the successor computes the same pose again from the state before. If the next tick has come by then, the
//! successor takes the way of both ticks as one arc, which differs by a millimetre or two. At the first tick, and when the robot
//! restarted its counts, the state before does not fit the counts, so the new state is saved first. If all processes are killed at
//! such a tick, a resumed run counts the tick again.

pub mod covariance;
pub mod step;

use std::path::Path;

use common::{
    bus::Topic,
    checkpoint::{Checkpoint, CheckpointError},
    clock::MissionTime,
    run,
    samples::{PoseSample, WheelSample},
    stage::{Answer, Answering},
    step::Step as _,
    topics::{POSE, WHEELS},
    wiring::Persists,
};

use step::{Reckoned, State};

pub use step::DeadReckoning;

/// Room for the encoded state, bytes: it is under 300.
const STATE_BYTES: usize = 512;

impl Answering for DeadReckoning {
    type In = WheelSample;
    type Out = PoseSample;
    const NAME: &'static str = "dead-reckoning";
    const INPUT: &'static Topic<WheelSample> = &WHEELS;
    const OUTPUT: &'static Topic<PoseSample> = &POSE;
    const PERSISTS: Persists = Persists::State(STATE_BYTES);

    fn answer(&mut self, wheels: &WheelSample, now: MissionTime) -> Answer<PoseSample> {
        let first = self.state().newest().is_none();
        let Reckoned { pose, rejected } = self.step(wheels, now);
        let warning = "the encoder counts restarted or jumped; the pose stays";
        Answer {
            sample: pose,
            saves_first: first || rejected,
            warning: rejected.then_some(warning),
        }
    }
}

/// The state that the process of the run in `directory` saved; none before its first tick.
pub fn saved_state(directory: &Path) -> Result<Option<State>, CheckpointError> {
    let file = run::checkpoint_file(directory, DeadReckoning::NAME);
    Ok(Checkpoint::open(&file, STATE_BYTES)?.1)
}
