//! The progress of many missions on standard error.

use std::{
    num::NonZero,
    thread,
    time::{Duration, Instant},
};

use evaluation::runner::Progress;

use console::progress_line::ProgressLine;

/// Time between lines that cannot be rewritten.
const LINE_EVERY: Duration = Duration::from_secs(10);

/// Missions at once: the requested number, or one for each processor.
pub(crate) fn jobs(asked_for: Option<NonZero<usize>>) -> usize {
    asked_for.map_or_else(|| thread::available_parallelism().map_or(1, NonZero::get), NonZero::get)
}

pub(crate) struct MissionProgress {
    title: String,
    began: Instant,
    line: ProgressLine,
}

impl MissionProgress {
    /// Lines begin with `title`.
    pub(crate) fn new(title: &str) -> Self {
        Self { title: title.to_owned(), began: Instant::now(), line: ProgressLine::new(LINE_EVERY) }
    }

    pub(crate) fn show(&mut self, progress: &Progress) {
        if !self.line.is_due() {
            return;
        }
        self.line.begin();
        let Progress { ended, all, ended_now } = *progress;
        let each = self.began.elapsed().as_secs_f64() / ended_now.max(1) as f64;
        let left = each * (all - ended) as f64;
        let title = &self.title;
        let line = format!("{title}{ended} of {all} missions, {left:.0} s left");
        self.line.show(&line, true);
    }

    pub(crate) fn end(&self) {
        self.line.end();
    }
}
