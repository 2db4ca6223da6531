//! Destinations of a stage's outputs: the bus and files in its process, a list in a replay.

use std::any::Any;

use serde::Serialize;

use crate::{
    bus::{AnyWriter, BusError, Payload, Stamped, Topic, Writer},
    checkpoint::Checkpoint,
    inputs::InputLog,
    journal::Journal,
    replay::Output,
    shell::{Context, Progress},
    start::{Result, StageError},
    topics::Rate,
};

#[derive(Debug, Default)]
pub(crate) enum Saved {
    #[default]
    Nothing,
    State(Checkpoint),
    Journal(Journal),
}

#[derive(Default)]
pub struct Outputs {
    pub at: Progress,
    writers: Vec<(&'static str, Box<dyn AnyWriter>)>,
    /// `None` in a replay, and for a process whose inputs are not recorded.
    inputs: Option<InputLog>,
    saved: Saved,
    replayed: Option<Replayed>,
}

struct Replayed {
    published: Vec<Output>,
    has_field: bool,
}

impl Outputs {
    /// Opens outputs without recorded inputs, which cannot be replayed, and without slices.
    pub fn without_inputs(context: &mut Context) -> Result<Self> {
        Self::of_process(context, None, 0)
    }

    pub(crate) fn of_process(
        context: &mut Context,
        inputs: Option<InputLog>,
        longest: usize,
    ) -> Result<Self> {
        let mut out = Self { inputs, saved: std::mem::take(&mut context.saved), ..Self::default() };
        out.open(context, longest, false)?;
        Ok(out)
    }

    /// Creates the outputs of a replay; `has_field` enables comparison of `field` samples.
    pub(crate) fn of_replay(has_field: bool) -> Self {
        let replayed = Some(Replayed { published: Vec::new(), has_field });
        Self { replayed, ..Self::default() }
    }

    /// Returns whether samples of `field` are published. A replay skips them if it has none to
    /// compare.
    pub fn has_field(&self) -> bool {
        self.replayed.as_ref().is_none_or(|replayed| replayed.has_field)
    }

    /// Call it after the first ready heartbeat.
    pub fn open_late(&mut self, context: &mut Context) -> Result {
        self.open(context, 0, true)
    }

    fn open(&mut self, context: &mut Context, longest: usize, late: bool) -> Result {
        assert!(self.replayed.is_none() && (late || self.writers.is_empty()));
        for topic in context.wiring.outputs {
            if (topic.spec().rate == Rate::EachFrame) == late {
                debug_assert_eq!(topic.spec().writer, context.wiring.stage);
                let writer = topic.any_writer(&context.bus, context.generation.number, longest)?;
                self.writers.push((topic.spec().name, writer));
            }
        }
        Ok(())
    }

    fn writer<H: Stamped, E: Payload>(&mut self, topic: &Topic<H, E>) -> Result<&mut Writer<H, E>> {
        let name = topic.spec().name;
        let mut writers = self.writers.iter_mut();
        let writer = writers.find(|(topic, _)| *topic == name);
        let writer = writer.and_then(|(_, writer)| (&mut **writer as &mut dyn Any).downcast_mut());
        writer.ok_or(StageError::NoOutput(name))
    }

    pub(crate) fn drain(&mut self) -> Vec<Output> {
        self.replayed.as_mut().map(|it| std::mem::take(&mut it.published)).unwrap_or_default()
    }

    pub(crate) fn note(&mut self, input: &impl Serialize) -> Result {
        self.inputs.as_mut().map_or(Ok(()), |inputs| inputs.note(input, self.at))
    }

    pub fn publish_inputs(&mut self) -> Result<(), BusError> {
        self.inputs.as_mut().map_or(Ok(()), |inputs| inputs.publish(self.at))
    }

    /// Does nothing for `None`.
    pub fn publish<H: Stamped>(
        &mut self,
        topic: &'static Topic<H>,
        sample: impl Into<Option<H>>,
    ) -> Result {
        sample.into().map_or(Ok(()), |sample| self.publish_slice(topic, sample, &[]))
    }

    pub fn publish_slice<H: Stamped, E: Payload>(
        &mut self,
        topic: &'static Topic<H, E>,
        header: H,
        slice: &[E],
    ) -> Result {
        self.publish_quietly(topic, header, slice)?;
        match self.replayed {
            Some(_) => Ok(()),
            None => Ok(self.writer(topic)?.wake()?),
        }
    }

    pub fn publish_quietly<H: Stamped, E: Payload>(
        &mut self,
        topic: &'static Topic<H, E>,
        header: H,
        slice: &[E],
    ) -> Result {
        let Progress { tick, time } = self.at;
        if let Some(Replayed { published, .. }) = &mut self.replayed {
            published.push(Output::of(topic, tick, time, header, slice));
            return Ok(());
        }
        self.publish_inputs()?;
        Ok(self.writer(topic)?.publish_quietly(tick, time, header, slice)?)
    }

    /// Returns whether `topic` has a new reader since the last call, which needs a keyframe.
    pub fn has_new_reader<H: Stamped, E: Payload>(
        &mut self,
        topic: &'static Topic<H, E>,
    ) -> Result<bool> {
        Ok(self.replayed.is_none() && self.writer(topic)?.has_new_reader())
    }

    pub fn save(&mut self, state: &impl Serialize) -> Result {
        if let Saved::State(checkpoint) = &mut self.saved {
            checkpoint.save(state)?;
        }
        Ok(())
    }

    pub fn append(&mut self, entry: &impl Serialize) -> Result {
        if let Saved::Journal(journal) = &mut self.saved {
            journal.append(entry)?;
        }
        Ok(())
    }

    pub const fn is_journal_long(&self) -> bool {
        matches!(&self.saved, Saved::Journal(journal) if journal.is_long())
    }

    pub fn shorten_journal(&mut self, state: &impl Serialize) -> Result {
        if let Saved::Journal(journal) = &mut self.saved
            && journal.is_long()
        {
            journal.snapshot(state)?;
        }
        Ok(())
    }
}
