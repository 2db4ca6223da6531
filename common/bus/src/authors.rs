//! Authorship of samples: a reader returns those of the processes that the supervisor names as a
//! topic's writers.

use std::{
    cell::RefCell,
    collections::{BTreeMap, VecDeque},
    fmt,
    rc::Rc,
    time::{Duration, Instant},
};

use crate::{
    error::Result,
    spec::{SUPERVISOR, Spec},
};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Author {
    pub process: u32,
    pub generation: u32,
}

/// Dropped samples of unauthorised processes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ignored {
    pub samples: u64,
    /// 0 for none.
    pub process: u32,
}

/// Source of the stages' processes; `None` without a newer list since the last call.
pub type Names = Box<dyn FnMut() -> Result<Option<Vec<(String, Author)>>>>;

/// Remembered processes per stage. A recorder still takes samples of ended ones.
const REMEMBERED: usize = 64;

#[derive(Clone, Default)]
pub struct Writers(Rc<RefCell<Named>>);

#[derive(Default)]
struct Named {
    supervisor: u32,
    /// Processes of each stage, the newest last.
    stages: BTreeMap<String, VecDeque<Author>>,
    source: Option<Names>,
    /// Samples of stages wait until then for the first list.
    names_come_by: Option<Instant>,
    ignored: Ignored,
}

impl Named {
    fn name(&mut self, stages: impl IntoIterator<Item = (String, Author)>) {
        for (stage, author) in stages {
            let known = self.stages.entry(stage).or_default();
            if known.back() != Some(&author) {
                known.retain(|other| *other != author);
                known.push_back(author);
                if known.len() > REMEMBERED {
                    known.pop_front();
                }
                assert!(known.len() <= REMEMBERED && known.back() == Some(&author));
            }
        }
    }
}

impl fmt::Debug for Writers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Writers").field("stages", &self.0.borrow().stages).finish_non_exhaustive()
    }
}

impl Writers {
    pub fn of(supervisor: u32) -> Self {
        Self(Rc::new(RefCell::new(Named { supervisor, ..Named::default() })))
    }

    /// An unlisted stage keeps its process.
    pub fn name(&self, stages: impl IntoIterator<Item = (String, Author)>) {
        self.0.borrow_mut().name(stages);
    }

    /// Reads names from `source` whenever an unnamed process writes.
    pub fn read_from(&self, source: Names) {
        self.0.borrow_mut().source = Some(source);
    }

    /// Holds samples of stages until the source has a list. Without one after `patience`, as with a
    /// frozen supervisor, readers meanwhile return the newest generation.
    pub fn wait_for_names(&self, patience: Duration) {
        self.0.borrow_mut().names_come_by = Some(Instant::now() + patience);
    }

    pub fn ignored(&self) -> Ignored {
        self.0.borrow().ignored
    }

    fn supervisor(&self) -> u32 {
        self.0.borrow().supervisor
    }

    fn read_names(&self) -> Result {
        // The source is a reader of this bus and itself asks for the supervisor's process.
        let Some(mut source) = self.0.borrow_mut().source.take() else {
            return Ok(());
        };
        let names = source();
        let mut named = self.0.borrow_mut();
        named.source = Some(source);
        if let Some(names) = names? {
            named.names_come_by = None;
            named.name(names);
        }
        Ok(())
    }

    fn process_of(&self, stage: &str) -> Result<Option<Author>> {
        self.read_names()?;
        Ok(self.0.borrow().stages.get(stage).and_then(|known| known.back().copied()))
    }

    fn has_named(&self, stage: &str, author: Author) -> Result<bool> {
        let named =
            || self.0.borrow().stages.get(stage).is_some_and(|known| known.contains(&author));
        if !named() {
            self.read_names()?;
        }
        Ok(named())
    }

    fn names_are_awaited(&self) -> bool {
        self.0.borrow().names_come_by.is_some()
    }

    fn hold_samples(&self) -> Result<bool> {
        if self.names_are_awaited() {
            self.read_names()?;
        }
        Ok(self.0.borrow().names_come_by.is_some_and(|time| Instant::now() < time))
    }

    fn ignore(&self, process: u32) {
        let ignored = &mut self.0.borrow_mut().ignored;
        ignored.samples += 1;
        ignored.process = process;
    }
}

/// Authors whose samples a reader returns.
#[derive(Debug)]
pub struct Admitted {
    authors: Authors,
    /// Also admits older generations and formerly named processes.
    all_generations: bool,
}

#[derive(Debug)]
enum Authors {
    /// All authors, for topics with several concurrent writers.
    All,
    /// Newest generation so far, where no process names authors.
    Newest(u32),
    /// Supervisor's process and its newest generation. It holds no [`Writers`]: their source is a
    /// reader of the roster, and the ownership cycle would keep its place on the bus forever.
    Supervisor(u32, u32),
    Named(OneStage),
}

#[derive(Debug)]
struct OneStage {
    writers: Writers,
    stage: &'static str,
    process: Option<Author>,
    /// Earlier process, admitted until the first sample of `process`.
    before: Option<Author>,
    /// Newest generation that the supervisor published on the topic, because it may play a
    /// recording, or that any process published before the first name.
    newest: u32,
}

