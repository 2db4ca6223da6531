//! A live stage, in a process of its own, and the comparison of its samples with the recorded ones.

use std::{
    fs::{self, File},
    io,
    path::{Path, PathBuf},
    process::Stdio,
    time::Duration,
};

use common::{
    bus::{Bus, BusError, EncodedReader},
    run::Run,
    start::Generation,
    topics,
    waiter::Waiter,
};
use processes::{
    process::{self, ExitCause, Process},
    stages::Stage,
};

use super::{error::LiveError, report::LiveStageReport};
use crate::replay::samples::{COMPARED, First, difference, is_keyframe, tick_of};

/// Time between SIGTERM and SIGKILL to a stage.
const GRACE: Duration = Duration::from_secs(2);
/// Characters of the log of an ended stage that an error shows.
const LOG_TAIL: usize = 400;

pub(super) struct LiveStage {
    pub(super) stage: &'static Stage,
    process: Process,
    log: PathBuf,
    answers: Vec<Answers>,
}

/// The samples of the stage on one topic.
struct Answers {
    topic: &'static dyn topics::EncodedTopic,
    reader: Box<dyn EncodedReader>,
    /// The recorded sample of the current tick.
    recorded: Option<Vec<u8>>,
    /// The live sample of the newest tick.
    given: Option<Vec<u8>>,
    report: LiveStageReport,
    first: Option<First>,
}

impl LiveStage {
    /// Start `stage` of `run` in `directory`, on `bus`. `waiter` then wakes for its samples and for its end.
    pub(super) fn start(
        stage: &'static Stage,
        run: &Run,
        directory: &Path,
        bus: &Bus,
        waiter: &mut Waiter,
    ) -> Result<Self, LiveError> {
        let mut answers = Vec::new();
        for topic in topics::ENCODED {
            let is_compared =
                COMPARED.iter().any(|compared| compared.spec().name == topic.spec().name);
            if is_compared && topic.spec().writer == stage.name {
                waiter.on(bus.wakeup(*topic)?);
                answers.push(Answers {
                    topic: *topic,
                    reader: topic.encoded_reader(bus)?,
                    recorded: None,
                    given: None,
                    report: LiveStageReport::default(),
                    first: None,
                });
            }
        }
        let generation = Generation {
            stage: stage.name,
            directory: directory.to_path_buf(),
            number: 1,
            first_tick: 0,
        };
        let log = directory.join(format!("{}.log", stage.name));
        let failed = |source: io::Error| LiveError::Start { stage: stage.name, source };
        let mut command = process::stage(stage.executable(&run.mission), &generation);
        command.stdout(Stdio::null()).stderr(File::create(&log).map_err(failed)?);
        let process = Process::spawn(command).map_err(failed)?;
        waiter.on_readable(&process)?;
        Ok(Self { stage, process, log, answers })
    }

    /// The cause of its end, and the end of its log; none while it runs.
    pub(super) fn ended(&mut self) -> io::Result<Option<(ExitCause, String)>> {
        let Some(cause) = self.process.try_reap()? else {
            return Ok(None);
        };
        let log = fs::read_to_string(&self.log).unwrap_or_default();
        let start = log.len().saturating_sub(LOG_TAIL);
        let tail = log.get(log.ceil_char_boundary(start)..).unwrap_or_default();
        Ok(Some((cause, tail.trim().to_owned())))
    }

    /// Take a recorded sample of the current tick. Returns whether the sample is this stage's.
    pub(super) fn recorded(&mut self, topic: &str, message: &[u8]) -> bool {
        let own = |answers: &&mut Answers| answers.topic.spec().name == topic;
        if let Some(answers) = self.answers.iter_mut().find(own) {
            if answers.is_answer(message) {
                answers.recorded = Some(message.to_vec());
            }
            return true;
        }
        let outputs = self.stage.wiring.outputs.iter();
        outputs.map(|output| output.spec().name).any(|name| name == topic)
    }

    /// Read the samples of the stage. Returns whether it has answered `tick` on every topic on which the recorded stage
    /// did.
    pub(super) fn has_answered(&mut self, tick: u64) -> Result<bool, BusError> {
        let mut all = true;
        for answers in &mut self.answers {
            answers.take()?;
            let given = answers.given.as_deref().map(tick_of);
            all &= answers.recorded.is_none() || given.is_some_and(|given| given >= tick);
        }
        Ok(all)
    }

    /// Compare the answers of `tick`, which is over.
    pub(super) fn compare(&mut self, tick: u64) {
        for answers in &mut self.answers {
            answers.compare(tick);
        }
    }

    /// The counts, and the first difference.
    pub(super) fn report(&self) -> (LiveStageReport, Option<First>) {
        let mut report = LiveStageReport::default();
        let mut first: Option<First> = None;
        for answers in &self.answers {
            report.answered += answers.report.answered;
            report.equal += answers.report.equal;
            report.unanswered += answers.report.unanswered;
            let earlier = |found: &&First| first.as_ref().is_none_or(|held| found.tick < held.tick);
            if let Some(found) = answers.first.as_ref().filter(earlier) {
                first = Some(found.clone());
            }
        }
        (report, first)
    }
}

impl Drop for LiveStage {
    fn drop(&mut self) {
        self.process.end(GRACE);
    }
}

impl Answers {
    /// Whether `message` answers a tick: a keyframe for new readers does not.
    fn is_answer(&self, message: &[u8]) -> bool {
        self.topic.layout().1.is_none() || !is_keyframe(message)
    }

    fn take(&mut self) -> Result<(), BusError> {
        loop {
            let mut message = Vec::new();
            if self.reader.take(&mut message)?.is_none() {
                return Ok(());
            }
            if self.is_answer(&message) {
                self.given = Some(message);
            }
        }
    }

    fn compare(&mut self, tick: u64) {
        let Some(recorded) = self.recorded.take() else {
            return;
        };
        let given = self.given.as_ref().filter(|given| tick_of(given) == tick);
        let Some(given) = given else {
            self.report.unanswered += 1;
            return;
        };
        self.report.answered += 1;
        match difference(self.topic, &recorded, given) {
            None => self.report.equal += 1,
            found => self.first = self.first.take().or(found),
        }
    }
}
