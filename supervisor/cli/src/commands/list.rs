//! `firsthand list`: the robots of this machine.

use std::{path::PathBuf, process::ExitCode, time::Duration};

use clap::Args;
use common::{
    bus::{Bus, BusError},
    domain::Domain,
    roster::Roster,
    samples::{HoldReason, Order},
};
use console::{
    robots::{self, Robot},
    words,
};
use serde::Serialize;

use super::{Failure, print_text};
use crate::progress_line::write_stderr;

/// List the robots that run on this machine for this user.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// One JSON object a line.
    #[arg(long)]
    json: bool,
}

/// The roster comes five times a second.
const PATIENCE: Duration = Duration::from_secs(1);

/// A line.
#[derive(Serialize)]
struct Listed {
    robot: String,
    supervisor_pid: Option<u32>,
    state: &'static str,
    mission_time_s: Option<f64>,
    simulated: Option<bool>,
    run: Option<PathBuf>,
}

pub(crate) fn main(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let listed: Vec<_> = robots::own().into_iter().map(listed).collect();
    let mut text = String::new();
    if arguments.json {
        for robot in &listed {
            text += &(serde_json::to_string(robot)? + "\n");
        }
    } else if listed.is_empty() {
        write_stderr(
            "firsthand: no robot runs here for this user; start one with `firsthand run`\n",
        );
    } else {
        text += &format!(
            "{:<16} {:>10} {:<24} {:>8} {:<9}  {}\n",
            "robot", "supervisor", "state", "time", "kind", "run"
        );
        listed.iter().for_each(|robot| text += &robot.line());
    }
    print_text(&text)?;
    let others: Vec<_> = robots::other_users().iter().map(u32::to_string).collect();
    if !others.is_empty() && !arguments.json {
        let others = others.join(", ");
        write_stderr(&format!(
            "firsthand: users {others} have, or had, robots here: `sudo -u '#USER' firsthand list`\n"
        ));
    }
    Ok(ExitCode::SUCCESS)
}

fn listed(robot: Robot) -> Listed {
    let roster = robot.supervisor.map(|_| roster(&robot));
    let (state, mission_time_s, simulated) = match roster {
        None => ("its supervisor was killed", None, None),
        Some(Ok(Some(roster))) => roster,
        // Its bus is being made, or it is frozen.
        Some(_) => ("no answer", None, None),
    };
    Listed {
        robot: robot.name.to_string(),
        supervisor_pid: robot.supervisor,
        state,
        mission_time_s,
        simulated,
        run: robot.run,
    }
}

/// What the supervisor orders, the mission time, and whether the robot is a simulated one.
type Said = (&'static str, Option<f64>, Option<bool>);

fn roster(robot: &Robot) -> Result<Option<Said>, BusError> {
    let bus = Bus::join(&Domain::of(robot.name.clone()), "list")?;
    Roster::open(&bus)?.find(PATIENCE, |header, _| {
        let order = words::order(
            Order::from_byte(header.order),
            HoldReason::from_byte(header.reason),
        );
        let time_s = header.stamp.time().seconds();
        Some((order, Some(time_s), Some(header.simulated == 1)))
    })
}

impl Listed {
    fn line(&self) -> String {
        let supervisor = self
            .supervisor_pid
            .map_or("-".to_owned(), |pid| pid.to_string());
        let time = self
            .mission_time_s
            .map_or("-".to_owned(), |time_s| format!("{time_s:.1} s"));
        let kind = match self.simulated {
            Some(true) => "simulated",
            Some(false) => "real",
            None => "-",
        };
        let run = self
            .run
            .as_ref()
            .map_or("-".to_owned(), |run| run.display().to_string());
        format!(
            "{:<16} {supervisor:>10} {:<24} {time:>8} {kind:<9}  {run}\n",
            self.robot, self.state
        )
    }
}
