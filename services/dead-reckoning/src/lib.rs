//! Dead reckoning: encoder counts to pose, equations (20) and (21).
//!
//! The state is saved after the pose is published, so that the tick does not wait for the file. A
//! process killed in between has published a pose that its saved state lacks. That is safe: counts
//! are cumulative and the link's last sample stays on the bus, so the successor computes the same
//! pose.
//!
//! At the first tick, and after restarted counts, the older state does not fit the counts, so the
//! new one is saved first. If all processes are killed then, a resumed run counts the tick again.

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

pub fn saved_place(
    directory: &Path,
    mission: &Mission,
) -> Result<Option<PlaceSample>, CheckpointError> {
    Ok(saved_state(directory)?.map(|state| DeadReckoning::place_of(mission, state)))
}

pub fn saved_state(directory: &Path) -> Result<Option<State>, CheckpointError> {
    Ok(Checkpoint::open(&run::checkpoint_file(directory, DeadReckoning::NAME), STATE_BYTES)?.1)
}
