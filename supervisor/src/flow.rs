//! Whether each stage answers what it reads: one may beat and yet say nothing. Pure.
//!
//! A stage owes an output for each tick that all its inputs have reached. So a stage without input owes nothing, and of
//! a pipeline that stands still only the stage where it stands is blamed: those behind it have no input.

use common::topics::Rate;

use crate::{
    policy::Now,
    stages::{Stage, TABLE, find},
};

/// How far every stage has come.
pub(crate) struct Flow(Vec<Account>);

/// What one stage has said, and owes.
struct Account {
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
    owes: Option<Now>,
}

impl Flow {
    /// Nothing said yet; on a map of so many `cells`.
    pub(crate) fn new(cells: usize) -> Self {
        let account = |stage: &'static Stage| Account {
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
            owes: None,
        };
        Self(TABLE.iter().map(account).collect())
    }

    /// `stage` has published something of `tick`.
    pub(crate) fn on_output(&mut self, stage: &str, tick: u64) {
        if let Some(account) = self.find(stage)
            && account.said < Some(tick)
        {
            (account.said, account.owes) = (Some(tick), None);
        }
    }

    /// A life of `stage` begins: ticks that were under way by then are another life's.
    pub(crate) fn on_start(&mut self, stage: &str) {
        let newest = self.0.iter().filter_map(|account| account.said).max();
        if let Some(account) = self.find(stage) {
            (account.excused, account.owes) = (newest, None);
        }
    }

    /// Nobody owes anything: the robot stands, and ticks may end on their way.
    pub(crate) fn forgive(&mut self) {
        for account in &mut self.0 {
            account.owes = None;
        }
    }

    /// The first stage, in the order of the pipeline, that has been silent for longer than it may although it had input.
    pub(crate) fn stale(&mut self, now: Now) -> Option<&'static str> {
        let said: Vec<_> = self.0.iter().map(|it| (it.stage.name, it.said)).collect();
        let said = |writer: &str| said.iter().find(|(name, _)| *name == writer)?.1;
        for account in &mut self.0 {
            let input = account.reads.iter().map(|writer| said(writer)).min();
            if input.flatten() <= account.said.max(account.excused) {
                account.owes = None;
            } else {
                account.owes.get_or_insert(now);
            }
        }
        let stale = |account: &&Account| {
            let waited = account.owes.map(|since| now.saturating_sub(since));
            waited.is_some_and(|waited| waited >= account.patience)
        };
        self.0.iter().find(stale).map(|account| account.stage.name)
    }

    fn find(&mut self, stage: &str) -> Option<&mut Account> {
        self.0.iter_mut().find(|it| it.stage.name == stage)
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    const MINUTE: Duration = Duration::from_secs(60);

    fn said(outputs: &[(&str, u64)]) -> Flow {
        let mut flow = Flow::new(0);
        for &(stage, tick) in outputs {
            flow.on_output(stage, tick);
        }
        flow
    }

    /// Who is blamed when nothing further is said for a minute.
    fn blamed(flow: &mut Flow) -> Option<&'static str> {
        flow.stale(Duration::ZERO).or_else(|| flow.stale(MINUTE))
    }

    #[test]
    fn the_stage_where_a_tick_ends_is_blamed_and_nobody_behind_it() {
        let tick = [
            ("x80-link", 7),
            ("dead-reckoning", 7),
            ("mapper", 7),
            ("planner", 7),
            ("controller", 7),
        ];
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
        let mut flow = said(&[("dead-reckoning", 9), ("planner", 0), ("controller", 0)]);
        assert_eq!(blamed(&mut flow), None);
    }

    #[test]
    fn a_stage_is_blamed_when_its_time_is_over_and_not_before() {
        for stage in TABLE.iter().filter(|stage| stage.name != "x80-link") {
            let mut flow = said(&[("x80-link", 1), ("dead-reckoning", 1), ("mapper", 1)]);
            flow.on_output("planner", 1);
            flow.on_output("controller", 1);
            for reads in Flow::new(0).find(stage.name).unwrap().reads.clone() {
                flow.on_output(reads, 2);
            }
            assert_eq!(flow.stale(MINUTE), None, "{}", stage.name);
            let early = MINUTE + stage.deadlines.answers - Duration::from_millis(1);
            assert_ne!(flow.stale(early), Some(stage.name));
            let all_others_answered = TABLE.iter().filter(|other| other.name != stage.name);
            for other in all_others_answered {
                flow.on_output(other.name, 2);
            }
            let late = MINUTE + stage.deadlines.answers;
            assert_eq!(flow.stale(late), Some(stage.name));
        }
    }

    #[test]
    fn a_stage_that_lags_but_answers_is_left_alone() {
        let mut flow = Flow::new(0);
        for tick in 1..100 {
            for stage in &TABLE {
                let ahead = u64::from(stage.name == "x80-link");
                flow.on_output(stage.name, tick + ahead);
            }
            let now = Duration::from_millis(900) * tick as u32;
            assert_eq!(flow.stale(now), None);
        }
    }

    #[test]
    fn a_new_life_owes_nothing_from_before_it() {
        let mut flow = said(&TABLE.each_ref().map(|stage| (stage.name, 6)));
        flow.on_output("x80-link", 7);
        flow.stale(Duration::ZERO);
        flow.on_start("dead-reckoning");
        assert_eq!(blamed(&mut flow), None);
        flow.on_output("x80-link", 8);
        assert_eq!(blamed(&mut flow), Some("dead-reckoning"));
    }

    #[test]
    fn time_before_the_robot_drove_is_forgiven() {
        let mut flow = said(&[("x80-link", 7)]);
        flow.stale(Duration::ZERO);
        flow.forgive();
        assert_eq!(flow.stale(MINUTE), None);
    }
}
