//! The robot to rest and the stages down: for good, or to make the bus anew.

use std::time::{Duration, Instant};

use common::{
    samples::{HoldReason, Order},
    waiter::Waiter,
};

use super::{Ends, Supervisor, SupervisorError, bus_of};
use crate::{
    domain::Held,
    observer::{Observer, Record},
    report::{Ending, Outcome, Summary},
};

/// Time the link has to say that the robot was told to stand, before it is asked to go.
const STAND_CONFIRMED: Duration = Duration::from_millis(100);

/// What a run leaves.
pub(crate) struct Finished {
    /// The numbers.
    pub(crate) summary: Summary,
    /// Whether it ended as its user wanted.
    pub(crate) asked_for: bool,
    /// What was heard.
    pub(crate) record: Record,
    /// What really happened, of a simulated robot.
    pub(crate) truth: Vec<common::truth::TruthTick>,
}

impl Supervisor<'_> {
    /// The robot to rest, then the stages down in reverse order, the link last, then the robot itself.
    pub(super) fn stop(&mut self) -> Result<(), SupervisorError> {
        self.service.stopping();
        (self.order, self.reason) = (Order::Stop, HoldReason::Ending);
        self.stand()?;
        self.fleet.want_no_more();
        self.stop_stages()?;
        if let Some(simulator) = &mut self.simulator {
            simulator.stop()?;
        }
        Ok(())
    }

    /// Make the bus anew under all stages: what the middleware keeps of it lets one of them begin no life. The mission
    /// goes on from what the stages have kept.
    ///
    /// A consumer of the old bus hears nothing more: [`Bus::is_replaced`](common::bus::Bus::is_replaced) tells it.
    pub(super) fn renew(mut self, held: &mut Held) -> Result<Self, SupervisorError> {
        tracing::error!("the bus is made anew; consumers must join it again");
        (self.order, self.reason) = (Order::Hold, HoldReason::Starting);
        self.ready = false;
        self.stand()?;
        self.stop_stages()?;
        // The old ends go before the new bus is made: they would take its files for theirs.
        drop((self.waiter, self.ends));
        let record = self.observer.close();
        held.renew()?;
        let bus = bus_of(held)?;
        let mut waiter = Waiter::default();
        let mut observer = Observer::new(&bus, &mut waiter)?;
        observer.record = record;
        let ends = Ends::open(bus, &mut waiter)?;
        let mut supervisor = Self {
            observer,
            waiter,
            ends,
            ..self
        };
        supervisor.restate()?;
        supervisor.fleet.start_all(supervisor.first_tick())?;
        supervisor.progressed = (None, Instant::now());
        Ok(supervisor)
    }

    /// Say that the robot is to stand, and wait a moment for the link to say that it was told.
    pub(super) fn stand(&mut self) -> Result<(), SupervisorError> {
        self.restate()?;
        let began = Instant::now();
        loop {
            self.observer.take(&mut self.fleet)?;
            let confirmed = self.observer.record.link.is_none_or(|link| link.stopped());
            if confirmed || began.elapsed() >= STAND_CONFIRMED {
                break;
            }
            self.waiter.wait(STAND_CONFIRMED)?;
        }
        Ok(())
    }

    /// One after the other, in reverse order.
    pub(super) fn stop_stages(&mut self) -> Result<(), SupervisorError> {
        while self.fleet.stop_last()? {
            self.wait()?;
            self.observer.take(&mut self.fleet)?;
            self.tend(0)?;
            if let Some(simulator) = &mut self.simulator {
                // Its pipe must not fill: it could not say goodbye either.
                simulator.tend()?;
            }
        }
        Ok(())
    }

    pub(super) fn finish(self, ending: &Ending) -> Finished {
        let record = self.observer.record;
        let truth = self
            .simulator
            .map_or_else(Vec::new, |simulator| simulator.truth().to_vec());
        let restarts = self.fleet.restarts();
        let resumes = self.keeper.kept.resumes;
        let mission = &self.options.mission;
        let mut summary = Summary::of(mission, ending, &record, &truth, restarts, resumes);
        (summary.replans, summary.resets) = (self.stall.replans(), self.stall.resets());
        // The truth comes through a pipe of its own: a touch on the way may be seen after the arrival.
        let touched =
            summary.outcome == Outcome::Reached && summary.collisions.is_some_and(|n| n > 0);
        if touched {
            summary.outcome = Outcome::Collision;
            summary.reason = "touched something on the way to the target".to_owned();
        }
        Finished {
            summary,
            asked_for: ending.asked_for && !touched,
            record,
            truth,
        }
    }
}
