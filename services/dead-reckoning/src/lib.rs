//! Dead reckoning: encoder counts to pose, equations (20) and (21).
//!
//! | module | holds |
//! |---|---|
//! | [`step`] | the pure step: a `wheels` sample, and the fixes and turns that came with it, to a `pose` |
//! | `covariance` | how the covariance of the pose's error grows with the motion |
//! | `filter` | the estimate, and the ticks and fixes of the last 2 s |
//! | `tick` | the motion of one tick |
//! | `gyro` | the turn of a tick from a gyro's increments |
//! | `relocation` | whether fixes that contradict the pose agree among themselves |
//!
//! The state is saved after the pose is published, so that the tick does not wait for the file. A process killed in between has
//! published a pose that its saved state lacks. That is safe: counts are cumulative and the link's last sample stays on the bus, so the
//! successor computes the same pose from the state before. If the next tick has come, it takes both ticks' way as one arc, a millimetre
//! or two off. At the first tick, and when the robot restarted its counts, the older state does not fit the counts, so the new one is
//! saved first; if all processes are killed then, a resumed run counts the tick again.

mod covariance;
mod filter;
mod gyro;
mod relocation;
pub mod step;
mod tick;

use std::path::Path;

use common::{
    bus::{Layout, Payload, Reader, Stamped, Topic},
    checkpoint::{Checkpoint, CheckpointError},
    clock::MissionTime,
    run,
    samples::{FixRefusal, FixSample, PoseSample, TurnSample, WheelSample},
    shell::Context,
    stage::{Answer, Answering, Further},
    start::StageError,
    step::Step as _,
    topics::{FIX, IMU_TURN, POSE, SCAN_FIX, TURN, WHEELS},
    wiring::{Persists, Topics},
};
use serde::{Deserialize, Serialize};

use step::{Input, Reckoned, State};

pub use step::DeadReckoning;

/// Room for the encoded state, bytes: with 64 ticks and 64 fixes it is under 14,000.
const STATE_BYTES: usize = 16_384;
/// The most samples of a topic that are taken with a tick. Others are taken with the next one.
const MOST_FIXES: usize = 16;
const MOST_TURNS: usize = 128;

/// The samples of sources outside that came since the tick before.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Sources {
    pub fixes: Vec<FixSample>,
    pub turns: Vec<TurnSample>,
}

impl Further for Sources {
    const TOPICS: Topics = &[&FIX, &SCAN_FIX, &TURN, &IMU_TURN];
    type Readers = ([Reader<FixSample>; 2], [Reader<TurnSample>; 2]);

    fn open(context: &mut Context) -> Result<Self::Readers, StageError> {
        let fixes = [context.reader(&FIX)?, context.reader(&SCAN_FIX)?];
        Ok((fixes, [context.reader(&TURN)?, context.reader(&IMU_TURN)?]))
    }

    fn take((fixes, turns): &mut Self::Readers) -> Result<Self, StageError> {
        let [outside, scans] = fixes;
        let mut fixes = some(outside, MOST_FIXES)?;
        fixes.extend(some(scans, MOST_FIXES)?);
        let [outside, own] = turns;
        let (outside, own) = (some(outside, MOST_TURNS)?, some(own, MOST_TURNS)?);
        // The sequences of two gyros do not continue each other.
        Ok(Self { fixes, turns: if own.is_empty() { outside } else { own } })
    }
}

fn some<P>(reader: &mut Reader<P>, most: usize) -> Result<Vec<P>, StageError>
where
    P: Payload + Stamped + Layout,
{
    let mut taken = Vec::new();
    while taken.len() < most
        && let Some(sample) = reader.next_sample()?
    {
        taken.push(sample);
    }
    Ok(taken)
}

impl Answering for DeadReckoning {
    type In = WheelSample;
    type Out = PoseSample;
    type Further = Sources;
    const NAME: &'static str = "dead-reckoning";
    const INPUT: &'static Topic<WheelSample> = &WHEELS;
    const OUTPUT: &'static Topic<PoseSample> = &POSE;
    const PERSISTS: Persists = Persists::State(STATE_BYTES);

    fn answer(
        &mut self,
        wheels: &WheelSample,
        Sources { fixes, turns }: &Sources,
        now: MissionTime,
    ) -> Answer<PoseSample> {
        let first = self.state().newest().is_none();
        let Reckoned { pose, rejected, relocated, refused } =
            self.step(Input { wheels, fixes, turns }, now);
        let warning = match refused {
            _ if rejected => Some("the encoder counts restarted or jumped; the pose stays"),
            _ if relocated => Some("fixes that agree contradict the pose; the pose is theirs now"),
            refused => refused.map(FixRefusal::words),
        };
        Answer { sample: pose, saves_first: first || rejected || relocated, warning }
    }
}

/// The state that the process of the run in `directory` saved; none before its first tick.
pub fn saved_state(directory: &Path) -> Result<Option<State>, CheckpointError> {
    let file = run::checkpoint_file(directory, DeadReckoning::NAME);
    Ok(Checkpoint::open(&file, STATE_BYTES)?.1)
}
