//! Dead reckoning: encoder counts to pose, equations (20) and (21).
//!
//! | module | holds |
//! |---|---|
//! | [`step`] | the whole of it, pure: one `wheels` sample to one `pose` |
//! | [`covariance`] | how far the pose may be off |
//!
//! The state is saved after the pose is published: the tick does not wait for the file. A process killed between the two has
//! published a pose that its state does not hold. That is safe: the counts are cumulative and the link's last sample stays on
//! the bus, so the successor computes the same pose again from the state before, or, where the next tick has come, the way of
//! both ticks as one arc, a millimetre or two off. Where the counts begin, at the first tick or when the robot began them anew,
//! the state before says nothing of them: there it is saved first. A run that is resumed after all its processes were killed
//! just there counts that tick again.

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
