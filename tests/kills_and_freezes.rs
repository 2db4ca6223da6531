//! Matrix of kills and freezes: process, signal, and phase of the mission.
//!
//! [`rows`] are for stages. The tests after it are for the supervisor and all processes at once.
//! `failsafe` tests commands to the wheels meanwhile, `freezes` the detection times.

use std::{path::Path, process::Stdio};

use rustix::process::Signal;
use serde_json::Value;
use tempfile::TempDir;

use crate::support::{
    self, Run, STAGES, all_run, assert_ended, assert_nothing_left, assert_reached, find, firsthand,
    generation, operate, output, pid, pids_of, processes, records, replayed_in, signal_process,
};

/// Phase in which stages get a signal.
enum Phase {
    /// Each stage gets the signal as soon as its first process runs.
    StartUp,
    /// The stages get the signal in turn while the robot drives.
    Driving,
    /// The stages get the signal in turn while the robot waits for an operator.
    Waiting,
    /// All stages get the signal at once after the supervisor was told to end.
    Stopping,
}

/// Row in which every stage gets each of `signals` in `phase` of a mission.
struct Row {
    phase: Phase,
    signals: &'static [Signal],
    mission: &'static str,
    arguments: &'static [&'static str],
}

const KILL: &[Signal] = &[Signal::KILL];
const FREEZE: &[Signal] = &[Signal::STOP];
const KILL_AND_FREEZE: &[Signal] = &[Signal::KILL, Signal::STOP];

/// Options for mission time at four times the wall clock: a mission takes ten seconds.
const FAST: &[&str] = &["--pace", "4"];
/// Speed at which the robot drives for longer than the signals take.
const LONG: &[&str] = &["--pace", "4", "--set", "controller.speed_m_s=0.1"];
/// Empty room for a car. Among drums it touches one in 3 of 100 missions, killed or not.
const CAR: &[&str] =
    &["--pace", "4", "--set", "robot.model=\"car\"", "--set", "controller.speed_m_s=0.05"];
/// Speed at which a lockstep mission lasts long enough for one signal.
const SLOW: &[&str] = &["--set", "controller.speed_m_s=0.02", "--timeout", "8000"];
/// Speed at which a lockstep mission lasts long enough for many signals.
const LOCKSTEP: &[&str] = &["--set", "controller.speed_m_s=0.006", "--timeout", "80000"];

/// Makes a test per row, named by its guarantee.
macro_rules! rows {
    ($($promise:ident: $robot:literal $phase:ident $signals:ident $mission:literal $arguments:ident;)*) => {
        $(#[test]
        fn $promise() {
            let row = Row {
                phase: Phase::$phase,
                signals: $signals,
                mission: $mission,
                arguments: $arguments,
            };
            row.assert_promise($robot);
        })*
    };
}

rows! {
    each_stage_killed_in_its_start_up_is_started_again_and_the_robot_arrives:
        "kf-start-kill" StartUp KILL "open-room" FAST;
    each_stage_frozen_in_its_start_up_is_started_again_and_the_robot_arrives:
        "kf-start-stop" StartUp FREEZE "open-room" FAST;
    each_stage_killed_and_frozen_while_driving_the_robot_arrives_and_every_generation_replays_to_the_bit:
        "kf-drive" Driving KILL_AND_FREEZE "obstacle-course" LONG;
    each_stage_of_a_car_killed_while_driving_it_arrives_in_an_empty_room:
        "kf-car" Driving KILL "open-room" CAR;
    each_stage_killed_and_frozen_in_lockstep_the_mission_does_not_hang:
        "kf-lockstep" Driving KILL_AND_FREEZE "open-room" LOCKSTEP;
    each_stage_killed_and_frozen_while_the_robot_waits_it_waits_on_and_then_arrives:
        "kf-wait" Waiting KILL_AND_FREEZE "open-room" FAST;
    all_stages_killed_while_the_run_stops_it_ends_in_order:
        "kf-stop-kill" Stopping KILL "open-room" FAST;
    all_stages_frozen_while_the_run_stops_it_ends_in_order:
        "kf-stop-freeze" Stopping FREEZE "open-room" FAST;
}

