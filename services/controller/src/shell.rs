//! `guidance` in, `command` out.

use common::{
    bus::{Reader, Writer},
    inputs::InputLog,
    latency_budget::{Answers, Item, LatencyBudget},
    samples::{CommandSample, GuidanceSample},
    shell::{Context, Process, Progress, StageError},
    step::Step as _,
    topics,
};

use crate::{replay::Input, step::Controller};

/// The controller process.
#[derive(Debug)]
pub struct Shell {
    guidance: Reader<GuidanceSample>,
    command: Writer<CommandSample>,
    controller: Controller,
    inputs: InputLog,
    progress: Progress,
    budget: LatencyBudget,
}

impl Process for Shell {
    fn open(context: &mut Context) -> Result<Self, StageError> {
        context.waiter.on(context.bus.wakeup(&topics::GUIDANCE)?);
        Ok(Self {
            guidance: context.bus.reader(&topics::GUIDANCE)?,
            command: context
                .bus
                .writer(&topics::COMMAND, context.generation.number)?,
            controller: Controller::new(&context.run.mission),
            inputs: InputLog::begin(context, &())?,
            progress: Progress::default(),
            budget: context.budget.clone(),
        })
    }

    fn turn(&mut self) -> Result<Progress, StageError> {
        let Some(guidance) = self.guidance.newest()? else {
            return Ok(self.progress);
        };
        let (tick, time) = (guidance.stamp.tick, guidance.stamp.time());
        self.progress = Progress { tick, time };
        self.budget.end(Item::Read);
        self.inputs.note(&Input { guidance }, self.progress)?;
        self.budget.end(Item::Persist);
        let command = self.controller.step(&guidance, time);
        self.budget.end(Item::Step);
        self.inputs.publish(self.progress)?;
        self.budget.end(Item::Persist);
        self.command.publish_quietly(tick, time, command)?;
        self.budget.published(tick, Answers::Inputs);
        self.command.wake()?;
        Ok(self.progress)
    }
}
