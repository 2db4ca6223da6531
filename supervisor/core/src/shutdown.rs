//! The robot to rest and the stages stopped in order: for good, or to recreate the bus.

use std::time::{Duration, Instant};

use crate::{
    domain::DomainLock, error::SupervisorError, judge::TickProgress, order::Decision,
    supervisor::Supervisor,
};

/// Time the link has to confirm that the robot was ordered to stand, before it is stopped.
const STAND_CONFIRMED: Duration = Duration::from_millis(100);

/// The robot to rest, then the stages stopped in reverse order, the link last, then the simulated robot.
pub(crate) fn stop(supervisor: &mut Supervisor<'_>) -> Result<(), SupervisorError> {
    supervisor.service.stopping();
    supervisor.decision = Decision::ENDING;
    stand(supervisor)?;
    supervisor.stages.start_no_more();
    stop_stages(supervisor)?;
    if let Some(simulator) = &mut supervisor.robot.simulator {
        simulator.stop()?;
    }
    Ok(())
}

/// Recreate the bus under all stages: leftovers of the middleware block the start of one of them. The mission goes on
/// from the checkpoints of the stages.
///
/// A consumer of the old bus reads nothing more, and asks [`Bus::is_replaced`](common::bus::Bus::is_replaced).
pub(crate) fn recreate_bus<'a>(
    mut supervisor: Supervisor<'a>,
    lock: &mut DomainLock,
) -> Result<Supervisor<'a>, SupervisorError> {
    tracing::error!("the bus is recreated; consumers must join it again");
    supervisor.decision = Decision::STARTING;
    stand(&mut supervisor)?;
    // One that dies meanwhile is not started again on the bus that goes.
    supervisor.stages.start_no_more();
    stop_stages(&mut supervisor)?;
    let mut supervisor = supervisor.with_new_bus(lock)?;
    supervisor.publish_state()?;
    supervisor.stages.start_all(supervisor.first_tick());
    supervisor.tick_progress = TickProgress::new(Instant::now());
    Ok(supervisor)
}

/// Order the robot to stand, and wait a moment for the link to confirm it.
fn stand(supervisor: &mut Supervisor<'_>) -> Result<(), SupervisorError> {
    supervisor.publish_state()?;
    let began = Instant::now();
    loop {
        let bus = &mut supervisor.bus;
        bus.observer.take(&mut supervisor.stages)?;
        let confirmed = bus.observer.record.link.is_none_or(|link| link.stopped());
        if confirmed || began.elapsed() >= STAND_CONFIRMED {
            return Ok(());
        }
        bus.waiter.wait(STAND_CONFIRMED)?;
    }
}

/// Stop one stage after the other, in reverse order.
fn stop_stages(supervisor: &mut Supervisor<'_>) -> Result<(), SupervisorError> {
    while supervisor.stages.stop_last() {
        supervisor.service.feed();
        supervisor.wait()?;
        supervisor.bus.observer.take(&mut supervisor.stages)?;
        supervisor.poll_processes(0)?;
        // The simulated robot's pipe must not fill: it could not answer the link.
        supervisor.robot.poll()?;
    }
    Ok(())
}
