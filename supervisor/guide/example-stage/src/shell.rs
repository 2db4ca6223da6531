//! `pose` in, `distance` out, the state saved before the sums are published.

use common::{
    bus::{Reader, Writer},
    checkpoint::Checkpoint,
    inputs::InputLog,
    samples::PoseSample,
    shell::{Context, Process, Progress, StageError},
    step::Step as _,
    topics::POSE,
};

use crate::rows::{DISTANCE, DistanceSample};
use crate::{
    replay::{Input, sample},
    step::{Odometer, State},
};

/// Room for the encoded state, bytes: it is under 60.
const CHECKPOINT_CAPACITY: usize = 128;

/// The odometer process.
#[derive(Debug)]
pub struct Shell {
    pose: Reader<PoseSample>,
    distance: Writer<DistanceSample>,
    checkpoint: Checkpoint,
    inputs: InputLog,
    odometer: Odometer,
    progress: Progress,
}

impl Process for Shell {
    fn open(context: &mut Context) -> Result<Self, StageError> {
        let mut odometer = Odometer::new(&context.run.mission);
        let (checkpoint, saved) =
            Checkpoint::open::<State>(&context.checkpoint_file(), CHECKPOINT_CAPACITY)?;
        let inputs = InputLog::begin(context, &saved)?;
        if let Some(state) = saved {
            match odometer.restore(state) {
                Ok(()) => tracing::info!(?state, "distance restored"),
                Err(foreign) => tracing::warn!("{foreign}"),
            }
        }
        context.waiter.on(context.bus.wakeup(&POSE)?);
        Ok(Self {
            pose: context.bus.reader(&POSE)?,
            distance: context.bus.writer(&DISTANCE, context.generation.number)?,
            checkpoint,
            inputs,
            odometer,
            progress: Progress::default(),
        })
    }

    fn turn(&mut self) -> Result<Progress, StageError> {
        while let Some(pose) = self.pose.take()? {
            let (tick, time) = (pose.stamp.tick, pose.stamp.time());
            self.progress = Progress { tick, time };
            self.inputs.note(&Input { pose }, self.progress)?;
            let sums = self.odometer.step(&pose, time);
            self.checkpoint.save(self.odometer.state())?;
            self.inputs.publish(self.progress)?;
            self.distance.publish(tick, time, sample(sums))?;
        }
        Ok(self.progress)
    }
}
