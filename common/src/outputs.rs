//! Where the outputs of a stage go: onto the bus and into files in its process, into a list in a replay.

use std::any::Any;

use serde::Serialize;

use crate::{
    bus::{AnyWriter, Payload, Stamped, Topic, Writer},
    checkpoint::CheckpointError,
    inputs::InputLog,
    replay::Output,
    saved::Saved,
    shell::{Context, Progress},
    start::StageError,
    topics::Rate,
    wiring::{Access, WiringError},
};

/// Takes what a stage publishes and persists.
pub struct Outputs {
    /// The tick and mission time of the next output.
    pub at: Progress,
    to: Destination,
}

enum Destination {
    Process(Box<Process>),
    Replay { published: Vec<Output>, has_field: bool },
}

struct Process {
    writers: Vec<(&'static str, Box<dyn AnyWriter>)>,
    inputs: InputLog,
    saved: Saved,
    /// An input was noted, and nothing published since.
    noted: bool,
}

impl Outputs {
    /// The outputs of the process of `context`, which starts from `start`. A slice has at most `longest` elements.
    pub(crate) fn of_process(
        context: &mut Context,
        start: &impl Serialize,
        longest: usize,
    ) -> Result<Self, StageError> {
        let inputs = InputLog::begin(context, start)?;
        let mut process =
            Process { writers: Vec::new(), inputs, saved: context.take_saved(), noted: false };
        process.open(context, longest, false)?;
        Ok(Self { at: Progress::default(), to: Destination::Process(Box::new(process)) })
    }

    /// The outputs of a replay. `has_field` says whether samples of `field` are compared.
    pub(crate) fn of_replay(has_field: bool) -> Self {
        let to = Destination::Replay { published: Vec::new(), has_field };
        Self { at: Progress::default(), to }
    }

    /// Whether samples of `field` are published: a replay saves the time where there are none to compare with.
    pub const fn has_field(&self) -> bool {
        matches!(self.to, Destination::Process(_) | Destination::Replay { has_field: true, .. })
    }

    /// Open the topics that follow each frame of the robot.
    pub(crate) fn open_late(&mut self, context: &mut Context) -> Result<(), StageError> {
        match &mut self.to {
            Destination::Process(process) => process.open(context, 0, true),
            Destination::Replay { .. } => Ok(()),
        }
    }

    /// The samples that a replay published since the last call.
    pub(crate) fn drain(&mut self) -> Vec<Output> {
        match &mut self.to {
            Destination::Process(_) => Vec::new(),
            Destination::Replay { published, .. } => std::mem::take(published),
        }
    }

    /// The step is about to take `input`.
    pub(crate) fn note(&mut self, input: &impl Serialize) -> Result<(), StageError> {
        if let Destination::Process(process) = &mut self.to {
            process.inputs.note(input, self.at)?;
            process.noted = true;
        }
        Ok(())
    }

    /// Publish the inputs that were noted, before anything follows from them that is not a sample.
    pub fn publish_inputs(&mut self) -> Result<(), StageError> {
        match &mut self.to {
            Destination::Process(process) => process.publish_inputs(self.at),
            Destination::Replay { .. } => Ok(()),
        }
    }

    /// Publish a sample, and wake its readers.
    pub fn publish<H: Stamped>(
        &mut self,
        topic: &'static Topic<H>,
        sample: H,
    ) -> Result<(), StageError> {
        self.publish_slice(topic, sample, &[])
    }

    /// Publish a header with a slice, and wake its readers.
    pub fn publish_slice<H: Stamped, E: Payload>(
        &mut self,
        topic: &'static Topic<H, E>,
        header: H,
        slice: &[E],
    ) -> Result<(), StageError> {
        self.publish_quietly(topic, header, slice)?;
        match &mut self.to {
            Destination::Replay { .. } => Ok(()),
            Destination::Process(process) => Ok(process.writer(topic)?.wake()?),
        }
    }

    /// Publish a header with a slice on a topic that wakes nobody.
    pub fn publish_quietly<H: Stamped, E: Payload>(
        &mut self,
        topic: &'static Topic<H, E>,
        header: H,
        slice: &[E],
    ) -> Result<(), StageError> {
        let at @ Progress { tick, time } = self.at;
        match &mut self.to {
            Destination::Replay { published, .. } => {
                published.push(Output::of(topic, tick, time, header, slice));
            }
            Destination::Process(process) => {
                process.publish_inputs(at)?;
                process.writer(topic)?.publish_quietly(tick, time, header, slice)?;
            }
        }
        Ok(())
    }

    /// Whether a reader of `topic` came since this was last asked: it needs a keyframe.
    pub fn has_new_reader<H: Stamped, E: Payload>(
        &mut self,
        topic: &'static Topic<H, E>,
    ) -> Result<bool, StageError> {
        match &mut self.to {
            Destination::Process(process) => Ok(process.writer(topic)?.has_new_reader()),
            Destination::Replay { .. } => Ok(false),
        }
    }

    /// Save the stage's state.
    pub fn save(&mut self, state: &impl Serialize) -> Result<(), StageError> {
        self.persist(|saved| saved.save(state))
    }

    /// Append an entry to the stage's journal.
    pub fn append(&mut self, entry: &impl Serialize) -> Result<(), StageError> {
        self.persist(|saved| saved.append(entry))
    }

    fn persist(
        &mut self,
        save: impl FnOnce(&mut Saved) -> Result<(), CheckpointError>,
    ) -> Result<(), StageError> {
        match &mut self.to {
            Destination::Process(process) => Ok(save(&mut process.saved)?),
            Destination::Replay { .. } => Ok(()),
        }
    }

    /// Whether a snapshot is due, with which the stage's journal begins anew.
    pub fn is_journal_long(&self) -> bool {
        match &self.to {
            Destination::Process(process) => process.saved.is_journal_long(),
            Destination::Replay { .. } => false,
        }
    }

    /// Save a snapshot of `state` if one is due.
    pub fn shorten_journal(&mut self, state: &impl Serialize) -> Result<(), StageError> {
        match &mut self.to {
            Destination::Process(process) => Ok(process.saved.shorten_journal(state)?),
            Destination::Replay { .. } => Ok(()),
        }
    }
}

impl Process {
    fn open(
        &mut self,
        context: &mut Context,
        longest: usize,
        late: bool,
    ) -> Result<(), StageError> {
        for topic in context.opened.wiring.outputs {
            if (topic.spec().rate == Rate::EachFrame) == late {
                context.opened.add(Access::Write, topic.spec().name)?;
                let number = context.generation.number;
                let writer = topic.any_writer(&context.bus, number, longest)?;
                self.writers.push((topic.spec().name, writer));
            }
        }
        Ok(())
    }

    fn writer<H: Stamped, E: Payload>(
        &mut self,
        topic: &Topic<H, E>,
    ) -> Result<&mut Writer<H, E>, StageError> {
        let name = topic.spec().name;
        let mut writers = self.writers.iter_mut();
        let writer = writers.find(|(topic, _)| *topic == name);
        let writer = writer.and_then(|(_, writer)| (&mut **writer as &mut dyn Any).downcast_mut());
        writer.ok_or(WiringError::NotListed(Access::Write, name).into())
    }

    fn publish_inputs(&mut self, at: Progress) -> Result<(), StageError> {
        if self.noted {
            self.inputs.publish(at)?;
            self.noted = false;
        }
        Ok(())
    }
}
