//! Allocations of the stages. The counter replaces the allocator of this file alone.

#![allow(clippy::unwrap_used)]

use std::{cell::RefCell, collections::BTreeMap, rc::Rc};

use allocation_counter::measure;
use common::mission::Mission;
use console::missions;
use simulation::{Observer, Scenario};

#[derive(Default)]
struct Counter(BTreeMap<String, u64>);

impl Observer for Counter {
    fn turn(&mut self, stage: &str, turn: &mut dyn FnMut()) {
        *self.0.entry(stage.to_owned()).or_default() += measure(turn).count_total;
    }
}

/// Returns the allocations a tick, by stage.
fn allocations(mission: &Mission) -> BTreeMap<String, u64> {
    let counter = Rc::new(RefCell::new(Counter::default()));
    let ran = Scenario::lockstep(mission).run_before(Some(Box::new(Rc::clone(&counter))));
    let ticks = ran.summary.unwrap().ticks;
    counter.take().0.into_iter().map(|(stage, count)| (stage, count / ticks)).collect()
}

#[test]
fn a_tick_of_the_link_allocates_at_most_60_times_and_one_of_the_planner_40_times() {
    let found = allocations(&missions::load("obstacle-course", &[]).unwrap());
    assert!(found["link"] <= 60 && found["planner"] <= 40, "{found:?}");
}
