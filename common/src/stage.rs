//! Stages and their runner, shared by each stage's process and replay.
//!
//! A [`Stage`] maps entries to outputs. Its [`Process`] makes entries from topics; a replay reads
//! them from a recording.
//!
//! An [`Answering`] stage answers each sample of one topic, with samples of further topics if
//! needed, by a sample of another.
//!
//! # Dependencies of a stage
//! A stage is pure: it has no shared memory, socket, file, thread or clock. Its only inputs are:
//! - the mission, given once to [`Stage::new`];
//! - the state given to [`Stage::begin`], which an earlier process of the stage may have saved;
//! - its entries, in their order, each with its mission time.
//!
//! The same inputs therefore give the same outputs to the bit, on any machine. Everything else
//! becomes an entry: clock readings (of the link), results of other threads (the planner's
//! background solve), a random seed (the mission's).

use std::{borrow::Cow, fmt::Debug};

use serde::{Deserialize, Serialize, de::DeserializeOwned};
use thiserror::Error;

use crate::{
    bus::{Bus, BusError, Layout, Reader, Stamped, Topic},
    clock::MissionTime,
    inputs::{self, InputLog},
    mission::Mission,
    outputs::Outputs,
    replay::{Beginning, Output, Replay, ReplayError, entry},
    shell::{Context, Process, Progress},
    start::Result,
    wiring::{Persists, Readers, Topics},
};

pub trait Stage: Sized + 'static {
    type Start: Serialize + DeserializeOwned;
    /// Input of one step: a sample, or an enum for several kinds. It may borrow from shared memory
    /// during the call. Recordings use this encoding.
    type Entry<'a>: Serialize + Deserialize<'a> + Debug;
    type Outcome;

    fn new(mission: &Mission) -> Self;

    /// Opens the file for the persisted state and returns the initial state.
    fn start(&self, context: &mut Context) -> Result<Self::Start>;

    /// Continues from `start`. Called at most once, before the first entry.
    ///
    /// # Errors
    /// If the state belongs to another mission. The stage then stays as [`Stage::new`] created it.
    fn begin(&mut self, start: Self::Start) -> Result<(), ForeignState>;

    /// Computes, persists and publishes the effects of `entry`. A repeated tick must not count
    /// twice. Sets [`Outputs::at`] if the entry states its tick.
    ///
    /// # Errors
    /// If an output cannot be published or the state cannot be saved.
    fn take_entry(&mut self, entry: Self::Entry<'_>, out: &mut Outputs) -> Result<Self::Outcome>;

    /// Publishes outputs that no stage waits for. A process calls this in a pause, a replay after
    /// each entry.
    fn publish_rest(&mut self, _out: &mut Outputs) -> Result {
        Ok(())
    }

    fn describe(entry: &Self::Entry<'_>) -> String {
        format!("{entry:?}")
    }
}

#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("the saved state belongs to another mission; the stage starts without it")]
pub struct ForeignState;

pub struct Runner<S> {
    pub stage: S,
    pub out: Outputs,
}

impl<S: Stage> Runner<S> {
    /// Opens the stage's outputs and restores its state. A published slice has at most `longest`
    /// elements.
    pub fn open(context: &mut Context, longest: impl FnOnce(&S) -> usize) -> Result<Self> {
        let mut stage = S::new(&context.run.mission);
        let start = stage.start(context)?;
        let inputs = InputLog::begin(context, &start)?;
        let out = Outputs::of_process(context, Some(inputs), longest(&stage))?;
        if let Err(foreign) = stage.begin(start) {
            tracing::warn!("{foreign}");
        }
        Ok(Self { stage, out })
    }

    pub fn take_entry(&mut self, entry: S::Entry<'_>) -> Result<S::Outcome> {
        self.out.note(&entry)?;
        self.stage.take_entry(entry, &mut self.out)
    }

    pub fn publish_rest(&mut self) -> Result {
        self.stage.publish_rest(&mut self.out)
    }
}

pub fn replay<S: Stage>(beginning: Beginning<'_>) -> Result<Box<dyn Replay>, ReplayError> {
    let mut stage = S::new(&beginning.run.mission);
    // A stage without persistence starts from an empty entry.
    if !beginning.start.is_empty() {
        // The process ignored a foreign state, too.
        let _ = stage.begin(entry(beginning.start)?);
    }
    Ok(Box::new(Runner { stage, out: Outputs::of_replay(beginning.fields) }))
}

impl<S: Stage> Replay for Runner<S> {
    fn take(&mut self, body: &[u8]) -> Result<Vec<Output>, ReplayError> {
        let taken = self.take_entry(entry(body)?).and_then(|_| self.publish_rest());
        taken.map_err(|error| ReplayError::Stage(error.to_string()))?;
        Ok(self.out.drain())
    }

    fn describe(&self, body: &[u8]) -> Result<String, ReplayError> {
        Ok(S::describe(&entry(body)?))
    }
}

