//! The processes whose samples a reader returns. A stage and a supervisor admit the processes that the supervisor names as writers of
//! a topic, a consumer the newest generation.

use std::{cell::RefCell, collections::BTreeMap, fmt, rc::Rc};

use crate::{
    error::BusError,
    spec::{SUPERVISOR, Spec},
};

/// A process that writes a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Author {
    /// Its process number.
    pub process: u32,
    /// The generation in its stamps.
    pub generation: u32,
}

/// Samples of processes that should not write.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ignored {
    /// The number of samples.
    pub samples: u64,
    /// The process that wrote the last sample; 0 for none.
    pub process: u32,
}

/// Reads which processes the stages have; none if there is no newer list since the last call.
pub type Names = Box<dyn FnMut() -> Result<Option<Vec<(String, Author)>>, BusError>>;

/// The processes that may write, for all readers of a process.
#[derive(Clone, Default)]
pub struct Writers(Rc<RefCell<Named>>);

#[derive(Default)]
struct Named {
    supervisor: u32,
    stages: BTreeMap<String, Author>,
    source: Option<Names>,
    ignored: Ignored,
}

impl fmt::Debug for Writers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Writers").field("stages", &self.0.borrow().stages).finish_non_exhaustive()
    }
}

impl Writers {
    /// Only the process `supervisor` may write, until stages are named.
    pub(crate) fn of(supervisor: u32) -> Self {
        Self(Rc::new(RefCell::new(Named { supervisor, ..Named::default() })))
    }

    /// Name the processes of stages. A stage that is not listed keeps the process that it had.
    pub fn name(&self, stages: impl IntoIterator<Item = (String, Author)>) {
        self.0.borrow_mut().stages.extend(stages);
    }

    /// Read the names from `source`, whenever a process writes that is not named.
    pub fn read_from(&self, source: Names) {
        self.0.borrow_mut().source = Some(source);
    }

    /// The samples that all readers of this process ignored.
    #[must_use]
    pub fn ignored(&self) -> Ignored {
        self.0.borrow().ignored
    }

    fn supervisor(&self) -> u32 {
        self.0.borrow().supervisor
    }

    /// The process of `stage`, by the newest list.
    fn process_of(&self, stage: &str) -> Result<Option<Author>, BusError> {
        // The source is a reader of this bus, which asks for the supervisor's process.
        let mut source = self.0.borrow_mut().source.take();
        let newest = source.as_mut().map_or(Ok(None), |source| source());
        let mut named = self.0.borrow_mut();
        named.source = source;
        named.stages.extend(newest?.unwrap_or_default());
        Ok(named.stages.get(stage).copied())
    }

    fn ignore(&self, process: u32) {
        let ignored = &mut self.0.borrow_mut().ignored;
        ignored.samples += 1;
        ignored.process = process;
    }
}

/// The authors whose samples a reader returns.
#[derive(Debug)]
pub(crate) enum Admitted {
    /// All authors: several processes write the topic at a time.
    All,
    /// The newest generation, and the generation that was newest so far.
    Newest(u32),
    /// The process that is named.
    Named(OneStage),
}

/// The process of one stage.
#[derive(Debug)]
pub(crate) struct OneStage {
    writers: Writers,
    stage: &'static str,
    process: Option<Author>,
    /// It is admitted until the first sample of `process` comes.
    before: Option<Author>,
    /// The newest generation that the supervisor's process published on the topic: it may play a recording.
    played: u32,
}

impl Admitted {
    /// The authors of a topic for a process that knows the `writers`, or for a consumer.
    pub(crate) fn of(spec: &Spec, writers: Option<&Writers>) -> Self {
        match writers {
            _ if !spec.has_one_writer() => Self::All,
            None => Self::Newest(0),
            Some(writers) => Self::Named(OneStage {
                writers: writers.clone(),
                stage: spec.writer,
                process: None,
                before: None,
                played: 0,
            }),
        }
    }

    /// Whether a sample of `author` is returned. Samples of older generations are dropped, because their process has ended.
    pub(crate) fn admits(&mut self, author: Author) -> Result<bool, BusError> {
        match self {
            Self::All => Ok(true),
            Self::Newest(newest) => Ok(is_newest(author, newest)),
            Self::Named(one) => one.admits(author),
        }
    }
}

fn is_newest(author: Author, newest: &mut u32) -> bool {
    let new = author.generation >= *newest;
    *newest = author.generation.max(*newest);
    new
}

impl OneStage {
    fn admits(&mut self, author: Author) -> Result<bool, BusError> {
        if author.process == self.writers.supervisor() {
            return Ok(is_newest(author, &mut self.played));
        }
        let known = [self.process, self.before].contains(&Some(author));
        if !known && self.stage != SUPERVISOR {
            let named = self.writers.process_of(self.stage)?;
            if named.is_some() && named != self.process {
                self.before = std::mem::replace(&mut self.process, named);
            }
        }
        if self.process == Some(author) {
            self.before = None;
            return Ok(true);
        }
        let admitted = self.before == Some(author);
        let foreign = self.process.is_some_and(|now| author.generation >= now.generation);
        if foreign && !admitted {
            self.writers.ignore(author.process);
        }
        Ok(admitted)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Limits, Logged, Rate};

    static SPEC: Spec = Spec {
        name: "pose",
        writer: "stage",
        rate: Rate::EachTick,
        logged: Logged::Yes,
        limits: Limits::SMALL,
        meaning: "",
    };

    const fn author(process: u32, generation: u32) -> Author {
        Author { process, generation }
    }

    #[test]
    fn only_the_named_process_is_admitted_and_its_predecessor_until_it_writes() {
        let writers = Writers::of(1);
        let mut admitted = Admitted::of(&SPEC, Some(&writers));
        let mut admits = |author| admitted.admits(author).unwrap();
        assert!(!admits(author(7, 1)), "nobody is named");
        writers.name([("stage".to_owned(), author(7, 1))]);
        assert!(admits(author(7, 1)));
        assert!(!admits(author(66, u32::MAX)), "a forged generation");
        assert!(admits(author(7, 1)));
        writers.name([("stage".to_owned(), author(8, 2))]);
        assert!(admits(author(7, 1)), "its successor has not written yet");
        assert!(admits(author(8, 2)));
        assert!(!admits(author(7, 1)));
        assert_eq!(writers.ignored(), Ignored { samples: 1, process: 66 });
    }

    #[test]
    fn a_supervisor_that_plays_a_recording_is_admitted() {
        let mut admitted = Admitted::of(&SPEC, Some(&Writers::of(1)));
        let played = [author(1, 1), author(1, 2), author(1, 1)];
        assert_eq!(played.map(|author| admitted.admits(author).unwrap()), [true, true, false]);
    }
}
