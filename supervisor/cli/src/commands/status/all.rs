//! `firsthand status --all`: the robots of this machine.

use std::{path::PathBuf, thread};

use common::{
    bus::BusError,
    roster::{self, Roster},
    topics,
};
use serde::Serialize;

use console::{
    failure::Result,
    output::{json_lines, print_text, say},
    robots::{self, Robot},
    table::Table,
    words,
};
use mission_control::operator::PATIENCE;

#[derive(Serialize)]
struct Listed {
    robot: String,
    supervisor_pid: Option<u32>,
    state: &'static str,
    mission_time_s: Option<f64>,
    simulated: Option<bool>,
    /// Age of a mirror's data, seconds.
    age_s: Option<f64>,
    run: Option<PathBuf>,
}

pub fn print(json: bool) -> Result {
    // A frozen supervisor delays only its own row.
    let listed: Vec<_> = thread::scope(|scope| {
        let asked = robots::own().into_iter().map(|robot| scope.spawn(|| listed(robot)));
        let asked: Vec<_> = asked.collect();
        asked.into_iter().filter_map(|listed| listed.join().ok()).collect()
    });
    if json {
        return print_text(json_lines(&listed)?);
    }
    if listed.is_empty() {
        say("no robot runs here for this user; start one with `firsthand run`");
    } else {
        print_text(table(&listed))?;
    }
    let others: Vec<_> = robots::other_users().iter().map(u32::to_string).collect();
    if !others.is_empty() {
        let others = others.join(", ");
        say(format_args!(
            "users {others} have, or had, robots here: `sudo -u '#USER' firsthand status --all`"
        ));
    }
    Ok(())
}

fn listed(robot: Robot) -> Listed {
    let roster = robot.supervisor.map(|_| roster(&robot));
    let (state, mission_time_s, simulated, age_s) = match roster {
        None => ("its supervisor was killed", None, None, None),
        Some(Ok(Some(roster))) => roster,
        Some(Err(BusError::OtherVersion { .. })) => ("it runs another version", None, None, None),
        // The supervisor is frozen, or its bus is not complete yet.
        Some(_) => ("no answer", None, None, None),
    };
    Listed {
        robot: robot.name.to_string(),
        supervisor_pid: robot.supervisor,
        state,
        mission_time_s,
        simulated,
        age_s,
        run: robot.run,
    }
}

/// Order, mission time, whether simulated, age of a mirror.
type RosterFacts = (&'static str, Option<f64>, Option<bool>, Option<f64>);

fn roster(robot: &Robot) -> Result<Option<RosterFacts>, BusError> {
    let domain = robot.name.domain();
    let bus = roster::join(&domain, "list")?;
    let (is_mirror, mut ages, mut age_s) =
        (domain.mirrors().is_some(), bus.reader(&topics::MIRROR)?, None);
    Roster::open(&bus)?.find(PATIENCE, |header, _| {
        age_s = ages.newest().ok().flatten().map(|mirror| mirror.age_s()).or(age_s);
        if is_mirror && age_s.is_none() {
            return None;
        }
        let order = words::order(header);
        let time_s = header.stamp.seconds();
        Some((order, Some(time_s), Some(header.simulated == 1), age_s))
    })
}

fn table(listed: &[Listed]) -> String {
    let mut table = Table::new(["robot", ">supervisor", "state", ">time", "kind", "run"]);
    let unknown = || "-".to_owned();
    for robot in listed {
        let kind = match (robot.age_s, robot.simulated) {
            (Some(age_s), _) => format!("elsewhere, {age_s:.1} s ago"),
            (None, Some(true)) => "simulated".to_owned(),
            (None, Some(false)) => "real".to_owned(),
            (None, None) => unknown(),
        };
        table.row([
            &robot.robot,
            &robot.supervisor_pid.map_or_else(unknown, |pid| pid.to_string()),
            &robot.state,
            &robot.mission_time_s.map_or_else(unknown, |time_s| format!("{time_s:.1} s")),
            &kind,
            &robot.run.as_ref().map_or_else(unknown, |run| run.display().to_string()),
        ]);
    }
    table.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mirror_is_listed_as_elsewhere_with_its_age_and_no_robot_of_here_is() {
        let shown = |age_s| {
            table(&[Listed {
                robot: "x80".to_owned(),
                supervisor_pid: Some(7),
                state: "drive",
                mission_time_s: Some(3.0),
                simulated: Some(true),
                age_s,
                run: None,
            }])
        };
        assert!(shown(Some(2.34)).contains("elsewhere, 2.3 s ago"));
        assert!(shown(None).contains("simulated") && !shown(None).contains("elsewhere"));
    }
}
