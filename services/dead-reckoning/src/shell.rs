//! `wheels` in, `pose` out, then the state saved: the tick does not wait for the file.
//!
//! A process killed between the two has published a pose that its state does not hold. That is safe: the counts are
//! cumulative and the link's last sample stays on the bus, so the successor computes the same pose again from the state
//! before, or, where the next tick has come, the way of both ticks as one arc, a millimetre or two off. Where the counts
//! begin, at the first tick or when the robot began them anew, the state before says nothing of them: there it is saved
//! first. A run that is resumed after all its processes were killed just there counts that tick again.

use std::path::Path;

use common::{
    bus::{Reader, Writer},
    checkpoint::{Checkpoint, CheckpointError},
    inputs::InputLog,
    latency_budget::{Answers, Item, LatencyBudget},
    run,
    samples::{PoseSample, WheelSample},
    shell::{Context, Process, Progress, StageError},
    step::Step as _,
    topics,
};

use crate::{
    replay::Input,
    step::{DeadReckoning, Reckoned, State},
};

/// Room for the encoded state, bytes: it is under 300.
const CHECKPOINT_CAPACITY: usize = 512;

/// The state that the process of the run in `directory` saved; none before its first tick.
///
/// # Errors
/// When the file system refuses.
pub fn saved_state(directory: &Path) -> Result<Option<State>, CheckpointError> {
    let file = run::checkpoint_file(directory, "dead-reckoning");
    Ok(Checkpoint::open(&file, CHECKPOINT_CAPACITY)?.1)
}

/// The dead-reckoning process.
#[derive(Debug)]
pub struct Shell {
    wheels: Reader<WheelSample>,
    pose: Writer<PoseSample>,
    checkpoint: Checkpoint,
    inputs: InputLog,
    reckoning: DeadReckoning,
    progress: Progress,
    budget: LatencyBudget,
}

impl Process for Shell {
    fn open(context: &mut Context) -> Result<Self, StageError> {
        let mut reckoning = DeadReckoning::new(&context.run.mission);
        let (checkpoint, saved) =
            Checkpoint::open::<State>(&context.checkpoint_file(), CHECKPOINT_CAPACITY)?;
        let inputs = InputLog::begin(context, &saved)?;
        if let Some(state) = saved {
            match reckoning.restore(state) {
                Ok(()) => tracing::info!(?state, "pose restored"),
                Err(foreign) => tracing::warn!("{foreign}"),
            }
        }
        context.waiter.on(context.bus.wakeup(&topics::WHEELS)?);
        Ok(Self {
            wheels: context.bus.reader(&topics::WHEELS)?,
            pose: context
                .bus
                .writer(&topics::POSE, context.generation.number)?,
            checkpoint,
            inputs,
            reckoning,
            progress: Progress::default(),
            budget: context.budget.clone(),
        })
    }

    fn turn(&mut self) -> Result<Progress, StageError> {
        while let Some(wheels) = self.wheels.take()? {
            let (tick, time) = (wheels.stamp.tick, wheels.stamp.time());
            self.progress = Progress { tick, time };
            self.budget.end(Item::Read);
            self.inputs.note(&Input { wheels }, self.progress)?;
            self.budget.end(Item::Persist);
            let first = self.reckoning.state().newest().is_none();
            let Reckoned { pose, rejected } = self.reckoning.step(&wheels, time);
            self.budget.end(Item::Step);
            if rejected {
                tracing::warn!(
                    tick,
                    "the encoder counts began anew or jumped; the pose stays"
                );
            }
            let counts_begin = first || rejected;
            if counts_begin {
                self.checkpoint.save(self.reckoning.state())?;
            }
            self.inputs.publish(self.progress)?;
            self.budget.end(Item::Persist);
            self.pose.publish_quietly(tick, time, pose)?;
            self.budget.published(tick, Answers::Inputs);
            self.pose.wake()?;
            if !counts_begin {
                self.checkpoint.save(self.reckoning.state())?;
            }
        }
        Ok(self.progress)
    }
}
