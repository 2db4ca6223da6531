//! Bringing the robot to rest and stopping the stages: at the end, or to recreate the bus.

use std::time::Duration;

use common::{samples::Action, topics};
use processes::{domain::DomainLock, policy::Now};

use crate::{
    error::SupervisorError,
    judge::{RESTS_WITHIN, TickProgress},
    order::Decision,
    outcome::Wheels,
    supervisor::Supervisor,
};

/// Time for the link to confirm that the robot was ordered to stand, before the link is stopped.
const STAND_CONFIRMED: Duration = Duration::from_millis(100);
/// The time that a robot whose encoders nobody reads is waited for: its link may be starting.
const HEARD_WITHIN: Duration = Duration::from_secs(1);

/// Bring the robot to rest and stop the stages. The link, which stops the robot, comes last, and not while wheels turn:
/// [`finish`] ends it then. If `trusts_encoders` is false, the encoders do not show whether wheels turn.
pub(crate) fn stop(
    supervisor: &mut Supervisor<'_>,
    trusts_encoders: bool,
) -> Result<Wheels, SupervisorError> {
    supervisor.service.stopping();
    supervisor.decision = Decision::ENDING;
    let wheels = match come_to_rest(supervisor)? {
        Wheels::Turning if !trusts_encoders => Wheels::Unknown,
        wheels => wheels,
    };
    if wheels == Wheels::Turning {
        stop_stages(supervisor, 1)?;
    } else {
        finish(supervisor)?;
    }
    Ok(wheels)
}

pub(crate) fn finish(supervisor: &mut Supervisor<'_>) -> Result<(), SupervisorError> {
    supervisor.stages.start_no_more();
    stop_all(supervisor)?;
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
    stop_all(&mut supervisor)?;
    let mut supervisor = supervisor.with_new_bus(lock)?;
    supervisor.publish_state()?;
    supervisor.stages.start_all(supervisor.first_tick());
    supervisor.tick_progress = TickProgress::new(supervisor.stages.now());
    Ok(supervisor)
}

/// Order the robot to stand, and wait a moment for the link to confirm it.
fn stand(supervisor: &mut Supervisor<'_>) -> Result<(), SupervisorError> {
    supervisor.publish_state()?;
    let began = supervisor.stages.now();
    loop {
        turn(supervisor)?;
        let confirmed = supervisor.bus.observer.record.link.is_none_or(|link| link.stopped());
        if confirmed || waited(supervisor, began) >= STAND_CONFIRMED {
            return Ok(());
        }
        supervisor.wait()?;
    }
}

/// Order the end of the mission, and wait until the encoders say that the robot rests. The link uses each method of the
/// protocol in turn meanwhile.
fn come_to_rest(supervisor: &mut Supervisor<'_>) -> Result<Wheels, SupervisorError> {
    supervisor.publish_state()?;
    let began = supervisor.stages.now();
    loop {
        turn(supervisor)?;
        let (wheels, patience) = match wheels(supervisor) {
            Wheels::AtRest => return Ok(Wheels::AtRest),
            Wheels::Turning => (Wheels::Turning, RESTS_WITHIN),
            Wheels::Unknown if supervisor.drove => (Wheels::Unknown, HEARD_WITHIN),
            Wheels::Unknown => (Wheels::Unknown, Duration::ZERO),
        };
        if waited(supervisor, began) >= patience {
            return Ok(wheels);
        }
        supervisor.wait()?;
    }
}

/// The link's answer since the end of the mission was ordered.
pub(crate) fn wheels(supervisor: &Supervisor<'_>) -> Wheels {
    let link = supervisor.bus.observer.record.link;
    match link.filter(|_| supervisor.stages.runs(topics::LINK.spec().writer)) {
        Some(link) if link.connected == 0 => Wheels::Unknown,
        Some(link) if link.action() == Action::End && link.at_rest == 1 => Wheels::AtRest,
        Some(_) => Wheels::Turning,
        None => Wheels::Unknown,
    }
}

fn waited(supervisor: &Supervisor<'_>, since: Now) -> Duration {
    supervisor.stages.now().saturating_sub(since)
}

pub(crate) fn turn(supervisor: &mut Supervisor<'_>) -> Result<(), SupervisorError> {
    supervisor.service.feed();
    supervisor.bus.observer.read_all(&mut supervisor.stages, &mut supervisor.listener)?;
    supervisor.poll_processes(supervisor.first_tick())?;
    // The simulated robot's pipe must not fill, or the robot could not answer the link.
    supervisor.robot.poll()?;
    if supervisor.bus.is_due(topics::RESTATE) {
        supervisor.publish_state()?;
    }
    Ok(())
}

fn stop_all(supervisor: &mut Supervisor<'_>) -> Result<(), SupervisorError> {
    stop_stages(supervisor, 1)?;
    stop_stages(supervisor, 0)
}

/// Stop the stages from the `first` of the start order on, all at once.
fn stop_stages(supervisor: &mut Supervisor<'_>, first: usize) -> Result<(), SupervisorError> {
    while supervisor.stages.stop_from(first) {
        supervisor.wait()?;
        turn(supervisor)?;
    }
    Ok(())
}
