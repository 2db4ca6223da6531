//! Watchdog for unanswered inputs, because a stage may send heartbeats without publishing. Pure.
//!
//! A stage must publish an output for each tick that all its inputs have reached. If the pipeline
//! stands still, the first stage with an unanswered input is to blame; later stages have none.

use std::time::Duration;

use common::topics::Rate;

use crate::{
    policy::Now,
    stages::{Stage, TABLE, find},
};

pub(crate) struct OutputWatchdog(Vec<StageOutput>);

struct StageOutput {
    stage: &'static Stage,
    patience: Duration,
    reads: Vec<&'static str>,
    published: Option<u64>,
    /// This stage or one that it reads has started anew since the last judgement.
    starts_anew: bool,
    /// Newest tick that the stage may have missed because of a start.
    excused: Option<u64>,
    unanswered_since: Option<Now>,
}

impl OutputWatchdog {
    pub(crate) fn new(cells: usize) -> Self {
        let output = |stage: &'static Stage| StageOutput {
            stage,
            patience: stage.deadlines_on(cells).answers,
            reads: stage
                .wiring
                .inputs
                .iter()
                .filter(|input| input.spec().rate == Rate::EachTick)
                .map(|input| input.spec().writer)
                .filter(|writer| find(writer).is_some())
                .collect(),
            published: None,
            starts_anew: false,
            excused: None,
            unanswered_since: None,
        };
        let outputs: Vec<_> = TABLE.iter().map(output).collect();
        assert!(outputs.iter().all(|it| !it.reads.contains(&it.stage.name)));
        Self(outputs)
    }

    pub(crate) fn on_output(&mut self, stage: &str, tick: u64) {
        if let Some(output) = self.find(stage)
            && output.published < Some(tick)
        {
            (output.published, output.unanswered_since) = (Some(tick), None);
        }
    }

    /// Records a new generation of `stage`. It receives nothing until it is ready, when
    /// [`Self::stale`] is asked next. Its readers may miss what the earlier generation published:
    /// they follow the roster to the new one.
    pub(crate) fn on_start(&mut self, stage: &str) {
        for output in &mut self.0 {
            if output.stage.name == stage || output.reads.contains(&stage) {
                (output.starts_anew, output.unanswered_since) = (true, None);
            }
        }
    }

    /// Clears unanswered inputs, because ticks of a standing robot may end within the pipeline.
    pub(crate) fn clear_unanswered(&mut self) {
        for output in &mut self.0 {
            output.unanswered_since = None;
        }
    }

    /// Returns the first stage in pipeline order with an overdue answer. All stages are ready.
    ///
    /// Each stage's `now` is its last beat, without its waits for a processor.
    pub(crate) fn stale(&mut self, now: impl Fn(&str) -> Now) -> Option<&'static str> {
        let published: Vec<_> = self.0.iter().map(|it| (it.stage.name, it.published)).collect();
        let published = |writer: &str| published.iter().find(|(name, _)| *name == writer)?.1;
        let newest = self.0.iter().filter_map(|output| output.published).max();
        for output in &mut self.0 {
            if std::mem::take(&mut output.starts_anew) {
                output.excused = newest;
            }
            let input = output.reads.iter().map(|writer| published(writer)).min();
            if input.flatten() <= output.published.max(output.excused) {
                output.unanswered_since = None;
            } else {
                output.unanswered_since.get_or_insert_with(|| now(output.stage.name));
            }
        }
        let stale = |output: &&StageOutput| {
            let waited =
                output.unanswered_since.map(|since| now(output.stage.name).saturating_sub(since));
            waited.is_some_and(|waited| waited >= output.patience)
        };
        self.0.iter().find(stale).map(|output| output.stage.name)
    }

    fn find(&mut self, stage: &str) -> Option<&mut StageOutput> {
        self.0.iter_mut().find(|it| it.stage.name == stage)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MINUTE: Duration = Duration::from_secs(60);

    fn published(outputs: &[(&str, u64)]) -> OutputWatchdog {
        let mut watchdog = OutputWatchdog::new(0);
        for &(stage, tick) in outputs {
            watchdog.on_output(stage, tick);
        }
        watchdog
    }

    /// Returns the stage blamed after a minute without new outputs.
    fn blamed(watchdog: &mut OutputWatchdog) -> Option<&'static str> {
        watchdog.stale(|_| Duration::ZERO).or_else(|| watchdog.stale(|_| MINUTE))
    }

    #[test]
    fn a_stage_is_blamed_when_its_time_is_over_and_not_before() {
        let all = |tick| TABLE.iter().map(move |stage| (stage.name, tick));
        for stage in TABLE.iter().filter(|stage| stage.name != "link") {
            let mut watchdog = published(&all(1).collect::<Vec<_>>());
            for reads in watchdog.find(stage.name).unwrap().reads.clone() {
                watchdog.on_output(reads, 2);
            }
            assert_eq!(watchdog.stale(|_| MINUTE), None, "{}", stage.name);
            let early = MINUTE + stage.deadlines.answers - Duration::from_millis(1);
            assert_ne!(watchdog.stale(|_| early), Some(stage.name));
            for (other, tick) in all(2).filter(|other| other.0 != stage.name) {
                watchdog.on_output(other, tick);
            }
            let late = MINUTE + stage.deadlines.answers;
            assert_eq!(watchdog.stale(|_| late), Some(stage.name));
        }
    }

    #[test]
    fn a_new_generation_need_not_answer_ticks_from_before_it_was_ready() {
        let mut watchdog =
            published(&TABLE.iter().map(|stage| (stage.name, 5)).collect::<Vec<_>>());
        watchdog.on_output("link", 6);
        watchdog.stale(|_| Duration::ZERO);
        watchdog.on_start("dead-reckoning");
        // The new generation has not yet subscribed.
        watchdog.on_output("link", 7);
        assert_eq!(blamed(&mut watchdog), None);
        watchdog.on_output("link", 8);
        assert_eq!(blamed(&mut watchdog), Some("dead-reckoning"));
    }

    #[test]
    fn readers_need_not_answer_a_generation_that_died() {
        let mut watchdog = published(&[("link", 7), ("dead-reckoning", 7)]);
        watchdog.stale(|_| Duration::ZERO);
        watchdog.on_start("dead-reckoning");
        assert_eq!(blamed(&mut watchdog), None);
        watchdog.on_output("link", 8);
        watchdog.on_output("dead-reckoning", 8);
        assert_eq!(blamed(&mut watchdog), Some("mapper"));
    }

    #[test]
    fn time_before_the_robot_drove_is_cleared() {
        let mut watchdog = published(&[("link", 7)]);
        watchdog.stale(|_| Duration::ZERO);
        watchdog.clear_unanswered();
        assert_eq!(watchdog.stale(|_| MINUTE), None);
    }
}
