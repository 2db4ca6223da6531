//! The numbers of a run that only its samples say.

use std::{cell::RefCell, collections::BTreeMap, rc::Rc};

use common::{
    grid::Replica,
    latency::Histogram,
    samples::{FieldCell, GuidanceSample, LinkSample},
};
use mission_control::{Heard, Listener};

use crate::totals::{LookTotals, Totals, WheelTotals};

#[derive(Default)]
pub struct Hearer {
    /// The newest state of each generation of the link.
    links: BTreeMap<u32, LinkSample>,
    solves: BTreeMap<u32, u64>,
    pub(crate) looks: Totals<LookTotals>,
    pub(crate) wheels: Totals<WheelTotals>,
    pub(crate) full_solves: Histogram,
    pub field: Replica<FieldCell>,
}

impl Hearer {
    /// A hearer, and the listener that tells it of a run's samples.
    pub fn with_listener() -> (Rc<RefCell<Self>>, Listener) {
        let hearer = Rc::new(RefCell::new(Self::default()));
        let told = Rc::clone(&hearer);
        (hearer, Box::new(move |heard| told.borrow_mut().hear(&heard)))
    }

    fn hear(&mut self, heard: &Heard<'_>) {
        match heard {
            Heard::Command(command) => {
                self.wheels.add(command.stamp.tick, |totals| totals.with(command));
            }
            Heard::Guidance(guidance) => self.hear_guidance(guidance),
            Heard::Field(part, cells) => {
                self.field.apply(part, cells);
            }
            Heard::Link(link) => {
                self.links.insert(link.stamp.generation, **link);
            }
        }
    }

    fn hear_guidance(&mut self, guidance: &GuidanceSample) {
        let GuidanceSample { stamp, full_solves, .. } = *guidance;
        let before = self.solves.insert(stamp.generation, full_solves);
        // If a sample covers several solves, only the time of the last solve is known.
        if full_solves > before.unwrap_or_default() {
            self.full_solves.record(guidance.full_solve_ns);
        }
        self.looks.add(stamp.tick, |totals| totals.with(guidance));
    }

    /// Full solves of all generations of the planner, up to the sample `last`.
    pub(crate) fn solves_until(&self, last: Option<&GuidanceSample>) -> u64 {
        let (newest, its) =
            last.map_or((u32::MAX, None), |last| (last.stamp.generation, Some(last.full_solves)));
        let before: u64 = self.solves.range(..newest).map(|(_, count)| count).sum();
        before + its.or(self.solves.get(&newest).copied()).unwrap_or_default()
    }

    /// Tick latencies of every generation of the link.
    pub(crate) fn latency(&self) -> Histogram {
        let mut all = Histogram::default();
        for link in self.links.values() {
            all.add(&link.latency_histogram, link.latency_max_ns);
        }
        all
    }
}
