//! `guidance` in, `command` out.

use common::{
    bus::{Reader, Writer},
    samples::{CommandSample, GuidanceSample},
    shell::{Context, Process, Progress, StageError},
    step::Step as _,
    topics,
};

use crate::step::Controller;

/// The controller process.
#[derive(Debug)]
pub struct Shell {
    guidance: Reader<GuidanceSample>,
    command: Writer<CommandSample>,
    controller: Controller,
    progress: Progress,
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
            progress: Progress::default(),
        })
    }

    fn turn(&mut self) -> Result<Progress, StageError> {
        let Some(guidance) = self.guidance.newest()? else {
            return Ok(self.progress);
        };
        let (tick, time) = (guidance.stamp.tick, guidance.stamp.time());
        let command = self.controller.step(&guidance, time);
        self.command.publish(tick, time, command)?;
        self.progress = Progress { tick, time };
        Ok(self.progress)
    }
}
