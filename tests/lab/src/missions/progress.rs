//! The progress of many missions on standard error.

use std::time::{Duration, Instant};

use console::progress_line::ProgressLine;

/// Time between lines that cannot be rewritten.
const LINE_EVERY: Duration = Duration::from_secs(10);

/// A line that ends when it is dropped.
pub struct Progress<'a> {
    title: &'a str,
    began: Instant,
    line: ProgressLine,
    /// Missions that ended, including those of an earlier part, and those of this one.
    ended: usize,
    ended_now: usize,
    all: usize,
}

impl<'a> Progress<'a> {
    pub fn new(title: &'a str, ended: usize, all: usize) -> Self {
        let line = ProgressLine::new(LINE_EVERY);
        Self { title, began: Instant::now(), line, ended, ended_now: 0, all }
    }

    pub fn count(&mut self) {
        self.ended += 1;
        self.ended_now += 1;
        if !self.line.is_due() {
            return;
        }
        self.line.begin();
        let Self { title, ended, all, .. } = *self;
        let each = self.began.elapsed().as_secs_f64() / self.ended_now as f64;
        let left = each * (all - ended) as f64;
        self.line.show(&format!("{title}{ended} of {all} missions, {left:.0} s left"), true);
    }
}

impl Drop for Progress<'_> {
    fn drop(&mut self) {
        self.line.end();
    }
}
