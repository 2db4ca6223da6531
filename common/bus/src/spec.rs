//! The description of a topic in the table of topics.

use std::time::Duration;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rate {
    /// Once a tick. It is published again for a tick that the link repeats because no command came, and completely for a new reader
    /// if samples carry only changes.
    EachTick,
    /// After each frame of the robot that contains it, about once a tick, whether the robot drives or not. It is published when the
    /// link has no other work; if several frames came by then, only the newest.
    EachFrame,
    /// At every change, and again when nothing changes, for readers that joined since. The writer checks the time once in each
    /// iteration of its loop, so a long iteration delays it.
    OnChange {
        /// Changes that follow each other sooner are published together. Zero publishes each at once.
        at_most_every: Duration,
        /// The time after the last sample, or after the last complete one if samples carry only changes.
        again_after: Duration,
    },
    WhenItHappens,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Logged {
    Yes,
    /// Another topic has the same.
    No,
    /// Only recordings with fields contain it, because fields take more space than all other topics together.
    WithFields,
}

#[derive(Debug)]
pub struct Spec {
    /// The name of the topic, and of its two services.
    pub name: &'static str,
    /// The writer: a stage, [`SUPERVISOR`], [`OPERATOR`] or [`EVERY_STAGE`].
    pub writer: &'static str,
    pub rate: Rate,
    pub logged: Logged,
    pub limits: Limits,
    pub meaning: &'static str,
}

pub const EVERY_STAGE: &str = "every stage";
/// The writer of topics that commands of an operator write, each in a process of its own.
pub const OPERATOR: &str = "operator";
pub const SUPERVISOR: &str = "supervisor";

impl Spec {
    /// The time after which its writer publishes the topic again if nothing changes; zero if it does not.
    pub const fn restated_every(&self) -> Duration {
        if let Rate::OnChange { again_after, .. } = self.rate {
            again_after
        } else {
            Duration::ZERO
        }
    }

    /// The least time between two changes that its writer publishes; zero if there is none.
    pub const fn changes_at_most_every(&self) -> Duration {
        match self.rate {
            Rate::OnChange { at_most_every, .. } => at_most_every,
            _ => Duration::ZERO,
        }
    }

    /// Whether at most one process at a time writes the topic.
    pub(super) fn has_one_writer(&self) -> bool {
        ![EVERY_STAGE, OPERATOR].contains(&self.writer)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Samples that wait for a reader; when there are more, the oldest are dropped.
    pub buffer: usize,
    /// Samples that wait for a recorder.
    pub recorder_buffer: usize,
    /// Samples that a reader may hold at once.
    pub borrowed: usize,
    /// Readers at once: stages, displays and recorders. Consumers leave three places free.
    pub readers: usize,
    /// The most elements of a slice, where its writer does not say fewer.
    pub longest: usize,
}

impl Limits {
    pub const SMALL: Self =
        Self { buffer: 128, recorder_buffer: 1024, borrowed: 2, readers: 16, longest: usize::MAX };
    /// The limits of topics that a replay needs without gaps. A recorder that is not scheduled for 0.1 s loses nothing.
    pub const DEEP: Self = Self { buffer: 1024, borrowed: 2, readers: 8, ..Self::SMALL };
    pub const MAP: Self = Self { buffer: 4, recorder_buffer: 256, readers: 24, ..Self::SMALL };
    pub const WHOLE_MAP: Self = Self { recorder_buffer: 8, ..Self::MAP };

    pub const fn slices(longest: usize) -> Self {
        Self { longest, ..Self::SMALL }
    }

    /// Writers at once. One is enough, but a process that is killed while it starts may occupy a place for ever.
    pub(super) const WRITERS: usize = 16;
    /// Listeners at once on a topic. Many consumers listen to the topic that ends a tick and then read the others.
    pub(super) const LISTENERS: usize = 48;
    /// Places that consumers leave free for the successors of stages that ended.
    pub(super) const KEPT_FREE: usize = 3;
    /// Processes that may have a topic open at once.
    pub(super) const NODES: usize = 64;
}
