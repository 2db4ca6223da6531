//! Allocations of the stages. The counter replaces the allocator of this file alone.

#![allow(clippy::unwrap_used)]

use std::{cell::RefCell, collections::BTreeMap, rc::Rc};

use allocation_counter::measure;
use console::missions;
use simulation::{Observer, Scenario};

#[derive(Default)]
struct Counter(BTreeMap<String, u64>);

impl Observer for Counter {
    fn turn(&mut self, stage: &str, turn: &mut dyn FnMut()) {
        *self.0.entry(stage.to_owned()).or_default() += measure(turn).count_total;
    }
}

#[test]
fn a_tick_of_the_link_allocates_at_most_60_times_and_one_of_the_planner_40_times() {
    let counter = Rc::new(RefCell::new(Counter::default()));
    let scenario = Scenario::lockstep(&missions::load("obstacle-course", &[]).unwrap());
    let ran = scenario.run_before(Some(counter.clone()));
    let (ticks, Counter(found)) = (ran.summary.unwrap().ticks, counter.take());
    let [link, planner] = ["link", "planner"].map(|stage| found[stage] / ticks);
    assert!(link <= 60 && planner <= 40, "{found:?} in {ticks} ticks");
}
