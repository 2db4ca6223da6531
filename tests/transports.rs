//! Missions over every wire, by robots that are not the run's own children: they come and go by themselves.
#![allow(clippy::unwrap_used, clippy::panic)]

mod support;

use std::{
    io::{BufRead as _, BufReader},
    path::{Path, PathBuf},
    process::{Child, Stdio},
    sync::mpsc::{Receiver, channel},
};

use serde_json::Value;
use support::{Run, assert_nothing_left, firsthand};
use tempfile::TempDir;

/// A few seconds straight ahead.
const TARGET_M: f64 = 0.6;
const TOLERANCE_M: f64 = 0.1;

fn mission() -> (TempDir, PathBuf) {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("short.toml");
    let text = format!("target = [{TARGET_M}, 0]\narrival_tolerance_m = {TOLERANCE_M}");
    std::fs::write(&file, text).unwrap();
    (directory, file)
}

/// A simulated robot on its own.
struct Robot {
    process: Child,
    listening: String,
    /// Read as it comes: the robot waits for a reader that is slow.
    truth: Receiver<Value>,
}

impl Robot {
    fn start(mission: &Path, transport: &str, listen: &str) -> Self {
        let mission = mission.to_str().unwrap();
        let arguments = ["sim", mission, "--truth", "--transport", transport];
        let mut process = firsthand(&arguments)
            .args(["--listen", listen])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let output = BufReader::new(process.stdout.take().unwrap());
        let (told, truth) = channel();
        std::thread::spawn(move || {
            for line in output.lines().map_while(Result::ok) {
                let Ok(value) = serde_json::from_str::<Value>(&line) else {
                    return;
                };
                if told.send(value).is_err() {
                    return;
                }
            }
        });
        let header = truth.recv_timeout(support::PATIENCE).unwrap();
        Self {
            process,
            listening: header["listening"].as_str().unwrap().to_owned(),
            truth,
        }
    }

    /// Kill it, and say how far from its start it was.
    fn kill(mut self) -> f64 {
        self.process.kill().unwrap();
        self.process.wait().unwrap();
        let last = self.truth.iter().last().unwrap();
        last["x"]
            .as_f64()
            .unwrap()
            .hypot(last["y"].as_f64().unwrap())
    }
}

impl Drop for Robot {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Start a run of `mission` with the robot at `address`.
fn drive(name: &str, mission: &Path, address: &str) -> Run {
    let assignment = format!("robot.address=\"{address}\"");
    Run::start(name, mission.to_str().unwrap(), &["--set", &assignment])
}

fn assert_reached(code: Option<i32>, summary: &Value) {
    assert_eq!(
        (code, &summary["outcome"]),
        (Some(0), &"reached".into()),
        "{summary}"
    );
}

fn arrives_over(transport: &str, scheme: &str) {
    let (_directory, mission) = mission();
    let robot = Robot::start(&mission, transport, "127.0.0.1:0");
    let address = format!("{scheme}{}", robot.listening);
    let name = format!("over-{transport}");
    let (code, summary) = drive(&name, &mission, &address).finish();
    assert_reached(code, &summary);
    let went = robot.kill();
    assert!((went - TARGET_M).abs() <= TOLERANCE_M + 0.02, "{went} m");
    assert_nothing_left(&name);
}

#[test]
fn a_mission_arrives_over_datagrams() {
    arrives_over("udp", "");
}

#[test]
fn a_mission_arrives_over_a_connection() {
    arrives_over("tcp", "tcp://");
}

#[test]
fn a_mission_arrives_over_a_serial_line() {
    arrives_over("pty", "serial://");
}
