//! What a table of topics says of one topic.

use std::time::Duration;

/// How often a topic is published.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rate {
    /// Once a tick; again for a tick that the link repeats because no command came, and whole for a new reader
    /// where readers only get changes.
    EachTick,
    /// After each frame of the robot that it is read from, driving or not: about once a tick, in a pause of the
    /// other work. Of several frames between two pauses only the newest is published.
    EachFrame,
    /// At every change, and again when nothing changes, for readers that joined since. The writer looks at the clock
    /// once in each turn of its work loop, so a long turn delays it.
    OnChange {
        /// Changes that follow each other sooner are published together; zero: each at once.
        at_most_every: Duration,
        /// How long after the last sample; after the last whole one, where samples carry changes.
        again_after: Duration,
    },
    /// When something happened, once.
    WhenItHappens,
}

/// Whether a recording keeps a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Logged {
    /// Always.
    Yes,
    /// Where fields are asked for: they are larger than all else together.
    WithFields,
}

/// What the table says of a topic.
#[derive(Debug)]
pub struct Spec {
    /// Its name, and the name of its two services.
    pub name: &'static str,
    /// Who writes it: a stage, [`SUPERVISOR`], [`OPERATOR`] or [`EVERY_STAGE`].
    pub writer: &'static str,
    /// How often.
    pub rate: Rate,
    /// Whether a recording keeps it.
    pub logged: Logged,
    /// Depth of history and buffers, number of readers.
    pub limits: Limits,
    /// What it means.
    pub meaning: &'static str,
}

/// The writer named by topics that all stages write.
pub const EVERY_STAGE: &str = "every stage";
/// The writers that are no stage: whoever uses the command line, one process each time.
pub const OPERATOR: &str = "operator";
/// The writer that is no stage.
pub const SUPERVISOR: &str = "supervisor";

impl Spec {
    /// Whether at most one process at a time writes it.
    pub(super) fn has_one_writer(&self) -> bool {
        ![EVERY_STAGE, OPERATOR].contains(&self.writer)
    }
}

/// How much a topic holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Samples a reader that falls behind still gets; then the oldest are dropped.
    pub buffer: usize,
    /// The same of a reader that keeps everything ([`crate::EncodedReader`]).
    pub recorder_buffer: usize,
    /// Samples a reader may hold at once.
    pub borrowed: usize,
    /// Readers at once, stages, dashboards and loggers among them. Consumers leave three places free.
    pub readers: usize,
}

impl Limits {
    /// For topics of one small struct.
    pub const SMALL: Self = Self { buffer: 128, recorder_buffer: 1024, borrowed: 2, readers: 16 };
    /// For what a replay needs whole: a recorder that the machine keeps waiting for a tenth of a second loses nothing.
    pub const DEEP: Self = Self { buffer: 1024, recorder_buffer: 1024, borrowed: 2, readers: 8 };
    /// For slices of a whole map.
    pub const MAP: Self = Self { buffer: 4, recorder_buffer: 256, borrowed: 2, readers: 24 };
    /// For slices that are most of a whole map each.
    pub const WHOLE_MAP: Self = Self { recorder_buffer: 8, ..Self::MAP };
    /// Writers at once. One is meant; a kill while starting can leak a place for good.
    pub(super) const WRITERS: usize = 16;
    /// Who waits for one topic: consumers of all that a tick publishes wait for the one that ends it.
    pub(super) const LISTENERS: usize = 48;
    /// Places of readers that consumers leave free, for successors of stages that ended.
    pub(super) const KEPT_FREE: usize = 3;
    /// Processes at once on one topic.
    pub(super) const NODES: usize = 64;
}
