//! Topic `field`: the policy of every cell. It is computed on a thread of its own, from the field as it was at the end of
//! a tick, so that no later tick waits for it.

use std::{
    io,
    os::fd::{AsFd, BorrowedFd},
    sync::Arc,
};

use common::{
    bus::{BusError, SliceWriter},
    clock::MissionTime,
    grid::{GridFrame, Part, Window},
    samples::{FieldCell, FieldHeader},
    shell::Progress,
    topics::{self, AnyTopic as _},
};

use crate::{background::Background, step::Snapshot};

/// The policy of every cell.
#[derive(Debug)]
struct Policy {
    header: FieldHeader,
    frame: GridFrame,
    /// The tick whose field it is computed from.
    at: Progress,
    cells: Arc<Vec<FieldCell>>,
    /// The window in which it differs from the policy before.
    changed: Window,
}

/// How often the thread offers the processor to others while it computes a policy. Each time it may have to wait for its turn.
const YIELDS: usize = 8;

/// Computes policies, and holds the last one for comparison.
#[derive(Default)]
struct Worker {
    before: Arc<Vec<FieldCell>>,
}

impl Worker {
    fn policy(&mut self, (snapshot, at): (Snapshot, Progress)) -> Policy {
        let frame = snapshot.frame;
        let rows = frame.cells as usize;
        let mut cells = Vec::with_capacity(frame.area());
        for row in 0..rows {
            snapshot.append_row(row, &mut cells);
            // A stage that waits for this processor gets it: it might wait for some milliseconds otherwise.
            if row % rows.div_ceil(YIELDS) == 0 {
                std::thread::yield_now();
            }
        }
        let cells = Arc::new(cells);
        let changed = if self.before.len() == cells.len() {
            frame.changed_window(&self.before, &cells)
        } else {
            frame.whole()
        };
        self.before = Arc::clone(&cells);
        Policy { header: snapshot.header, frame, at, cells, changed }
    }
}

/// Publishes the window that changed, or the whole policy when that is due again or there is a new reader.
#[derive(Debug)]
pub(crate) struct FieldPublisher {
    writer: SliceWriter<FieldHeader, FieldCell>,
    thread: Background<(Snapshot, Progress), Policy>,
    /// The thread computes a policy.
    busy: bool,
    /// The policy that was published last.
    published: Option<Policy>,
    version: u64,
    change_published: Option<MissionTime>,
    keyframe_published: Option<MissionTime>,
    /// The whole policy is to be published.
    keyframe: bool,
}

impl FieldPublisher {
    /// Publishes through `writer`.
    ///
    /// # Errors
    /// When the system has no thread or descriptor left.
    pub(crate) fn start(writer: SliceWriter<FieldHeader, FieldCell>) -> io::Result<Self> {
        let mut worker = Worker::default();
        let policy = move |job| worker.policy(job);
        Ok(Self {
            writer,
            thread: Background::start("policy", policy)?,
            busy: false,
            published: None,
            version: 0,
            change_published: None,
            keyframe_published: None,
            keyframe: false,
        })
    }

    /// Whether the policy of a field that `changed` is to be computed now, at mission time `now`.
    pub(crate) fn is_due(&self, changed: bool, now: MissionTime) -> bool {
        let age = self.change_published.map(|then| now.since(then));
        changed && !self.busy && age.is_none_or(|age| age >= topics::FIELD.changes_at_most_every())
    }

    /// Begin to compute the policy of `snapshot`.
    pub(crate) fn begin(&mut self, snapshot: Snapshot, at: Progress) {
        self.busy = true;
        self.change_published = Some(at.time);
        self.thread.begin((snapshot, at));
    }

    /// Whether a policy that was begun may be ready.
    pub(crate) const fn is_busy(&self) -> bool {
        self.busy
    }

    /// The part to publish `now`, if any, and its tick: a policy that is ready has its own tick, one that is published again
    /// has that of `now`.
    pub(crate) fn next(&mut self, now: Progress) -> Option<(Part, Progress)> {
        let (mut changed, mut at) = (Window::default(), now);
        if self.busy {
            let policy = self.thread.take()?;
            self.busy = false;
            (changed, at) = (policy.changed, policy.at);
            self.published = Some(policy);
        }
        let age = self.keyframe_published.map(|then| now.time.since(then));
        self.keyframe |= self.writer.has_new_reader()
            || age.is_none_or(|age| age >= topics::FIELD.restated_every());
        let policy = self.published.as_ref()?;
        if changed.area() > 0 {
            self.version += 1;
        } else if !self.keyframe {
            return None;
        }
        let (frame, version) = (policy.frame, self.version);
        let part = if self.keyframe || changed == frame.whole() {
            (self.keyframe, self.keyframe_published) = (false, Some(now.time));
            Part::whole(frame, version)
        } else {
            Part::of(frame, changed, version)
        };
        Some((part, at))
    }

    /// Publish `part`, as of `at`.
    ///
    /// # Errors
    /// When the middleware refuses.
    pub(crate) fn publish(&mut self, part: Part, at: Progress) -> Result<(), BusError> {
        let Some(policy) = &self.published else {
            return Ok(());
        };
        let Progress { tick, time } = at;
        let header = FieldHeader { part, ..policy.header };
        let (frame, cells) = (policy.frame, &policy.cells);
        if part.window() == frame.whole() {
            self.writer.publish_slice_quietly(tick, time, header, cells)?;
        } else {
            let window = frame.cells_of(part.window(), cells);
            self.writer.publish_quietly(tick, time, header, window)?;
        }
        self.writer.wake()
    }
}

/// Readable when a policy is ready.
impl AsFd for FieldPublisher {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.thread.as_fd()
    }
}
