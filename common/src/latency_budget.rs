//! The time that a stage's process spends on its part of a tick, item by item, for `firsthand bench tick --budget`. Without
//! [`ASKED_FOR`] in the environment nothing is measured and no clock is read.
//!
//! The stage's shell says when each item ends. The times stay in memory, and go into a file of the run's directory when
//! the process stops. The monotonic clock is the machine's: from one stage's [`TickTimes::published_ns`] to the next one's
//! [`TickTimes::awake_ns`] is what it takes to wake a process.

use std::{
    cell::RefCell, env, fmt, fs, io, num::ParseIntError, path::Path, path::PathBuf, rc::Rc,
    str::FromStr,
};

use crate::clock::monotonic_ns;

/// The environment variable that asks for measurements; its value does not matter.
pub const ASKED_FOR: &str = "FIRSTHAND_LATENCY_BUDGET";

/// The times of at most so many ticks are stored, 72 bytes each.
const MOST_TICKS: usize = 1 << 16;

/// An item of a tick, in the order of the columns of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Item {
    /// Taking samples from the bus, or bytes from the socket.
    Read,
    /// The pure step.
    Step,
    /// Inputs, checkpoint and journal, for a successor or a replay; before the output is published.
    Persist,
    /// The output, until its readers are about to be woken.
    Publish,
    /// Everything from then until the process waits again: it wakes the readers, and does what nobody waits for.
    After,
}

impl Item {
    pub const ALL: [Self; 5] = [Self::Read, Self::Step, Self::Persist, Self::Publish, Self::After];

    /// The heading of its column.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Read => "read",
            Self::Step => "step",
            Self::Persist => "persist",
            Self::Publish => "publish",
            Self::After => "after",
        }
    }
}

/// The input that an output answers. A tick goes twice through a stage that has feedback.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Answers {
    /// An input of the stage.
    Inputs,
    /// The feedback of the stage, with which the tick ends.
    Feedback,
}

/// One tick's way through a stage, once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TickTimes {
    pub tick: u64,
    pub answers: Answers,
    /// When the process was awake, on the monotonic clock.
    pub awake_ns: u64,
    /// When the output was published and its readers were about to be woken.
    pub published_ns: u64,
    /// Nanoseconds by [`Item`].
    pub items_ns: [u64; Item::ALL.len()],
}

/// Tells the items of a stage's process apart. Clones share what they measure.
#[derive(Clone, Debug, Default)]
pub struct LatencyBudget(Option<Rc<RefCell<Stopwatch>>>);

#[derive(Debug, Default)]
struct Stopwatch {
    awake_ns: u64,
    /// When the last item ended.
    last_ns: u64,
    /// Nanoseconds by item for the output that is not published yet.
    items_ns: [u64; Item::ALL.len()],
    /// Whether an output was published since the process last waited.
    published: bool,
    ticks: Vec<TickTimes>,
}

impl LatencyBudget {
    /// Measures if the environment asks for it.
    pub fn from_environment() -> Self {
        if env::var_os(ASKED_FOR).is_some() { Self::measuring() } else { Self::default() }
    }

    fn measuring() -> Self {
        let stopwatch = Stopwatch { ticks: Vec::with_capacity(MOST_TICKS), ..Stopwatch::default() };
        Self(Some(Rc::new(RefCell::new(stopwatch))))
    }

    /// The process is awake: its next output's items begin here.
    pub fn awake(&self) {
        self.measure(Stopwatch::awake);
    }

    /// `item` ends here, and another one begins.
    pub fn end(&self, item: Item) {
        self.measure(|stopwatch, now_ns| stopwatch.end(item, now_ns));
    }

    /// The output of `tick` is published; its readers are woken next.
    pub fn published(&self, tick: u64, answers: Answers) {
        self.measure(|stopwatch, now_ns| stopwatch.published(tick, answers, now_ns));
    }

    /// The process is about to wait.
    pub fn waits(&self) {
        self.measure(Stopwatch::waits);
    }

    fn measure(&self, what: impl FnOnce(&mut Stopwatch, u64)) {
        // The stopwatch is never borrowed already: no caller measures inside a measurement.
        if let Some(stopwatch) = &self.0
            && let Ok(mut stopwatch) = stopwatch.try_borrow_mut()
        {
            what(&mut stopwatch, monotonic_ns());
        }
    }

    /// Write what was measured into `file`, if anything was asked for.
    pub fn save(&self, file: &Path) -> io::Result<()> {
        let Some(stopwatch) = &self.0 else {
            return Ok(());
        };
        let stopwatch = stopwatch.borrow();
        let lines = stopwatch.ticks.iter().map(|ticks| format!("{ticks}\n"));
        fs::write(file, lines.collect::<String>())
    }
}

impl Stopwatch {
    fn awake(&mut self, now_ns: u64) {
        self.end_after(now_ns);
        self.awake_ns = now_ns;
        self.last_ns = now_ns;
        self.items_ns = [0; Item::ALL.len()];
    }

    fn waits(&mut self, now_ns: u64) {
        self.end_after(now_ns);
        self.published = false;
    }

    /// The time since the last output belongs to that output.
    fn end_after(&mut self, now_ns: u64) {
        if self.published {
            self.end(Item::After, now_ns);
        }
    }

