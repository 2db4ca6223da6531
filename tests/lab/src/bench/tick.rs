//! `firsthand bench tick`: the time of a tick, and of the bus alone.

pub(crate) use bench::tick::Arguments;
use bench::tick::{self, busy, consumers, hops, plain_hops};

use console::{failure::Failure, missions, output::print};

pub(crate) fn main(arguments: &Arguments) -> Result<(), Failure> {
    let robot = match &arguments.robot {
        Some(robot) => robot.clone(),
        None => format!("latency{}", std::process::id()).parse()?,
    };
    if let (Some(place), Some(supervisor)) = (&arguments.forwarder, arguments.supervisor) {
        if place == plain_hops::PLAIN {
            return Ok(plain_hops::run_forwarder(supervisor)?);
        }
        return Ok(hops::run_forwarder(&robot, place, supervisor)?);
    }
    if let (true, Some(supervisor)) = (arguments.consumer, arguments.supervisor) {
        return Ok(consumers::run(&robot, supervisor)?);
    }
    if let (true, Some(supervisor)) = (arguments.spin, arguments.supervisor) {
        return Ok(busy::run(supervisor)?);
    }
    let rate_hz = missions::load(&arguments.mission, &arguments.set)?.robot.rate_hz;
    for report in tick::measure(arguments, &robot, rate_hz)? {
        print(&report, arguments.json)?;
    }
    Ok(())
}