impl Row {
    fn assert_promise(&self, robot: &str) {
        let mut run = Run::start(robot, self.mission, self.arguments);
        match self.phase {
            Phase::StartUp => {
                for stage in STAGES {
                    signal_process(first_process(&run, stage), self.signals[0]);
                }
                run.wait_until_driving();
                assert_at_least_one_restart(&run.arrives());
            }
            Phase::Driving => {
                run.wait_until_under_way(1.0);
                self.signals.iter().for_each(|&signal| run.kill_each(signal));
                let (summary, directory) = run.arrives_in();
                self.assert_restarts(&summary);
                assert_pose_was_not_lost(&summary);
                assert_every_generation_replays(&directory, self);
            }
            Phase::Waiting => {
                run.wait_until_under_way(1.0);
                operate(robot, &["stop"]);
                run.wait_until("it stands", waits);
                self.signals.iter().for_each(|&signal| run.kill_each(signal));
                let status = run.wait_until("every stage runs", all_run);
                assert!(waits(&status), "{status}");
                operate(robot, &["resume"]);
                let summary = run.arrives();
                self.assert_restarts(&summary);
                assert_pose_was_not_lost(&summary);
            }
            Phase::Stopping => {
                let status = run.wait_until_under_way(0.5);
                run.signal(Signal::TERM);
                for stage in STAGES {
                    // A stage that has already ended in order cannot get a signal.
                    let stage = rustix::process::Pid::from_raw(pid(&status, stage) as i32);
                    let _ = rustix::process::kill_process(stage.unwrap(), self.signals[0]);
                }
                let (code, summary) = run.finish();
                assert_ended(code, &summary, 0, "aborted");
                assert_nothing_left(robot);
            }
        }
    }

    fn assert_restarts(&self, summary: &Value) {
        for stage in STAGES {
            // A robot that stood for long is stalled, and a stall ends with a new planner.
            let replans = summary["replans"].as_u64().filter(|_| stage == "planner");
            let expected = self.signals.len() as u64 + replans.unwrap_or_default();
            assert_eq!(summary["restarts"][stage], expected, "{stage}: {summary}");
        }
    }
}

fn waits(status: &Value) -> bool {
    status["order"] == "stopped by an operator"
}

fn first_process(run: &Run, stage: &str) -> u32 {
    let directory = run.directory();
    let directory = directory.to_str().unwrap();
    let mut found = None;
    support::wait_until("the stage's process is there", || {
        let mut its = processes(directory).into_iter();
        found = its.find(|(_, line)| line.contains(&format!(" stage {stage} ")));
        found.is_some()
    });
    found.unwrap().0
}

fn assert_at_least_one_restart(summary: &Value) {
    for stage in STAGES {
        assert!(summary["restarts"][stage].as_u64() >= Some(1), "{summary}");
    }
}

/// Asserts that the pose was not lost by metres. Another path reads other fractions of a count: 9
/// mm laterally at 6 m. A car's tyres slip by centimetres. Long looks add slip: three standard
/// deviations.
fn assert_pose_was_not_lost(summary: &Value) {
    let metres = |key: &str| summary[key].as_f64().unwrap();
    let allowed_m = (1.5 * metres("pose_within_m")).clamp(0.15, 0.5);
    assert!(metres("pose_error_m") < allowed_m, "{summary}");
}

/// Asserts that every generation is bit-equal, or ended before its first input.
fn assert_every_generation_replays(directory: &TempDir, row: &Row) {
    let deaths = records(&directory.path().join("run/deaths.jsonl"));
    let hit: Vec<_> = deaths.iter().map(|death| &death["stage"]).collect();
    assert_eq!(hit[..5], STAGES);
    // In lockstep the recorder may lose samples, because no stage waits for it.
    if row.arguments == LOCKSTEP {
        return;
    }
    let report = replayed_in(directory);
    assert!(report.equal() >= 10, "{report}");
}