    fn end(&mut self, item: Item, now_ns: u64) {
        let took_ns = now_ns.saturating_sub(self.last_ns);
        self.last_ns = now_ns;
        let items = match self.ticks.last_mut() {
            Some(published) if item == Item::After => &mut published.items_ns,
            _ => &mut self.items_ns,
        };
        items[item as usize] += took_ns;
    }

    fn published(&mut self, tick: u64, answers: Answers, now_ns: u64) {
        // Nobody waits for an output that is published again.
        let last = self.ticks.last();
        if last.is_some_and(|last| (last.tick, last.answers) == (tick, answers)) {
            self.end(Item::After, now_ns);
            return;
        }
        self.end(Item::Publish, now_ns);
        if self.ticks.len() < MOST_TICKS {
            self.ticks.push(TickTimes {
                tick,
                answers,
                awake_ns: self.awake_ns,
                published_ns: now_ns,
                items_ns: self.items_ns,
            });
        }
        // Another tick in the same turn begins where this one ended.
        self.awake(now_ns);
        self.published = true;
    }
}

/// Where the process of generation `number` of `stage` saves its times in the run's `directory`.
pub fn file(directory: &Path, stage: &str, number: u32) -> PathBuf {
    directory.join(format!("{stage}.{number}.budget"))
}

impl fmt::Display for TickTimes {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        let answers = match self.answers {
            Answers::Inputs => INPUTS,
            Answers::Feedback => FEEDBACK,
        };
        write!(to, "{} {answers} {} {}", self.tick, self.awake_ns, self.published_ns)?;
        self.items_ns.iter().try_for_each(|ns| write!(to, " {ns}"))
    }
}

const INPUTS: &str = "inputs";
const FEEDBACK: &str = "feedback";

/// A line of a file of times that is wrong.
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
#[error("{0:?} is no line of times; measure again with this version of firsthand")]
pub struct TickTimesError(String);

impl FromStr for TickTimes {
    type Err = TickTimesError;

    fn from_str(line: &str) -> Result<Self, TickTimesError> {
        let parse = || {
            let mut words = line.split(' ');
            let number = |words: &mut std::str::Split<'_, char>| words.next()?.parse().ok();
            let tick = number(&mut words)?;
            let answers = match words.next()? {
                INPUTS => Answers::Inputs,
                FEEDBACK => Answers::Feedback,
                _ => return None,
            };
            let (awake_ns, published_ns) = (number(&mut words)?, number(&mut words)?);
            let items: Result<Vec<u64>, ParseIntError> = words.map(str::parse).collect();
            Some(Self {
                tick,
                answers,
                awake_ns,
                published_ns,
                items_ns: items.ok()?.try_into().ok()?,
            })
        };
        parse().ok_or_else(|| TickTimesError(line.chars().take(80).collect()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One tick of a stage that persists before and after it publishes.
    fn tick(stopwatch: &mut Stopwatch, tick: u64, began_ns: u64) {
        stopwatch.awake(began_ns);
        for (item, after_ns) in
            [(Item::Read, 3), (Item::Persist, 5), (Item::Step, 12), (Item::Persist, 13)]
        {
            stopwatch.end(item, began_ns + after_ns);
        }
        stopwatch.published(tick, Answers::Inputs, began_ns + 20);
        stopwatch.waits(began_ns + 50);
    }

    #[test]
    fn items_of_a_tick_add_up_from_awake_to_published_and_what_is_persisted_later_is_apart() {
        let mut stopwatch = Stopwatch::default();
        tick(&mut stopwatch, 7, 100);
        // A turn without an output, for a heartbeat.
        stopwatch.awake(1000);
        stopwatch.end(Item::Read, 1010);
        stopwatch.published(7, Answers::Inputs, 1012);
        tick(&mut stopwatch, 8, 2000);
        let [seventh, eighth] = stopwatch.ticks[..] else {
            panic!("{stopwatch:?}");
        };
        assert_eq!((seventh.tick, eighth.tick), (7, 8));
        assert_eq!((eighth.awake_ns, eighth.published_ns), (2000, 2020));
        assert_eq!(eighth.items_ns, [3, 7, 3, 7, 30]);
        assert_eq!(eighth.items_ns[..4].iter().sum::<u64>(), 20);
        assert_eq!(seventh.items_ns, [3, 7, 3, 7, 32], "published again");
    }

    #[test]
    fn what_was_measured_is_read_back_and_other_lines_are_refused() {
        let directory = tempfile::tempdir().unwrap();
        let file = file(directory.path(), "mapper", 2);
        let budget = LatencyBudget::measuring();
        budget.awake();
        budget.end(Item::Step);
        budget.published(9, Answers::Feedback);
        budget.waits();
        budget.save(&file).unwrap();
        let text = fs::read_to_string(&file).unwrap();
        let read: TickTimes = text.trim_end().parse().unwrap();
        assert_eq!((read.tick, read.answers), (9, Answers::Feedback));
        assert!(read.published_ns >= read.awake_ns);
        let whole = text.trim_end();
        for bad in
            ["", "9", "9 sideways 1 2 3 4 5 6 7", "9 inputs 1 2 3 4 5 6 -7", &format!("{whole} 1")]
        {
            let said = bad.parse::<TickTimes>();
            assert!(said.is_err(), "{bad}: {said:?}");
        }
        // Without the request nothing is written.
        let unasked = directory.path().join("none");
        LatencyBudget::default().save(&unasked).unwrap();
        assert!(!unasked.exists());
    }
}
