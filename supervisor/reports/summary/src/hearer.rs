//! Numbers of a run that only its samples contain.

use std::{cell::RefCell, collections::BTreeMap, rc::Rc};

use common::{
    grid::Replica,
    latency::Histogram,
    samples::{Action, Cause, FieldCell, GuidanceSample, LinkSample},
};
use mission_control::{Heard, Listener};

use crate::{
    totals::{LookTotals, Totals, WheelTotals},
    trails::{Trail, Trails},
};

#[derive(Default)]
pub struct Hearer {
    /// Newest state of each generation of the link.
    links: BTreeMap<u32, LinkSample>,
    pub(crate) interruptions: Interruptions,
    solves: BTreeMap<u32, u64>,
    pub(crate) looks: Totals<LookTotals>,
    pub(crate) wheels: Totals<WheelTotals>,
    pub(crate) full_solves: Histogram,
    pub field: Replica<FieldCell>,
    trails: Trails,
}

/// Stops, or slow-downs to half speed, of a moving robot by failsafe cause.
#[derive(Default)]
pub(crate) struct Interruptions {
    has_gone: bool,
    newest: Option<(Action, Cause)>,
    stops: BTreeMap<String, u32>,
    pub slowed: BTreeMap<String, u32>,
}

impl Interruptions {
    /// Returns the stops that interrupted the mission.
    ///
    /// The link measures the supervisor's silence by the machine's clock. In lockstep, `in_ticks`,
    /// mission time stands meanwhile, and nothing is interrupted.
    pub(crate) fn stops(&self, in_ticks: bool) -> BTreeMap<String, u32> {
        let mut stops = self.stops.clone();
        if in_ticks {
            stops.remove(Cause::SupervisorSilent.name());
        }
        stops
    }

    fn hear(&mut self, link: &LinkSample) {
        let (action, cause) = (link.action(), link.cause());
        self.has_gone |= action == Action::Go;
        let began = self.newest.replace((action, cause)) != Some((action, cause));
        // A robot that waits, has arrived or stands for its operator is uninterrupted.
        let of_mission = matches!(
            cause,
            Cause::None | Cause::NotOrdered | Cause::MissionOver | Cause::OperatorStop
        );
        let counts = match action {
            Action::Go => return,
            Action::Slow => &mut self.slowed,
            Action::Stop | Action::End => &mut self.stops,
        };
        if self.has_gone && began && !of_mission {
            *counts.entry(cause.name().to_owned()).or_default() += 1;
        }
    }
}

impl Hearer {
    /// Creates a hearer, and the listener that passes it a run's samples.
    pub fn with_listener() -> (Rc<RefCell<Self>>, Listener) {
        let hearer = Rc::new(RefCell::new(Self::default()));
        let told = Rc::clone(&hearer);
        (hearer, Box::new(move |heard| told.borrow_mut().hear(&heard)))
    }

    pub fn hear(&mut self, heard: &Heard<'_>) {
        match heard {
            Heard::Command(command) => {
                self.wheels.add(command.stamp.tick, |totals| totals.with(command));
            }
            Heard::Guidance(guidance) => self.hear_guidance(guidance),
            Heard::Field(part, cells) => {
                self.field.apply(part, cells);
            }
            Heard::Grid(grid) => self.trails.hear(grid),
            Heard::Link(link) => {
                self.interruptions.hear(link);
                self.links.insert(link.stamp.generation, **link);
            }
        }
    }

    fn hear_guidance(&mut self, guidance: &GuidanceSample) {
        let GuidanceSample { stamp, full_solves, .. } = *guidance;
        let before = self.solves.insert(stamp.generation, full_solves);
        // Of several solves in a sample, only the last one's time is known.
        if full_solves > before.unwrap_or_default() {
            self.full_solves.record(guidance.full_solve_ns);
        }
        self.looks.add(stamp.tick, |totals| totals.with(guidance));
    }

    pub fn trails(&self) -> &[Trail] {
        &self.trails.0
    }

    /// Counts those of all planners. `last` is the last that counts.
    pub fn solves_until(&self, last: Option<&GuidanceSample>) -> u64 {
        let Some(last) = last else {
            return self.solves.values().sum();
        };
        self.solves.range(..last.stamp.generation).map(|(_, count)| count).sum::<u64>()
            + last.full_solves
    }

    pub fn wheel_range_rad_s(&self, tick: u64) -> Option<f64> {
        self.wheels.at(tick).range_rad_s()
    }

    pub fn latency(&self) -> Histogram {
        let mut all = Histogram::default();
        for link in self.links.values() {
            all.add(&link.latency_histogram, link.latency_max_ns);
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_time_the_failsafe_stops_or_slows_a_robot_that_had_gone_is_counted_once_by_its_cause() {
        let mut interruptions = Interruptions::default();
        for (action, cause) in [
            (Action::Stop, Cause::PoseStale),
            (Action::Go, Cause::None),
            (Action::Slow, Cause::RangeDoubtful),
            (Action::Slow, Cause::RangeDoubtful),
            (Action::Stop, Cause::RangeImplausible),
            (Action::Go, Cause::None),
            (Action::Slow, Cause::RangeDoubtful),
            (Action::End, Cause::MissionOver),
        ] {
            let (action, cause) = (action.into(), cause.into());
            interruptions.hear(&LinkSample { action, cause, ..LinkSample::default() });
        }
        let counted = |cause: Cause, times| BTreeMap::from([(cause.name().to_owned(), times)]);
        assert_eq!(interruptions.stops(false), counted(Cause::RangeImplausible, 1));
        assert_eq!(interruptions.slowed, counted(Cause::RangeDoubtful, 2));
    }
}
