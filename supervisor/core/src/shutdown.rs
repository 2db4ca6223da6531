//! Bringing the robot to rest and stopping the stages in order: at the end, or to recreate the bus.

use std::time::{Duration, Instant};

use crate::{
    domain::DomainLock, error::SupervisorError, judge::TickProgress, order::Decision,
    supervisor::Supervisor,
};

/// Time for the link to confirm that the robot was ordered to stand, before the link is stopped.
const STAND_CONFIRMED: Duration = Duration::from_millis(100);

/// Bring the robot to rest; stop the stages in reverse order, the link last; then stop the simulated robot.
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

/// Recreate the bus and restart all stages, because files of the middleware block the start of one of them. The mission
/// goes on from the checkpoints of the stages.
///
/// A consumer of the old bus receives nothing more; it asks [`Bus::is_replaced`](common::bus::Bus::is_replaced).
pub(crate) fn recreate_bus<'a>(
    mut supervisor: Supervisor<'a>,
    lock: &mut DomainLock,
) -> Result<Supervisor<'a>, SupervisorError> {
    tracing::error!("the bus is recreated; consumers must join it again");
    supervisor.decision = Decision::STARTING;
    stand(&mut supervisor)?;
    // A stage that dies meanwhile is not started again on the old bus.
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
        // The simulated robot's pipe must not fill: the robot could not answer the link.
        supervisor.robot.poll()?;
    }
    Ok(())
}
