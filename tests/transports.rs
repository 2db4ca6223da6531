//! Missions over every wire, by robots that are not the run's own children: they come and go by themselves.

use std::{
    io::{BufRead as _, BufReader},
    path::{Path, PathBuf},
    process::{Child, Stdio},
    sync::mpsc::{Receiver, channel},
};

use crate::support::{self, Run, assert_nothing_left, assert_reached, firsthand};
use serde_json::Value;
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
    /// How far from its start it was last seen, metres.
    went: f64,
}

impl Robot {
    fn start(mission: &Path, transport: &str, listen: &str) -> Self {
        let mission = mission.to_str().unwrap();
        let arguments = ["sim", mission, "--ground-truth", "--transport", transport];
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
            went: 0.0,
        }
    }

    /// Wait until it is `metres` from its start.
    fn wait_until_driven(&mut self, metres: f64) {
        while self.went < metres {
            self.went = from_start(&self.truth.recv_timeout(support::PATIENCE).unwrap());
        }
    }

    /// Kill it, and say how far from its start it was.
    fn kill(mut self) -> f64 {
        self.process.kill().unwrap();
        self.process.wait().unwrap();
        let last = self.truth.iter().last();
        last.map_or(self.went, |truth| from_start(&truth))
    }
}

fn from_start(truth: &Value) -> f64 {
    let metres = |axis: &str| truth[axis].as_f64().unwrap();
    metres("x").hypot(metres("y"))
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

/// The most that a robot went after the last tick that was heard of it, metres.
const UNHEARD_M: f64 = 0.12;

/// The robot is killed halfway and comes back where it listened before, as one that was switched off and
/// on: its counts begin at zero, and so does the place it takes for its start.
fn goes_away_and_comes_back(transport: &str) {
    let (_directory, mission) = mission();
    let mut robot = Robot::start(&mission, transport, "127.0.0.1:0");
    let listened = robot.listening.clone();
    let name = format!("away-{transport}");
    let mut run = drive(&name, &mission, &format!("{transport}://{listened}"));
    robot.wait_until_driven(0.15);
    let first_part = robot.kill();
    let lost = run.wait_until("the robot is lost and looked for", |status| {
        status["link"]["connected"] == false && status["link"]["attempts"].as_u64() >= Some(3)
    });
    assert_eq!(lost["link"]["stopped"], true, "{lost}");
    let later = run.wait_until("it is still looked for", |status| {
        status["link"]["attempts"].as_u64() >= Some(4)
    });
    assert_eq!(later["order"], "driving", "the mission pauses only");
    assert_eq!(later["tick"], lost["tick"], "{later}");
    assert!(later["link"]["lost_s"].as_f64() > lost["link"]["lost_s"].as_f64());

    let robot = Robot::start(&mission, transport, &listened);
    let back = run.wait_until("the robot is back and known to have restarted", |status| {
        status["link"]["connected"] == true && status["link"]["reboots"] == 1
    });
    assert_eq!(back["link"]["losses"], 1, "{back}");
    let (code, summary) = run.finish();
    assert_reached(code, &summary);
    assert_eq!(summary["restarts"]["x80-link"], 0, "{summary}");
    // Both robots began at their own start: what they went together is what the run believes.
    let went = first_part + robot.kill();
    let believed = summary["path_length_m"].as_f64().unwrap();
    // But for what the first one went unheard: up to two ticks at 0.5 m/s.
    assert!((went - believed).abs() < UNHEARD_M, "{went} m: {summary}");
    assert!(
        (went - TARGET_M).abs() < TOLERANCE_M + UNHEARD_M,
        "{went} m"
    );
    assert_nothing_left(&name);
}

#[test]
fn a_robot_that_restarts_mid_mission_is_waited_for_and_arrives_over_datagrams() {
    goes_away_and_comes_back("udp");
}

#[test]
fn a_robot_that_restarts_mid_mission_is_waited_for_and_arrives_over_a_connection() {
    goes_away_and_comes_back("tcp");
}
