//! The velocity synchroniser: guidance to wheel speeds, equations (14)-(17). [`step`] is the pure controller.

pub mod step;

use common::{
    bus::Topic,
    clock::MissionTime,
    samples::{CommandSample, GuidanceSample},
    stage::{Answer, Answering},
    step::Step as _,
    topics::{COMMAND, GUIDANCE},
};

pub use step::Controller;

impl Answering for Controller {
    type In = GuidanceSample;
    type Out = CommandSample;
    type Further = ();
    const NAME: &'static str = "controller";
    const INPUT: &'static Topic<GuidanceSample> = &GUIDANCE;
    const OUTPUT: &'static Topic<CommandSample> = &COMMAND;
    const NEWEST_ONLY: bool = true;

    fn answer(
        &mut self,
        guidance: &GuidanceSample,
        (): &(),
        now: MissionTime,
    ) -> Answer<CommandSample> {
        self.step(guidance, now).into()
    }
}
