//! A stage and its runner: what is common to the process and the replay of every stage, once.
//!
//! A [`Stage`] takes entries and gives outputs. Its process reads topics and makes entries of what came; a replay reads the
//! same entries from a recording. Both hand them to [`Stage::take`], so a replay computes what the process published.
//!
//! A stage that answers each sample of one topic with a sample of another is an [`Answering`] step, and nothing else. It may take
//! what came on further topics with the sample.

use std::fmt::Debug;

use serde::{Deserialize, Serialize, de::DeserializeOwned};

use crate::{
    bus::{Layout, Reader, Stamped, Topic},
    clock::MissionTime,
    inputs,
    mission::Mission,
    outputs::Outputs,
    replay::{Beginning, Output, Replay, ReplayError, entry},
    shell::{Context, Process, Progress},
    start::StageError,
    step::{ForeignState, Step},
    wiring::{Persists, Topics, Wiring},
};

/// A stage around its step. A process and a replay run the same one.
pub trait Stage: Sized + 'static {
    /// The state that a generation starts from.
    type Start: Serialize + DeserializeOwned;
    /// The input of one call of the step. A recording holds it in this encoding.
    type Entry<'a>: Serialize + Deserialize<'a> + Debug;
    /// The result of an entry for the process, besides the outputs.
    type Outcome;

    /// The stage at the start of `mission`.
    fn new(mission: &Mission) -> Self;

    /// Open the file that the stage persists its state in, and give the state that its process starts from.
    fn start(&self, context: &mut Context) -> Result<Self::Start, StageError>;

    /// Go on from `start`.
    fn begin(&mut self, start: Self::Start) -> Result<(), ForeignState>;

    /// Step with `entry`, persist and publish. Sets [`Outputs::at`] if the entry says of which tick it is.
    fn take(
        &mut self,
        entry: Self::Entry<'_>,
        out: &mut Outputs,
    ) -> Result<Self::Outcome, StageError>;

    /// Publish outputs that no stage waits for. A process calls this in a pause, a replay after each entry.
    fn publish_rest(&mut self, out: &mut Outputs) -> Result<(), StageError> {
        let _ = out;
        Ok(())
    }

    /// The entry in words.
    fn describe(entry: &Self::Entry<'_>) -> String {
        format!("{entry:?}")
    }
}

/// The stage in its process.
pub struct Runner<S> {
    pub stage: S,
    pub out: Outputs,
}

impl<S: Stage> Runner<S> {
    /// Open the topics that the stage writes, restore its state, and go on from there. A slice that it publishes has at most
    /// `longest` elements.
    pub fn open(
        context: &mut Context,
        longest: impl FnOnce(&S) -> usize,
    ) -> Result<Self, StageError> {
        let mut stage = S::new(&context.run.mission);
        let start = stage.start(context)?;
        let out = Outputs::of_process(context, &start, longest(&stage))?;
        if let Err(foreign) = stage.begin(start) {
            tracing::warn!("{foreign}");
        }
        Ok(Self { stage, out })
    }

    /// Open the topics that follow each frame of the robot: to be called after the first heartbeat that says ready.
    pub fn open_late(&mut self, context: &mut Context) -> Result<(), StageError> {
        self.out.open_late(context)
    }

    /// Note `entry` for a replay, and let the stage take it.
    pub fn take(&mut self, entry: S::Entry<'_>) -> Result<S::Outcome, StageError> {
        self.out.note(&entry)?;
        self.stage.take(entry, &mut self.out)
    }

    /// Publish outputs that no stage waits for.
    pub fn publish_rest(&mut self) -> Result<(), StageError> {
        self.stage.publish_rest(&mut self.out)
    }
}

/// One generation, fed from a recording.
struct Generation<S> {
    stage: S,
    out: Outputs,
}

/// Begin the replay of a generation.
pub fn replay<S: Stage>(beginning: Beginning<'_>) -> Result<Box<dyn Replay>, ReplayError> {
    let mut stage = S::new(&beginning.run.mission);
    // A stage that persists nothing starts from an entry without bytes.
    if !beginning.start.is_empty() {
        // The process ignored a foreign state, too.
        let _ = stage.begin(entry(beginning.start)?);
    }
    let out = Outputs::of_replay(beginning.fields);
    Ok(Box::new(Generation { stage, out }))
}

impl<S: Stage> Replay for Generation<S> {
    fn take(&mut self, body: &[u8]) -> Result<Vec<Output>, ReplayError> {
        let Self { stage, out } = self;
        let taken = stage.take(entry(body)?, out);
        taken
            .and_then(|_| stage.publish_rest(out))
            .map_err(|error| ReplayError::Stage(error.to_string()))?;
        Ok(out.drain())
    }

