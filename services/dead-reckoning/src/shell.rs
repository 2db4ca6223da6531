//! `wheels` in, `pose` out, the state kept before it is told.

use std::path::Path;

use common::{
    bus::{Reader, Writer},
    checkpoint::{Checkpoint, CheckpointError},
    run,
    samples::{PoseSample, WheelSample},
    shell::{Context, Process, Progress, StageError},
    topics,
};

use crate::step::{DeadReckoning, State};

/// Room for the encoded state, bytes: it is under 100.
const CHECKPOINT_CAPACITY: usize = 256;

/// What the process of the run in `directory` has kept; none before its first tick.
///
/// # Errors
/// When the file system refuses.
pub fn kept_state(directory: &Path) -> Result<Option<State>, CheckpointError> {
    let file = run::checkpoint_file(directory, "dead-reckoning");
    Ok(Checkpoint::open(&file, CHECKPOINT_CAPACITY)?.1)
}

/// The dead-reckoning process.
#[derive(Debug)]
pub struct Shell {
    wheels: Reader<WheelSample>,
    pose: Writer<PoseSample>,
    checkpoint: Checkpoint,
    reckoning: DeadReckoning,
    progress: Progress,
}

impl Process for Shell {
    fn open(context: &mut Context) -> Result<Self, StageError> {
        let mut reckoning = DeadReckoning::new(&context.run.mission);
        let (checkpoint, kept) =
            Checkpoint::open::<State>(&context.checkpoint_file(), CHECKPOINT_CAPACITY)?;
        if let Some(state) = kept {
            tracing::info!(?state, "pose restored");
            reckoning.restore(state);
        }
        context.waiter.on(context.bus.wakeup(&topics::WHEELS)?);
        Ok(Self {
            wheels: context.bus.reader(&topics::WHEELS)?,
            pose: context
                .bus
                .writer(&topics::POSE, context.generation.number)?,
            checkpoint,
            reckoning,
            progress: Progress::default(),
        })
    }

    fn turn(&mut self) -> Result<Progress, StageError> {
        while let Some(wheels) = self.wheels.take()? {
            let disbelieved = self.reckoning.disbelieved();
            let pose = self.reckoning.step(&wheels);
            if self.reckoning.disbelieved() > disbelieved {
                tracing::warn!(
                    tick = wheels.stamp.tick,
                    "the encoder counts began anew or jumped; the pose stays"
                );
            }
            self.checkpoint.save(self.reckoning.state())?;
            self.progress = Progress {
                tick: wheels.stamp.tick,
                time: wheels.stamp.time(),
            };
            self.pose
                .publish(self.progress.tick, self.progress.time, pose)?;
        }
        Ok(self.progress)
    }
}
