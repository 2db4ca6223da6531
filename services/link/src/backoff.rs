//! Exponential backoff between attempts.

use std::time::Duration;

#[derive(Clone, Debug)]
pub struct Backoff {
    first: Duration,
    longest: Duration,
    pause: Duration,
    pub(crate) attempts: u64,
    next_ns: Option<u64>,
}

impl Backoff {
    /// Returns a backoff whose first attempt is due at once. Pauses double from `first` up to
    /// `longest`.
    pub const fn new(first: Duration, longest: Duration) -> Self {
        assert!(first.as_nanos() <= longest.as_nanos());
        Self { first, longest, pause: first, attempts: 0, next_ns: None }
    }

    pub fn is_due(&self, now_ns: u64) -> bool {
        self.next_ns.is_none_or(|next| now_ns >= next)
    }

    pub fn attempted(&mut self, now_ns: u64) {
        self.attempts += 1;
        self.next_ns = Some(now_ns.saturating_add(self.pause.as_nanos() as u64));
        self.pause = (self.pause * 2).min(self.longest);
        assert!(self.pause >= self.first);
    }

    pub const fn reset(&mut self) {
        *self = Self::new(self.first, self.longest);
    }

    /// Returns 0 when it is due.
    pub fn wait_ns(&self, now_ns: u64) -> u64 {
        self.next_ns.map_or(0, |next| next.saturating_sub(now_ns))
    }
}

pub(crate) fn has_passed(since_ns: u64, now_ns: u64, span: Duration) -> bool {
    now_ns.saturating_sub(since_ns) >= span.as_nanos() as u64
}
