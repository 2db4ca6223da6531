//! Drawn runs compared with their stored rows, so that a change of behaviour is seen.
//!
//! `RENEW=1 cargo test -p simulation --test behaviour` stores an intended change. The difference of
//! the rows shows which robots now do something else.

#![allow(clippy::unwrap_used)]

use std::thread;

use common::mission::Mission;
use crc32fast::Hasher;
use serde::{Deserialize, Serialize};
use simulation::{Ran, Scenario};
use summary::Quantiles;

const STORED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/behaviour.csv");
const RUNS_OF_EACH: u64 = 10;
/// Names and keys of the robots.
const ROBOTS: [(&str, &str); 8] = [
    ("X80", ""),
    ("X80, paper's method", "method = 'paper'\ncontroller.speed_m_s = 0.2"),
    ("X80SV, low battery", "robot.model = 'x80sv'\nsimulation.battery.start_v = 6.6"),
    ("JSON, gyro", "robot = { protocol = 'json', gyro = true }\nsimulation.realism = 'measured'"),
    ("JSON, heavy", "robot.protocol = 'json'\nsimulation.wheels = { acceleration_m_s2 = 0.4 }"),
    ("Kobuki", "robot = { model = 'kobuki', rate_hz = 10 }\nsimulation.realism = 'harsh'"),
    ("Jackal", "robot.model = 'jackal'"),
    ("car", "robot.model = 'car'\ncontroller.speed_m_s = 0.2"),
];

#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Row {
    robot: String,
    seed: u64,
    outcome: String,
    reason: String,
    mission_time_s: f64,
    restarts: u32,
    /// Number of times that the link stopped the robot, or let it go on.
    changes: usize,
    events: u64,
    /// Of the ground truth, the causes of stops, and the summary.
    crc32: String,
}

fn row((robot, keys): (&str, &str), seed: u64) -> Row {
    let text = format!(
        "target = [3, 0]\ntimeout_s = 60\nworld.drum = [{{ at = [1.5, 0.1], radius_m = 0.2 }}]\n\
         {keys}"
    );
    let mission = Mission::parse(&text, "behaviour.toml").unwrap();
    let Ran { summary, broken, events, truth, causes, .. } = Scenario::draw(&mission, seed).run();
    assert!(broken.is_none(), "{robot}, seed {seed}: {broken:?}");
    let mut summary = summary.unwrap();
    // A real clock measures solves.
    summary.full_solve_us = Quantiles::default();
    let mut hasher = Hasher::new();
    for part in [format!("{truth:?}"), format!("{causes:?}"), format!("{summary:?}")] {
        hasher.update(part.as_bytes());
    }
    Row {
        robot: robot.to_owned(),
        seed,
        outcome: summary.outcome.as_str().to_owned(),
        reason: summary.reason,
        mission_time_s: summary.mission_time_s,
        restarts: summary.restarts.values().sum(),
        changes: causes.len(),
        events,
        crc32: format!("{:08x}", hasher.finalize()),
    }
}

#[test]
fn drawn_robots_do_what_they_did_when_their_rows_were_stored() {
    let runs_of = |(first, robot)| {
        move || (first..first + RUNS_OF_EACH).map(|seed| row(robot, seed)).collect::<Vec<_>>()
    };
    let robots = (0..).step_by(RUNS_OF_EACH as usize).zip(ROBOTS);
    let rows: Vec<_> = thread::scope(|scope| {
        let threads: Vec<_> = robots.map(|robot| scope.spawn(runs_of(robot))).collect();
        threads.into_iter().flat_map(|rows| rows.join().unwrap()).collect()
    });
    if std::env::var_os("RENEW").is_some() {
        let mut writer = csv::Writer::from_path(STORED).unwrap();
        rows.iter().for_each(|row| writer.serialize(row).unwrap());
        writer.flush().unwrap();
    }
    let stored = csv::Reader::from_path(STORED).unwrap().into_deserialize();
    let stored: Vec<Row> = stored.map(|row| row.unwrap()).collect();
    assert_eq!(stored.len(), rows.len());
    for (row, stored) in rows.iter().zip(&stored) {
        assert_eq!(row, stored, "RENEW=1 stores an intended change");
    }
}
