//! Description of a topic in the table of topics.

use std::time::Duration;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rate {
    /// Once per tick, again for a tick repeated without a command, and completely for a new reader
    /// if samples carry only changes.
    EachTick,
    /// After each robot frame that contains it, about once per tick. The link publishes it when
    /// idle, and only the newest of several pending frames.
    EachFrame,
    /// At every change, and again without changes for late readers. The writer checks once per loop
    /// iteration, so a long iteration delays it.
    OnChange {
        /// Window in which changes are merged; zero publishes each at once.
        at_most_every: Duration,
        /// Time after the last sample, or the last complete one if samples carry only changes.
        again_after: Duration,
    },
    WhenItHappens,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Logged {
    Yes,
    /// Duplicate of another topic.
    No,
    /// Recorded only with fields, which take more space than all other topics together.
    WithFields,
}

#[derive(Debug)]
pub struct Spec {
    pub name: &'static str,
    /// Writer: a stage, [`SUPERVISOR`], [`OPERATOR`] or [`EVERY_STAGE`].
    pub writer: &'static str,
    pub rate: Rate,
    pub logged: Logged,
    pub limits: Limits,
    pub meaning: &'static str,
}

pub const EVERY_STAGE: &str = "every stage";
/// Writer of operator topics. Each operator command is a separate process.
pub const OPERATOR: &str = "operator";
pub const SUPERVISOR: &str = "supervisor";

impl Spec {
    /// Returns the republishing interval of an unchanged topic; zero if none.
    pub const fn restated_every(&self) -> Duration {
        if let Rate::OnChange { again_after, .. } = self.rate {
            again_after
        } else {
            Duration::ZERO
        }
    }

    /// Returns the least interval of published changes; zero if none.
    pub const fn changes_at_most_every(&self) -> Duration {
        match self.rate {
            Rate::OnChange { at_most_every, .. } => at_most_every,
            _ => Duration::ZERO,
        }
    }

    /// Returns whether at most one process at a time writes the topic.
    pub fn has_one_writer(&self) -> bool {
        ![EVERY_STAGE, OPERATOR].contains(&self.writer)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Samples buffered for a reader; beyond this the oldest are dropped.
    pub buffer: usize,
    pub recorder_buffer: usize,
    /// Samples that a reader may hold at once.
    pub borrowed: usize,
    /// Concurrent readers: stages, displays and recorders. Consumers leave three places free.
    pub readers: usize,
    /// Most elements of a slice, unless its writer states fewer.
    pub longest: usize,
}

impl Limits {
    pub const SMALL: Self =
        Self { buffer: 128, recorder_buffer: 1024, borrowed: 2, readers: 16, longest: usize::MAX };
    /// Limits for topics that a replay needs without gaps, even if a recorder is not scheduled for
    /// 0.1 s.
    pub const DEEP: Self = Self { buffer: 1024, borrowed: 2, readers: 8, ..Self::SMALL };
    pub const MAP: Self = Self { buffer: 4, recorder_buffer: 256, readers: 24, ..Self::SMALL };
    pub const WHOLE_MAP: Self = Self { recorder_buffer: 8, ..Self::MAP };

    pub const fn slices(longest: usize) -> Self {
        Self { longest, ..Self::SMALL }
    }

    /// Concurrent writers. One suffices, but a process killed at its start may occupy a place
    /// forever.
    pub(super) const WRITERS: usize = 16;
    /// Concurrent listeners. Many consumers listen to the last topic of a tick and then read the
    /// others.
    pub(super) const LISTENERS: usize = 48;
    /// Places that consumers leave free for successors of ended stages.
    pub(super) const KEPT_FREE: usize = 3;
    /// Processes that may have a topic open at once.
    pub(super) const NODES: usize = 64;
}