/// Stage that answers each sample of one topic with a sample of another.
pub trait Answering: Sized + 'static {
    /// State that must survive the process, because its input topics cannot restore it; `()` for
    /// none.
    type State: Serialize + DeserializeOwned + Clone + Debug;
    type In: Stamped;
    type Out: Stamped;
    /// Samples of further topics that accompany an input sample; `()` for none.
    type Further: Further;
    const NAME: &'static str;
    const INPUT: &'static Topic<Self::In>;
    const OUTPUT: &'static Topic<Self::Out>;
    const PERSISTS: Persists = Persists::Nothing;
    /// Whether the stage skips all but the newest sample.
    const NEWEST_ONLY: bool = false;

    fn new(mission: &Mission) -> Self;

    fn state(&self) -> &Self::State;

    /// Applies [`Stage::begin`] to the state of an earlier process of the same mission.
    fn restore(&mut self, state: Self::State) -> Result<(), ForeignState>;

    /// Returns whether `input` was answered before, as a repeated tick; samples of further topics
    /// then wait for the next one.
    fn has_answered(&self, _input: &Self::In) -> bool {
        false
    }

    fn answer(
        &mut self,
        input: &Self::In,
        further: &Self::Further,
        now: MissionTime,
    ) -> Answer<Self::Out>;
}

/// Samples of further topics that arrived before an input sample. They wake no process.
pub trait Further: Default + Serialize + DeserializeOwned + Debug + 'static {
    type Readers: Readers;

    /// Takes no more than a limit.
    fn take_samples(readers: &mut Self::Readers) -> Result<Self, BusError>;
}

impl Further for () {
    type Readers = ();

    fn take_samples((): &mut ()) -> Result<(), BusError> {
        Ok(())
    }
}

#[derive(Clone, Debug)]
pub struct Answer<P> {
    pub sample: P,
    /// Whether to save the state before publishing the sample. Otherwise no tick waits for the
    /// file.
    pub saves_first: bool,
    pub warning: Option<Cow<'static, str>>,
}

impl<P> From<P> for Answer<P> {
    fn from(sample: P) -> Self {
        Self { sample, saves_first: true, warning: None }
    }
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(bound = "P: Layout, F: Further")]
pub struct Sample<P: Layout, F>(#[serde(with = "inputs::sample")] P, F);

impl<A: Answering> Stage for A {
    type Start = Option<A::State>;
    type Entry<'a> = Sample<A::In, A::Further>;
    type Outcome = Option<Cow<'static, str>>;

    fn new(mission: &Mission) -> Self {
        Answering::new(mission)
    }

    fn start(&self, context: &mut Context) -> Result<Self::Start> {
        let saved: Self::Start = context.saved_state()?;
        if let Some(state) = &saved {
            tracing::info!(?state, "the state is restored");
        }
        Ok(saved)
    }

    fn begin(&mut self, start: Self::Start) -> Result<(), ForeignState> {
        start.map_or(Ok(()), |state| self.restore(state))
    }

    fn take_entry(
        &mut self,
        Sample(input, further): Sample<A::In, A::Further>,
        out: &mut Outputs,
    ) -> Result<Self::Outcome> {
        out.at = Progress::of(input.stamp());
        let answer = self.answer(&input, &further, out.at.time);
        if answer.saves_first {
            out.save(self.state())?;
        }
        out.publish(A::OUTPUT, answer.sample)?;
        if !answer.saves_first {
            out.save(self.state())?;
        }
        Ok(answer.warning)
    }

    fn describe(Sample(input, further): &Sample<A::In, A::Further>) -> String {
        let name = A::INPUT.spec().name;
        if <A::Further as Further>::Readers::FEEDBACK.is_empty() {
            format!("{name} {input:?}")
        } else {
            format!("{name} {input:?} with {further:?}")
        }
    }
}

pub struct Questions<A: Answering>(Reader<A::In>, <A::Further as Further>::Readers);

impl<A: Answering> Readers for Questions<A> {
    const INPUTS: Topics = &[A::INPUT];
    const FEEDBACK: Topics = <A::Further as Further>::Readers::FEEDBACK;

    fn open_readers(bus: &Bus) -> Result<Self, BusError> {
        Ok(Self(bus.reader(A::INPUT)?, Readers::open_readers(bus)?))
    }
}

pub struct Answers<A: Answering> {
    runner: Runner<A>,
    readers: Questions<A>,
}

impl<A: Answering> Process for Answers<A> {
    const NAME: &'static str = A::NAME;
    const WAKES: Topics = &[A::INPUT];
    const OUTPUTS: Topics = &[A::OUTPUT];
    const PERSISTS: Persists = A::PERSISTS;
    type Readers = Questions<A>;

    fn open(context: &mut Context, readers: Questions<A>) -> Result<Self> {
        Ok(Self { runner: Runner::open(context, |_| 0)?, readers })
    }

    fn turn(&mut self) -> Result<Progress> {
        let Questions(input, further) = &mut self.readers;
        loop {
            let next = if A::NEWEST_ONLY { input.newest()? } else { input.next_sample()? };
            let Some(sample) = next else {
                return Ok(self.runner.out.at);
            };
            let further = if self.runner.stage.has_answered(&sample) {
                A::Further::default()
            } else {
                A::Further::take_samples(further)?
            };
            self.runner.out.at = Progress::of(sample.stamp());
            if let Some(warning) = self.runner.take_entry(Sample(sample, further))? {
                tracing::warn!(tick = sample.stamp().tick, "{warning}");
            }
        }
    }
}
