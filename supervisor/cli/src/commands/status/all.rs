//! `firsthand status --all`: the robots of this machine.

use std::{path::PathBuf, thread};

use common::{
    bus::BusError,
    domain::RobotName,
    roster::{self, Roster},
    topics,
};
use serde::Serialize;

use console::{
    failure::Result,
    output::{print_rows, say},
    robots::{self, Robot},
    table::Table,
    words,
};
use mission_control::operator::PATIENCE;

use crate::commands::doctor::others;

#[derive(Serialize)]
struct Listed {
    robot: RobotName,
    supervisor_pid: Option<u32>,
    state: &'static str,
    mission_time_s: Option<f64>,
    simulated: Option<bool>,
    /// Age of a mirror's data, seconds.
    age_s: Option<f64>,
    run: Option<PathBuf>,
}

pub fn print(json: bool) -> Result {
    let (running, killed) = robots::own();
    // A frozen supervisor delays only its own row.
    let listed: Vec<_> = thread::scope(|scope| {
        let asked: Vec<_> =
            running.into_iter().map(|robot| scope.spawn(|| listed(robot))).collect();
        asked.into_iter().filter_map(|listed| listed.join().ok()).collect()
    });
    if listed.is_empty() && !json {
        say("no robot runs here for this user; start one with `firsthand run`");
    } else {
        print_rows(&listed, json, table(&listed))?;
    }
    if let ("note", others) = others(&killed, &robots::other_users()) {
        say(others);
    }
    Ok(())
}

fn listed(Robot { name, supervisor, run }: Robot) -> Listed {
    let mut listed = Listed {
        robot: name,
        supervisor_pid: supervisor,
        // The supervisor is frozen, or its bus is not complete yet.
        state: "no answer",
        mission_time_s: None,
        simulated: None,
        age_s: None,
        run,
    };
    if let Err(BusError::OtherVersion { .. }) = listed.ask() {
        listed.state = "it runs another version";
    }
    listed
}

impl Listed {
    fn ask(&mut self) -> Result<(), BusError> {
        let domain = self.robot.domain();
        let bus = roster::join(&domain, "list")?;
        let (is_mirror, mut ages) = (domain.mirrors().is_some(), bus.reader(&topics::MIRROR)?);
        Roster::open(&bus)?.find(PATIENCE, |header, _| {
            self.age_s = ages.newest().ok().flatten().map(|mirror| mirror.age_s()).or(self.age_s);
            if is_mirror && self.age_s.is_none() {
                return None;
            }
            self.state = words::order(header);
            self.mission_time_s = Some(header.stamp.seconds());
            self.simulated = Some(header.simulated == 1);
            Some(())
        })?;
        Ok(())
    }
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
                robot: "x80".parse().unwrap(),
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
