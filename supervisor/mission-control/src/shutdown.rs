//! Shutdown: stops the robot, then the stages, at the end or before a new bus.

use std::time::Duration;

use common::{
    samples::{Action, LinkSample, Order, Rest},
    topics,
};

use crate::{
    bus_endpoints::BusEndpoints,
    error::Result,
    judge::{RESTS_WITHIN, TickProgress},
    order::Decision,
    outcome::Wheels,
    supervisor::Supervisor,
    surroundings::Surroundings,
};

/// Time for the link to confirm the stop order.
const STAND_CONFIRMED: Duration = Duration::from_millis(100);
/// Timeout for silent encoders: the link may be starting, or has not obeyed.
const HEARD_WITHIN: Duration = Duration::from_secs(2);
/// Maximum age of an encoder report; the link sends ten a second.
const NEW: Duration = Duration::from_secs(1);

impl Supervisor<'_> {
    /// Brings the robot to rest and stops the stages. `catch_up` waits for consumers.
    ///
    /// The link runs while wheels turn. If it ends first, its stop guard takes over.
    pub(crate) fn end_mission(&mut self, catch_up: &mut dyn FnMut()) -> Result<Wheels> {
        self.service.stopping();
        self.decision = Decision::ENDING;
        let wheels = self.come_to_rest()?;
        catch_up();
        if wheels == Wheels::Turning {
            self.stop_stages(1)?;
        } else {
            self.stop_processes()?;
        }
        Ok(wheels)
    }

    pub(crate) fn stop_processes(&mut self) -> Result {
        self.stages.start_no_more();
        self.stop_all()?;
        let Some(simulator) = &mut self.robot.simulator else {
            return Ok(());
        };
        self.turns.rest(true);
        let stopped = simulator.stop();
        self.turns.rest(false);
        Ok(stopped?)
    }

    /// Recreates a bus whose files block a stage's start, and restarts all stages from their
    /// checkpoints.
    ///
    /// Consumers ask [`Bus::is_replaced`](common::bus::Bus::is_replaced).
    pub(crate) fn recreate_bus(&mut self, surroundings: &mut dyn Surroundings) -> Result {
        tracing::error!("the bus is recreated; consumers must join it again");
        self.decision = Decision::STARTING;
        self.stand()?;
        // A stage that dies now must not start again on the old bus.
        self.stages.start_no_more();
        self.stop_all()?;
        surroundings.recreate_bus()?;
        // The next link connects to the robot anew.
        self.record.link = None;
        self.bus = BusEndpoints::open(surroundings.bus()?)?;
        self.publish_state()?;
        self.stages.start_all(self.first_tick());
        self.tick_progress = TickProgress::new(self.stages.now());
        Ok(())
    }

    /// Orders the robot to stand; waits briefly for the link's confirmation.
    fn stand(&mut self) -> Result {
        assert_eq!(self.decision.order(), Order::Hold);
        self.publish_state()?;
        let began = self.stages.now();
        loop {
            self.wait_turn()?;
            let confirmed = self.record.link.is_none_or(|link| link.stopped());
            if confirmed || self.stages.now().saturating_sub(began) >= STAND_CONFIRMED {
                return Ok(());
            }
            self.wait()?;
        }
    }

    /// Orders the mission's end; waits until the encoders report rest or stay silent for too long.
    fn come_to_rest(&mut self) -> Result<Wheels> {
        const { assert!(HEARD_WITHIN.as_millis() > NEW.as_millis()) };
        assert_eq!(self.decision.order(), Order::Stop);
        self.publish_state()?;
        let began = self.stages.now();
        let mut heard = began;
        loop {
            self.wait_turn()?;
            let wheels = self.wheels();
            let now = self.stages.now();
            let (since, patience) = match wheels {
                Wheels::AtRest => return Ok(wheels),
                Wheels::Turning => {
                    heard = now;
                    (began, RESTS_WITHIN)
                }
                Wheels::Unknown(_) if self.drove || self.connected_link().is_some() => {
                    (heard, HEARD_WITHIN)
                }
                Wheels::Unknown(_) => return Ok(wheels),
            };
            if now.saturating_sub(since) >= patience {
                return Ok(wheels);
            }
            self.wait()?;
        }
    }

    /// Returns the encoder state since the order to end.
    pub(crate) fn wheels(&self) -> Wheels {
        let Some(link) = self.connected_link() else {
            return Wheels::Unknown("it does not answer".to_owned());
        };
        let age = self.record.rest_read.map(|read| read.elapsed());
        match (link.at_rest(), age) {
            (_, None) => Wheels::Unknown("no usable motor frames came".to_owned()),
            (Rest::AtRest, Some(age)) if age < NEW && link.action() == Action::End => {
                Wheels::AtRest
            }
            (Rest::Moving, Some(age)) if age < NEW => Wheels::Turning,
            (_, Some(age)) => {
                Wheels::Unknown(format!("no usable motor frames for {:.1} s", age.as_secs_f64()))
            }
        }
    }

    /// Returns the state of a link that runs and hears the robot.
    fn connected_link(&self) -> Option<LinkSample> {
        let runs = self.stages.runs(topics::LINK.spec().writer);
        self.record.link.filter(|link| runs && link.connected == 1)
    }

    pub(crate) fn wait_turn(&mut self) -> Result {
        self.service.feed();
        self.bus.observer.read_all(&mut self.record, &mut self.stages, &mut self.listener)?;
        self.poll_processes()?;
        // A full pipe would block the simulated robot, and its answers to the link.
        self.robot.poll()?;
        if self.bus.is_due() {
            self.publish_state()?;
        }
        Ok(())
    }

    fn stop_all(&mut self) -> Result {
        self.stop_stages(1)?;
        self.stop_stages(0)?;
        assert!(self.stages.running().0 == 0 && !self.stages.any_starting());
        Ok(())
    }

    /// Stops the stages from the `first` of the start order on, concurrently.
    fn stop_stages(&mut self, first: usize) -> Result {
        while self.stages.stop_from(first) {
            self.wait()?;
            self.wait_turn()?;
        }
        Ok(())
    }
}
