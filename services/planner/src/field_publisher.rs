//! Topic `field`: after a tick, a thread computes the policy of every cell, so later ticks need not
//! wait.

use std::{io, os::fd::BorrowedFd, sync::Arc};

use common::{
    clock::MissionTime,
    grid::{GridFrame, Part, Window},
    samples::{FieldCell, FieldHeader},
    shell::Progress,
    topics,
};

use harmonic::Cancellation;

use crate::{background::Background, step::Snapshot};

pub(crate) struct Policy {
    pub header: FieldHeader,
    pub frame: GridFrame,
    pub cells: Arc<Vec<FieldCell>>,
}

impl Policy {
    pub(crate) fn of(snapshot: &Snapshot) -> Self {
        let Snapshot { header, frame, .. } = *snapshot;
        Self { header, frame, cells: Arc::new(snapshot.cells()) }
    }
}

struct Computed {
    policy: Policy,
    at: Progress,
    changed: Window,
}

/// Yields of the thread per policy; each may make it wait.
const YIELDS: usize = 8;

/// Replaces the cells `before` by those of the snapshot.
fn compute(before: &mut Arc<Vec<FieldCell>>, snapshot: &Snapshot, at: Progress) -> Computed {
    let frame = snapshot.frame;
    let every = (frame.cells as usize).div_ceil(YIELDS);
    // This avoids a wait of some milliseconds for a stage on this processor.
    let yields = |row: usize| {
        if row.is_multiple_of(every) {
            std::thread::yield_now();
        }
    };
    let cells = Arc::new(snapshot.cells_with(yields));
    assert_eq!(cells.len(), frame.area());
    let changed = if before.len() == cells.len() {
        frame.changed_window(before, &cells)
    } else {
        frame.whole()
    };
    *before = Arc::clone(&cells);
    Computed { policy: Policy { header: snapshot.header, frame, cells }, at, changed }
}

/// Publisher of the changed window of a policy, or of all of it if due or for a new reader.
pub(crate) struct FieldPublisher {
    thread: Background<(Snapshot, Progress), Computed>,
    pub busy: bool,
    version: u64,
    change_published: Option<MissionTime>,
    keyframe_published: Option<MissionTime>,
    keyframe: bool,
}

impl FieldPublisher {
    pub(crate) fn start() -> io::Result<Self> {
        let mut before = Arc::default();
        Ok(Self {
            thread: Background::start("policy", Cancellation::default(), move |(snapshot, at)| {
                compute(&mut before, &snapshot, at)
            })?,
            busy: false,
            version: 0,
            change_published: None,
            keyframe_published: None,
            keyframe: false,
        })
    }

    pub(crate) fn is_due(&self, changed: bool, now: MissionTime) -> bool {
        let age = self.change_published.map(|then| now.since(then));
        changed
            && !self.busy
            && age.is_none_or(|age| age >= topics::FIELD.spec().changes_at_most_every())
    }

    pub(crate) fn begin(&mut self, snapshot: Snapshot, at: Progress) {
        assert!(!self.busy);
        self.busy = true;
        self.change_published = Some(at.time);
        self.thread.begin((snapshot, at));
    }

    /// Returns the part of `policy` to publish `now`, and its tick.
    ///
    /// A ready policy replaces `policy` and keeps its own tick; a repeated one gets the tick of
    /// `now`.
    pub(crate) fn next(
        &mut self,
        now: Progress,
        has_new_reader: bool,
        policy: &mut Option<Policy>,
    ) -> Option<(Part, Progress)> {
        self.keyframe |= has_new_reader;
        let (mut changed, mut at) = (Window::default(), now);
        if self.busy {
            let computed = self.thread.take()?;
            self.busy = false;
            (changed, at) = (computed.changed, computed.at);
            *policy = Some(computed.policy);
        }
        let age = self.keyframe_published.map(|then| now.time.since(then));
        self.keyframe |= age.is_none_or(|age| age >= topics::FIELD.spec().restated_every());
        let frame = policy.as_ref()?.frame;
        assert!(frame.contains(changed));
        if changed.area() > 0 {
            self.version += 1;
        } else if !self.keyframe {
            return None;
        }
        let version = self.version;
        let part = if self.keyframe || changed == frame.whole() {
            (self.keyframe, self.keyframe_published) = (false, Some(now.time));
            Part::whole(frame, version)
        } else {
            Part::of(frame, changed, version)
        };
        Some((part, at))
    }

    pub(crate) fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        self.thread.descriptor()
    }
}
