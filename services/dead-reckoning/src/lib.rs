//! Dead reckoning: encoder counts to pose, equations (20) and (21).
//!
//! | module | holds |
//! |---|---|
//! | [`step`] | the pure step: a `wheels` sample, and the fixes and turns that came with it, to a `pose` |
//! | `sources` | the fixes and turns that came with a `wheels` sample |
//! | `covariance` | how the covariance of the pose's error grows with the motion |
//! | `filter` | the estimate, and the ticks and fixes of the last 2 s |
//! | `tick` | the motion of one tick |
//! | `gyro` | the turn of a tick from a gyro's increments |
//! | `disagreement` | whether laser and wheels disagree on every motion, and why |
//! | `doubt` | what no fix settles, and widens the covariance that is given |
//! | `relocation` | whether fixes that contradict the pose agree among themselves |
//!
//! The state is saved after the pose is published, so that the tick does not wait for the file. A process killed in between has
//! published a pose that its saved state lacks. That is safe: counts are cumulative and the link's last sample stays on the bus, so the
//! successor computes the same pose from the state before. If the next tick has come, it takes both ticks' way as one arc, a millimetre
//! or two off. At the first tick, and when the robot restarted its counts, the older state does not fit the counts, so the new one is
//! saved first; if all processes are killed then, a resumed run counts the tick again.

mod covariance;
mod disagreement;
mod doubt;
mod filter;
mod gyro;
mod relocation;
mod sources;
pub mod step;
mod tick;

use std::path::Path;

use common::{
    checkpoint::{Checkpoint, CheckpointError},
    mission::Mission,
    run,
    samples::PlaceSample,
    stage::Answering as _,
};

use step::{STATE_BYTES, State};

pub use sources::Sources;
pub use step::DeadReckoning;

/// Where the robot of the run in `directory` last believed it was; none before its first tick.
pub fn saved_place(
    directory: &Path,
    mission: &Mission,
) -> Result<Option<PlaceSample>, CheckpointError> {
    Ok(saved_state(directory)?.map(|state| DeadReckoning::place_of(mission, state)))
}

/// The state that the process of the run in `directory` saved; none before its first tick.
pub fn saved_state(directory: &Path) -> Result<Option<State>, CheckpointError> {
    let file = run::checkpoint_file(directory, DeadReckoning::NAME);
    Ok(Checkpoint::open(&file, STATE_BYTES)?.1)
}
