//! `guidance` and `pose` in, `command` out.

use common::{
    bus::{Reader, Writer},
    samples::{CommandSample, GuidanceSample, PoseSample},
    shell::{Context, Process, Progress, StageError},
    topics,
};

use crate::step::Controller;

/// The controller process.
#[derive(Debug)]
pub struct Shell {
    guidance: Reader<GuidanceSample>,
    pose: Reader<PoseSample>,
    command: Writer<CommandSample>,
    controller: Controller,
    latest_pose: Option<PoseSample>,
    progress: Progress,
}

impl Process for Shell {
    fn open(context: &mut Context) -> Result<Self, StageError> {
        context.waiter.on(context.bus.wakeup(&topics::GUIDANCE)?);
        Ok(Self {
            guidance: context.bus.reader(&topics::GUIDANCE)?,
            pose: context.bus.reader(&topics::POSE)?,
            command: context
                .bus
                .writer(&topics::COMMAND, context.generation.number)?,
            controller: Controller::new(&context.run.mission),
            latest_pose: None,
            progress: Progress::default(),
        })
    }

    fn turn(&mut self) -> Result<Progress, StageError> {
        let Some(guidance) = self.guidance.newest()? else {
            return Ok(self.progress);
        };
        if let Some(pose) = self.pose.newest()? {
            self.latest_pose = Some(pose);
        }
        // The pose of a tick is published before its guidance; without one, the guidance is of a tick
        // that began before this life did.
        let Some(pose) = self.latest_pose else {
            return Ok(self.progress);
        };
        let command = CommandSample {
            pose_ns: pose.stamp.stamp_ns.min(guidance.pose_ns),
            guidance_ns: guidance.stamp.stamp_ns,
            ..self.controller.step(pose.pose(), &guidance)
        };
        self.progress = Progress {
            tick: guidance.stamp.tick,
            time: guidance.stamp.time(),
        };
        self.command
            .publish(self.progress.tick, self.progress.time, command)?;
        Ok(self.progress)
    }
}