impl Admitted {
    /// Returns a topic's authors; `writers` is `None` for a process without names.
    pub fn of(spec: &Spec, writers: Option<&Writers>) -> Self {
        let authors = match writers {
            _ if !spec.has_one_writer() => Authors::All,
            None => Authors::Newest(0),
            Some(writers) if spec.writer == SUPERVISOR => {
                Authors::Supervisor(writers.supervisor(), 0)
            }
            Some(writers) => Authors::Named(OneStage {
                writers: writers.clone(),
                stage: spec.writer,
                process: None,
                before: None,
                newest: 0,
            }),
        };
        Self { authors, all_generations: false }
    }

    pub(crate) fn of_all_generations(self) -> Self {
        Self { all_generations: true, ..self }
    }

    pub(crate) fn hold_samples(&self) -> Result<bool> {
        match &self.authors {
            Authors::Named(one) => one.writers.hold_samples(),
            _ => Ok(false),
        }
    }

    /// Returns whether to return a sample of `author`. The process of an older generation has
    /// ended.
    pub fn admits(&mut self, author: Author) -> Result<bool> {
        let all = self.all_generations;
        match &mut self.authors {
            Authors::All => Ok(true),
            Authors::Newest(newest) => Ok(is_newest(author, newest) || all),
            Authors::Supervisor(process, newest) => {
                Ok(author.process == *process && (is_newest(author, newest) || all))
            }
            Authors::Named(one) => one.admits(author, all),
        }
    }
}

fn is_newest(author: Author, newest: &mut u32) -> bool {
    let new = author.generation >= *newest;
    *newest = author.generation.max(*newest);
    new
}

impl OneStage {
    fn admits(&mut self, author: Author, all_generations: bool) -> Result<bool> {
        let by_supervisor = author.process == self.writers.supervisor();
        if by_supervisor || self.writers.names_are_awaited() {
            return Ok(is_newest(author, &mut self.newest) || all_generations);
        }
        if all_generations {
            let named = self.writers.has_named(self.stage, author)?;
            if !named {
                self.writers.ignore(author.process);
            }
            return Ok(named);
        }
        if ![self.process, self.before].contains(&Some(author)) {
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
        // No author is named.
        assert!(!admits(author(7, 1)));
        writers.name([("stage".to_owned(), author(7, 1))]);
        assert!(admits(author(7, 1)));
        // A forged generation.
        assert!(!admits(author(66, u32::MAX)));
        assert!(admits(author(7, 1)));
        writers.name([("stage".to_owned(), author(8, 2))]);
        // Its successor has not written yet.
        assert!(admits(author(7, 1)));
        assert!(admits(author(8, 2)));
        assert!(!admits(author(7, 1)));
        assert_eq!(writers.ignored(), Ignored { samples: 1, process: 66 });
    }

    #[test]
    fn a_recorder_admits_every_process_that_was_named_and_no_other() {
        let writers = Writers::of(1);
        writers.name([("stage".to_owned(), author(7, 1))]);
        writers.name([("stage".to_owned(), author(8, 2))]);
        let mut admitted = Admitted::of(&SPEC, Some(&writers)).of_all_generations();
        let authors =
            [author(8, 2), author(7, 1), author(66, u32::MAX), author(66, 1), author(8, 2)];
        let admits = authors.map(|author| admitted.admits(author).unwrap());
        assert_eq!(admits, [true, true, false, false, true]);
    }

    #[test]
    fn samples_wait_for_the_first_names_and_a_forged_one_before_them_hides_none_after_them() {
        let writers = Writers::of(1);
        let come = Rc::new(RefCell::new(None));
        let names = Rc::clone(&come);
        writers.read_from(Box::new(move || Ok(names.borrow_mut().take())));
        writers.wait_for_names(Duration::from_secs(3600));
        let mut admitted = Admitted::of(&SPEC, Some(&writers));
        assert!(admitted.hold_samples().unwrap());
        writers.wait_for_names(Duration::ZERO);
        // No names came in time.
        assert!(!admitted.hold_samples().unwrap());
        assert!(admitted.admits(author(66, u32::MAX)).unwrap());
        assert!(!admitted.admits(author(7, 1)).unwrap());
        *come.borrow_mut() = Some(vec![("stage".to_owned(), author(7, 1))]);
        assert!(!admitted.hold_samples().unwrap());
        assert!(admitted.admits(author(7, 1)).unwrap());
        assert!(!admitted.admits(author(66, u32::MAX)).unwrap());
    }

    #[test]
    fn a_reader_of_the_supervisors_words_may_be_the_source_of_the_names_and_is_dropped_with_them() {
        let writers = Writers::of(1);
        let roster = Spec { writer: SUPERVISOR, ..SPEC };
        let mut admitted = Admitted::of(&roster, Some(&writers));
        let admits = [author(66, 9), author(1, 0), author(1, 0)];
        assert_eq!(admits.map(|author| admitted.admits(author).unwrap()), [false, true, true]);
        let dropped = Rc::new(());
        let held = (admitted, Rc::clone(&dropped));
        writers.read_from(Box::new(move || {
            let _ = &held;
            Ok(None)
        }));
        drop(writers);
        assert_eq!(Rc::strong_count(&dropped), 1);
    }

    #[test]
    fn a_supervisor_that_plays_a_recording_is_admitted() {
        let mut admitted = Admitted::of(&SPEC, Some(&Writers::of(1)));
        let played = [author(1, 1), author(1, 2), author(1, 1)];
        assert_eq!(played.map(|author| admitted.admits(author).unwrap()), [true, true, false]);
    }
}
