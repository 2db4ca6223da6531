//! Robots of several machines.

use std::{
    thread,
    time::{Duration, Instant},
};

use console::{
    failure::{Result, refuse},
    output::{print_rows, say},
    table::Table,
};
use serde::Serialize;
use zenoh::{Session, Wait};

use crate::{
    session::{Connecting, failed},
    wire::Hello,
};

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Machines: HOST, HOST:PORT, tls/HOST:PORT or tcp/HOST:PORT.
    #[arg(required = true)]
    hosts: Vec<String>,
    #[command(flatten)]
    connecting: Connecting,
    /// Print one line of JSON per robot.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Listed {
    robot: String,
    at: String,
    order: Option<String>,
    mission_time_s: Option<f64>,
}

const PATIENCE: Duration = Duration::from_secs(3);
/// Wait for a machine's other robots after its first answer.
const OTHERS: Duration = Duration::from_millis(300);
const AGAIN_AFTER: Duration = Duration::from_millis(50);

pub fn list(arguments: &Arguments) -> Result {
    let (mut listed, mut silent) = (Vec::new(), Vec::new());
    for host in &arguments.hosts {
        let at = arguments.connecting.endpoint(host);
        let session = arguments.connecting.connect(host)?;
        let robots = robots(&session)?;
        if robots.is_empty() {
            silent.push(at.clone());
        }
        listed.extend(robots.into_iter().map(|hello| {
            let runs = hello.id != 0;
            Listed {
                robot: hello.robot,
                at: at.clone(),
                order: runs.then_some(hello.order),
                mission_time_s: runs.then_some(hello.mission_time_s),
            }
        }));
    }
    for at in &silent {
        say(format_args!("no answer from {at} within {} s", PATIENCE.as_secs()));
    }
    if listed.is_empty() {
        return refuse(
            "no-answer",
            "no machine answers; check that `firsthand remote serve` runs there and that this machine may read",
        );
    }
    let mut table = Table::new(["robot", "at", "state", ">time"]);
    for robot in &listed {
        let time = robot.mission_time_s.map_or("-".to_owned(), |time_s| format!("{time_s:.1} s"));
        let order = robot.order.as_deref().unwrap_or("does not run");
        table.row([&robot.robot, &robot.at, &order, &time]);
    }
    print_rows(&listed, arguments.json, table)
}

/// The session may not be connected yet.
fn robots(session: &Session) -> Result<Vec<Hello>> {
    let began = Instant::now();
    let mut robots: Vec<Hello> = Vec::new();
    let mut first = None::<Instant>;
    while began.elapsed() < PATIENCE && first.is_none_or(|first| first.elapsed() < OTHERS) {
        let replies = session.get("firsthand/*/hello").timeout(OTHERS).wait().map_err(failed)?;
        while let Ok(reply) = replies.recv() {
            let hello = reply.result().ok().and_then(|it| Hello::decoded(&it.payload().to_bytes()));
            let Some(hello) = hello else { continue };
            first.get_or_insert_with(Instant::now);
            if robots.iter().all(|known| known.robot != hello.robot) {
                robots.push(hello);
            }
        }
        thread::park_timeout(AGAIN_AFTER);
    }
    Ok(robots)
}
