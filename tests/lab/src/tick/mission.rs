//! Mission with measured ticks, and threads that read every grid and field.

use std::time::Duration;

use common::{
    bus::BusError,
    clock::Pace,
    domain::RobotName,
    follower::{Event, Follower},
    topics,
};

use super::{
    Arguments, Times,
    process_set::{ProcessSet, Used},
};
use crate::{
    background::Turns,
    error::{OrCannot as _, Result},
    robot::{self, Run},
};

const STOPS_WITHIN: Duration = Duration::from_millis(100);

/// Returns tick times and resources; no resources for a short mission.
pub fn measure(
    arguments: &Arguments,
    robot: &RobotName,
    pace: Pace,
) -> Result<(Times, Option<Used>)> {
    let directory = tempfile::Builder::new().prefix("firsthand-latency-").tempdir();
    let directory = directory.or_cannot("make a directory for the mission")?;
    let mut command = robot::mission("run", &arguments.mission, robot, &arguments.set);
    let files = directory.path().join("run");
    command.args(["--pace", &pace.to_string(), "--out"]).arg(&files);
    // Consumers follow the bus, outside the mission's processes.
    let _consumers: Vec<_> = (0..arguments.consumers).map(|_| consumer(robot)).collect();
    let run = Run::start(command, &files, !arguments.no_record)?;
    let mut processes = ProcessSet::of(run.process.id());
    let summary = run.wait(|| processes.look())?.summary()?;
    let times = Times::new("a mission's ticks", summary.ticks, summary.tick_latency_us)?;
    Ok((times, processes.used()))
}

fn consumer(robot: &RobotName) -> Turns {
    let domain = robot.domain();
    Turns::start(move || {
        let mut follower = Follower::new(domain, "consumer", &topics::GRID, |bus| {
            Ok((bus.reader(&topics::GRID)?, bus.reader(&topics::FIELD)?))
        });
        move || -> Result<(), BusError> {
            if let Event::Samples((grids, fields)) = follower.wait(STOPS_WITHIN)? {
                while grids.next_slice()?.is_some() {}
                while fields.next_slice()?.is_some() {}
            }
            Ok(())
        }
    })
}