    fn describe(&self, body: &[u8]) -> Result<String, ReplayError> {
        Ok(S::describe(&entry(body)?))
    }
}

/// A stage that answers each sample of one topic with a sample of another.
pub trait Answering: Step<State: Clone + Debug> + 'static {
    type In: Stamped;
    type Out: Stamped;
    /// The samples of further topics that it takes with a sample of its input; `()` for none.
    type Further: Further;
    const NAME: &'static str;
    const INPUT: &'static Topic<Self::In>;
    const OUTPUT: &'static Topic<Self::Out>;
    const PERSISTS: Persists = Persists::Nothing;
    /// Whether the stage skips samples that are not the newest.
    const NEWEST_ONLY: bool = false;

    /// Take one sample.
    fn answer(
        &mut self,
        input: &Self::In,
        further: &Self::Further,
        now: MissionTime,
    ) -> Answer<Self::Out>;
}

/// The samples of further topics that came before a sample of an [`Answering`] stage's input. They wake nobody, and the entry
/// contains them, so a replay takes them with the same sample.
pub trait Further: Serialize + DeserializeOwned + Debug + 'static {
    const TOPICS: Topics;
    type Readers;

    fn open(context: &mut Context) -> Result<Self::Readers, StageError>;

    /// Take what came, and no more than a bounded number of samples.
    fn take(readers: &mut Self::Readers) -> Result<Self, StageError>;
}

impl Further for () {
    const TOPICS: Topics = &[];
    type Readers = ();

    fn open(_: &mut Context) -> Result<(), StageError> {
        Ok(())
    }

    fn take((): &mut ()) -> Result<(), StageError> {
        Ok(())
    }
}

/// The answer to one sample.
#[derive(Clone, Copy, Debug)]
pub struct Answer<P> {
    pub sample: P,
    /// Whether the state is saved before the sample is published. Otherwise no tick waits for the file.
    pub saves_first: bool,
    /// A warning for the log of the process.
    pub warning: Option<&'static str>,
}

impl<P> From<P> for Answer<P> {
    fn from(sample: P) -> Self {
        Self { sample, saves_first: true, warning: None }
    }
}

/// The entry of an [`Answering`] stage.
#[derive(Debug, Serialize, Deserialize)]
#[serde(bound = "P: Layout, F: Further")]
pub struct Sample<P: Layout, F>(#[serde(with = "inputs::sample")] P, F);

impl<A: Answering> Stage for A {
    type Start = Option<A::State>;
    type Entry<'a> = Sample<A::In, A::Further>;
    type Outcome = Option<&'static str>;

    fn new(mission: &Mission) -> Self {
        Step::new(mission)
    }

    fn start(&self, context: &mut Context) -> Result<Self::Start, StageError> {
        let saved: Self::Start = context.saved_state()?;
        if let Some(state) = &saved {
            tracing::info!(?state, "the state is restored");
        }
        Ok(saved)
    }

    fn begin(&mut self, start: Self::Start) -> Result<(), ForeignState> {
        start.map_or(Ok(()), |state| self.restore(state))
    }

    fn take(
        &mut self,
        Sample(input, further): Sample<A::In, A::Further>,
        out: &mut Outputs,
    ) -> Result<Self::Outcome, StageError> {
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
        match A::Further::TOPICS.is_empty() {
            true => format!("{name} {input:?}"),
            false => format!("{name} {input:?} with {further:?}"),
        }
    }
}

/// The process of an [`Answering`] stage.
pub struct Answers<A: Answering> {
    runner: Runner<A>,
    input: Reader<A::In>,
    further: <A::Further as Further>::Readers,
}

impl<A: Answering> Process for Answers<A> {
    const WIRING: &'static Wiring = &Wiring {
        inputs: &[A::INPUT],
        feedback: A::Further::TOPICS,
        wakes: &[A::INPUT],
        outputs: &[A::OUTPUT],
        persists: A::PERSISTS,
        ..Wiring::of(A::NAME)
    };

    fn open(context: &mut Context) -> Result<Self, StageError> {
        Ok(Self {
            runner: Runner::open(context, |_| 0)?,
            input: context.reader(A::INPUT)?,
            further: A::Further::open(context)?,
        })
    }

    fn turn(&mut self) -> Result<Progress, StageError> {
        loop {
            let next = match A::NEWEST_ONLY {
                true => self.input.newest()?,
                false => self.input.next_sample()?,
            };
            let Some(input) = next else {
                return Ok(self.runner.out.at);
            };
            let further = A::Further::take(&mut self.further)?;
            self.runner.out.at = Progress::of(input.stamp());
            if let Some(warning) = self.runner.take(Sample(input, further))? {
                tracing::warn!(tick = input.stamp().tick, "{warning}");
            }
        }
    }
}