#[test]
fn a_frozen_stage_is_recorded_as_hung_and_a_thawed_one_goes_on() {
    let mut run = Run::under_way("kf-thaw", "open-room", &["--pace", "1"], 0.5);
    let beats = |status: &Value| {
        let controller = find(status, "controller");
        controller["state"] == "running" && controller["beat_age_s"].as_f64() < Some(0.1)
    };
    // The controller may be replaced before the second command; both are then sent again.
    let goes_on = || {
        let before = run.wait_until("the controller beats", beats);
        operate("kf-thaw", &["stage", "freeze", "controller"]);
        let thaw = output(&["stage", "thaw", "controller", "--robot", "kf-thaw"]);
        let after = run.wait_until("the controller beats again", beats);
        let same = pid(&before, "controller") == pid(&after, "controller");
        assert!(!same || thaw.status.success(), "{thaw:?}");
        same.then_some(after)
    };
    let mut attempts = std::iter::repeat_with(goes_on).take(20).flatten();
    let thawed = attempts.next().unwrap();
    drop(attempts);
    operate("kf-thaw", &["stage", "freeze", "mapper"]);
    let status = run.wait_until("it is replaced", |status| {
        generation(status, "mapper") == 2 && find(status, "mapper")["state"] == "running"
    });
    assert_eq!(pid(&status, "controller"), pid(&thawed, "controller"));
    let mut deaths = run.records("deaths.jsonl");
    deaths.retain(|death| death["stage"] == "mapper");
    assert_eq!(deaths.len(), 1, "{deaths:?}");
    assert_eq!(deaths[0]["hung"], true, "{deaths:?}");
    assert!(deaths[0]["beat_age_s"].as_f64() >= Some(0.5), "{deaths:?}");
    assert_ne!(deaths[0]["log_tail"], "", "{deaths:?}");
    run.stop();
}

fn resume(directory: &Path) -> std::process::Command {
    let mut command = firsthand(&["run", "--json", "--resume"]);
    command.arg(directory).stderr(Stdio::inherit());
    command
}

/// Resumes a run to its end. Asserts that the robot arrives with a known pose, after `resumes`
/// resumes.
fn assert_resumed_run_arrives(robot: &str, directory: &Path, resumes: u32) {
    let output = resume(directory).output().unwrap();
    let summary: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_reached(output.status.code(), &summary);
    assert_eq!(summary["resumes"], resumes, "{summary}");
    assert_pose_was_not_lost(&summary);
    assert_nothing_left(robot);
}

#[test]
fn a_supervisor_killed_again_and_again_the_resumed_run_arrives_and_loses_no_pose() {
    let robot = "kf-again";
    let mut first = Run::start(robot, "obstacle-course", FAST);
    first.wait_until_under_way(4.0);
    first.kill();
    for seconds in [8.0, 12.0] {
        let mut next = support::start_quietly(&mut resume(&first.directory()));
        support::wait_for_status(robot, |status| {
            status["order"] == "driving" && status["mission_time_s"].as_f64() > Some(seconds)
        });
        next.kill().unwrap();
        next.wait().unwrap();
    }
    assert_resumed_run_arrives(robot, &first.directory(), 3);
}

#[test]
fn everything_killed_at_once_the_resumed_run_arrives() {
    let robot = "kf-all";
    let mut all = Run::start(robot, "open-room", SLOW);
    all.wait_until_under_way(1.0);
    for pid in pids_of(robot) {
        signal_process(pid, Signal::KILL);
    }
    all.reap();
    support::wait_until_all_ended(robot);
    assert_resumed_run_arrives(robot, &all.directory(), 1);
}

#[test]
fn a_supervisor_killed_while_the_robot_waits_the_resumed_run_waits_on() {
    let robot = "kf-all-wait";
    let mut run = Run::under_way(robot, "open-room", FAST, 0.5);
    operate(robot, &["stop"]);
    run.kill();
    let mut next = support::start_quietly(&mut resume(&run.directory()));
    support::wait_for_status(robot, |status| {
        assert_ne!(status["order"], "driving", "{status}");
        waits(status) && all_run(status)
    });
    operate(robot, &["resume"]);
    assert_eq!(next.wait().unwrap().code(), Some(0));
    assert_nothing_left(robot);
}
