//! The robot to rest and the stages down: for good, or to make the bus anew.

use std::{
    collections::BTreeMap,
    time::{Duration, Instant},
};

use common::{
    ground_truth::GroundTruthTick,
    samples::{HoldReason, Order},
    waiter::Waiter,
};

use super::{Ends, Supervisor, SupervisorError, bus_of};
use crate::{
    domain::DomainLock,
    observer::{Observer, Record},
    outcome::Ending,
};

/// Time the link has to say that the robot was told to stand, before it is asked to go.
const STAND_CONFIRMED: Duration = Duration::from_millis(100);

/// What a run leaves.
pub struct Finished {
    /// How it ended, and why.
    pub ending: Ending,
    /// What was heard.
    pub record: Record,
    /// What really happened, of a simulated robot.
    pub truth: Vec<GroundTruthTick>,
    /// Times each stage was started again.
    pub restarts: BTreeMap<&'static str, u32>,
    /// Supervisors that went on with the run.
    pub resumes: u32,
    /// Fresh planners that a stalled robot was given.
    pub replans: u32,
    /// Times its sensed belief was forgotten.
    pub resets: u64,
}

impl Supervisor<'_> {
    /// The robot to rest, then the stages down in reverse order, the link last, then the robot itself.
    pub(super) fn stop(&mut self) -> Result<(), SupervisorError> {
        self.service.stopping();
        (self.order, self.reason) = (Order::Stop, HoldReason::Ending);
        self.stand()?;
        self.stages.want_no_more();
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
    pub(super) fn recreate_bus(mut self, lock: &mut DomainLock) -> Result<Self, SupervisorError> {
        tracing::error!("the bus is made anew; consumers must join it again");
        (self.order, self.reason) = (Order::Hold, HoldReason::Starting);
        self.ready = false;
        self.stand()?;
        self.stop_stages()?;
        // The old ends go before the new bus is made: they would take its files for theirs.
        drop((self.waiter, self.ends));
        let record = self.observer.close();
        lock.recreate_bus()?;
        let bus = bus_of(lock)?;
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
        supervisor.stages.start_all(supervisor.first_tick())?;
        supervisor.progressed = (None, Instant::now());
        Ok(supervisor)
    }

    /// Say that the robot is to stand, and wait a moment for the link to say that it was told.
    pub(super) fn stand(&mut self) -> Result<(), SupervisorError> {
        self.restate()?;
        let began = Instant::now();
        loop {
            self.observer.take(&mut self.stages)?;
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
        while self.stages.stop_last()? {
            self.wait()?;
            self.observer.take(&mut self.stages)?;
            self.tend(0)?;
            if let Some(simulator) = &mut self.simulator {
                // Its pipe must not fill: it could not say goodbye either.
                simulator.tend()?;
            }
        }
        Ok(())
    }

    /// What is left of the run that came to this `ending`.
    pub(super) fn finish(self, ending: Ending) -> Finished {
        let truth = self
            .simulator
            .map_or_else(Vec::new, |simulator| simulator.truth().to_vec());
        Finished {
            ending,
            record: self.observer.record,
            truth,
            restarts: self.stages.restarts().collect(),
            resumes: self.state_file.state.resumes,
            replans: self.stall.replans(),
            resets: self.stall.resets(),
        }
    }
}
