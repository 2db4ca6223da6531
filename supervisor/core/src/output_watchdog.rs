//! Whether each stage answers what it reads: one may beat and yet say nothing. Pure.
//!
//! A stage unanswered_since an output for each tick that all its inputs have reached. So a stage without input unanswered_since nothing, and of
//! a pipeline that stands still only the stage where it stands is blamed: those behind it have no input.

use common::topics::Rate;

use crate::{
    policy::Now,
    stages::{Stage, TABLE, find},
};

/// How far every stage has come.
pub(crate) struct OutputWatchdog(Vec<Progress>);

/// What one stage has said, and unanswered_since.
struct Progress {
    stage: &'static Stage,
    /// How long it may owe an answer.
    patience: Now,
    /// The stages whose output of a tick it answers.
    reads: Vec<&'static str>,
    /// The newest tick it has spoken of.
    said: Option<u64>,
    /// Ticks up to this one were a former life's to answer.
    excused: Option<u64>,
    /// Since when it has owed an answer without giving any.
    unanswered_since: Option<Now>,
}

impl OutputWatchdog {
    /// Nothing said yet; on a map of so many `cells`.
    pub(crate) fn new(cells: usize) -> Self {
        let progress = |stage: &'static Stage| Progress {
            stage,
            patience: stage.deadlines_on(cells).answers,
            reads: stage
                .inputs
                .iter()
                .filter(|input| input.spec().rate == Rate::EachTick)
                .map(|input| input.spec().writer)
                .filter(|writer| find(writer).is_some())
                .collect(),
            said: None,
            excused: None,
            unanswered_since: None,
        };
        Self(TABLE.iter().map(progress).collect())
    }

    /// `stage` has published something of `tick`.
    pub(crate) fn on_output(&mut self, stage: &str, tick: u64) {
        if let Some(progress) = self.find(stage)
            && progress.said < Some(tick)
        {
            (progress.said, progress.unanswered_since) = (Some(tick), None);
        }
    }

    /// A life of `stage` begins: ticks that were under way by then are another life's.
    pub(crate) fn on_start(&mut self, stage: &str) {
        let newest = self.0.iter().filter_map(|progress| progress.said).max();
        if let Some(progress) = self.find(stage) {
            (progress.excused, progress.unanswered_since) = (newest, None);
        }
    }

    /// Nobody unanswered_since anything: the robot stands, and ticks may end on their way.
    pub(crate) fn forgive(&mut self) {
        for progress in &mut self.0 {
            progress.unanswered_since = None;
        }
    }

    /// The first stage, in the order of the pipeline, that has been silent for longer than it may although it had input.
    pub(crate) fn stale(&mut self, now: Now) -> Option<&'static str> {
        let said: Vec<_> = self.0.iter().map(|it| (it.stage.name, it.said)).collect();
        let said = |writer: &str| said.iter().find(|(name, _)| *name == writer)?.1;
        for progress in &mut self.0 {
            let input = progress.reads.iter().map(|writer| said(writer)).min();
            if input.flatten() <= progress.said.max(progress.excused) {
                progress.unanswered_since = None;
            } else {
                progress.unanswered_since.get_or_insert(now);
            }
        }
        let stale = |progress: &&Progress| {
            let waited = progress
                .unanswered_since
                .map(|since| now.saturating_sub(since));
            waited.is_some_and(|waited| waited >= progress.patience)
        };
        self.0
            .iter()
            .find(stale)
            .map(|progress| progress.stage.name)
    }

    fn find(&mut self, stage: &str) -> Option<&mut Progress> {
        self.0.iter_mut().find(|it| it.stage.name == stage)
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    const MINUTE: Duration = Duration::from_secs(60);

    fn said(outputs: &[(&str, u64)]) -> OutputWatchdog {
        let mut watchdog = OutputWatchdog::new(0);
        for &(stage, tick) in outputs {
            watchdog.on_output(stage, tick);
        }
        watchdog
    }

    /// Who is blamed when nothing further is said for a minute.
    fn blamed(watchdog: &mut OutputWatchdog) -> Option<&'static str> {
        watchdog
            .stale(Duration::ZERO)
            .or_else(|| watchdog.stale(MINUTE))
    }

    #[test]
    fn the_stage_where_a_tick_ends_is_blamed_and_nobody_behind_it() {
        let tick = TABLE.each_ref().map(|stage| (stage.name, 7));
        for (until, _) in tick.iter().enumerate().skip(1) {
            let outputs: Vec<_> = tick
                .iter()
                .enumerate()
                .map(|(index, &(stage, tick))| (stage, tick - u64::from(index >= until)))
                .collect();
            assert_eq!(blamed(&mut said(&outputs)), Some(tick[until].0));
        }
        assert_eq!(blamed(&mut said(&tick)), None);
    }

    #[test]
    fn a_stage_without_input_is_never_blamed() {
        assert_eq!(blamed(&mut said(&[])), None);
        // The map has not reached the planner, whatever the pose did.
        let mut watchdog = said(&[("dead-reckoning", 9), ("planner", 0), ("controller", 0)]);
        let blamed = blamed(&mut watchdog);
        for stage in ["mapper", "planner", "controller"] {
            assert_ne!(blamed, Some(stage));
        }
    }

    #[test]
    fn a_stage_is_blamed_when_its_time_is_over_and_not_before() {
        for stage in TABLE.iter().filter(|stage| stage.name != "x80-link") {
            let mut watchdog = said(&[("x80-link", 1), ("dead-reckoning", 1), ("mapper", 1)]);
            watchdog.on_output("planner", 1);
            watchdog.on_output("controller", 1);
            for reads in OutputWatchdog::new(0)
                .find(stage.name)
                .unwrap()
                .reads
                .clone()
            {
                watchdog.on_output(reads, 2);
            }
            assert_eq!(watchdog.stale(MINUTE), None, "{}", stage.name);
            let early = MINUTE + stage.deadlines.answers - Duration::from_millis(1);
            assert_ne!(watchdog.stale(early), Some(stage.name));
            let all_others_answered = TABLE.iter().filter(|other| other.name != stage.name);
            for other in all_others_answered {
                watchdog.on_output(other.name, 2);
            }
            let late = MINUTE + stage.deadlines.answers;
            assert_eq!(watchdog.stale(late), Some(stage.name));
        }
    }

    #[test]
    fn a_stage_that_lags_but_answers_is_left_alone() {
        let mut watchdog = OutputWatchdog::new(0);
        for tick in 1..100 {
            for stage in &TABLE {
                let ahead = u64::from(stage.name == "x80-link");
                watchdog.on_output(stage.name, tick + ahead);
            }
            let now = Duration::from_millis(900) * tick as u32;
            assert_eq!(watchdog.stale(now), None);
        }
    }

    #[test]
    fn a_new_life_owes_nothing_from_before_it() {
        let mut watchdog = said(&TABLE.each_ref().map(|stage| (stage.name, 6)));
        watchdog.on_output("x80-link", 7);
        watchdog.stale(Duration::ZERO);
        watchdog.on_start("dead-reckoning");
        assert_eq!(blamed(&mut watchdog), None);
        watchdog.on_output("x80-link", 8);
        assert_eq!(blamed(&mut watchdog), Some("dead-reckoning"));
    }

    #[test]
    fn time_before_the_robot_drove_is_forgiven() {
        let mut watchdog = said(&[("x80-link", 7)]);
        watchdog.stale(Duration::ZERO);
        watchdog.forgive();
        assert_eq!(watchdog.stale(MINUTE), None);
    }
}
