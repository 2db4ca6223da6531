//! Kills and freezes of processes by phase of the mission. `simulation` draws others.
//!
//! `failsafe` tests commands to the wheels meanwhile; `bench chaos` measures detection times.

use std::{path::Path, process::Stdio};

use common::geometry::wrap_angle;
use processes::stages::find as find_stage;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

use crate::support::{
    ENDLESS, Run, STAGES, all_run, assert_each_restarted, assert_nothing_left, find, firsthand,
    kill, operate, outcomes, output, pid, process_with, processes_with, reached, records,
    replayed_in, replayed_poses, signal_process, start_piped, start_quietly, wait_for_status,
    wait_until, wait_until_all_ended,
};

/// Options for mission time at four times the wall clock: a mission takes ten seconds.
const FAST: &str = "--pace 4";

/// Returns each stage with SIGKILL or SIGSTOP in turn.
fn kill_and_freeze_in_turn() -> impl Iterator<Item = (&'static str, Signal)> {
    std::iter::zip(STAGES, [Signal::KILL, Signal::STOP].into_iter().cycle())
}

/// Asserts that the pose was not lost by metres. Another path reads other fractions of a count: 9
/// mm laterally at 6 m. Long looks add slip: three standard deviations.
fn assert_pose_was_not_lost(summary: &Value) {
    let metres = |key: &str| summary[key].as_f64().unwrap();
    let allowed_m = (1.5 * metres("pose_within_m")).clamp(0.15, 0.5);
    assert!(metres("pose_error_m") < allowed_m, "{summary}");
}

fn first_process(run: &Run, stage: &str) -> u32 {
    let mut found = None;
    wait_until("the stage's process is there", || {
        found = process_with(&run.robot, &format!(" stage {stage} "));
        found.is_some()
    });
    found.unwrap()
}

#[test]
fn each_stage_killed_or_frozen_in_its_start_up_is_started_again_and_the_robot_arrives() {
    let run = Run::start("kf-start", "open-room", FAST);
    for (stage, signal) in kill_and_freeze_in_turn() {
        signal_process(first_process(&run, stage), signal);
    }
    assert_each_restarted(&run.arrives());
}

#[test]
fn each_stage_killed_and_frozen_while_driving_the_robot_arrives_and_every_generation_replays_to_the_bit()
 {
    let slow = format!("{FAST} --set controller.speed_m_s=0.1");
    let mut run = Run::under_way("kf-drive", "obstacle-course", &slow, 1.0);
    run.kill_each(Signal::KILL);
    run.kill_each(Signal::STOP);
    let (summary, directory) = run.arrives_in();
    for stage in STAGES {
        // A robot that stood for long is stalled, and a stall ends with a new planner.
        let replans = summary["replans"].as_u64().filter(|_| stage == "planner");
        assert_eq!(summary["restarts"][stage], 2 + replans.unwrap_or_default(), "{summary}");
    }
    assert_pose_was_not_lost(&summary);
    let deaths = records(&directory.path().join("run/deaths.jsonl"));
    let hit: Vec<_> = deaths.iter().map(|death| &death["stage"]).collect();
    assert_eq!(hit[..5], STAGES);
    // No stage is given up before its beat is due.
    for death in deaths.iter().filter(|death| death["hung"] == true) {
        let stage = find_stage(death["stage"].as_str().unwrap()).unwrap();
        let due_s = stage.deadlines.heartbeat.as_secs_f64();
        assert!(death["noticed_after_s"].as_f64() >= Some(due_s), "{death}");
    }
    let report = replayed_in(&directory);
    assert!(report.equal() >= 10, "{report}");
}

#[test]
fn a_mission_in_lockstep_does_not_hang_when_each_stage_is_killed_or_frozen() {
    let slow = "--set controller.speed_m_s=0.012 --timeout 40000";
    let mut run = Run::under_way("kf-lockstep", "open-room", slow, 1.0);
    for (stage, signal) in kill_and_freeze_in_turn() {
        run.kill_and_await_successor(stage, signal);
    }
    run.arrives();
}

#[test]
fn all_stages_killed_or_frozen_while_the_run_stops_it_ends_in_order() {
    let mut run = Run::start("kf-stop", "open-room", FAST);
    let status = run.wait_until_under_way(0.5);
    run.signal(Signal::TERM);
    for (stage, signal) in kill_and_freeze_in_turn() {
        // A stage that has already ended in order cannot get a signal.
        let _ = kill_process(Pid::from_raw(pid(&status, stage) as i32).unwrap(), signal);
    }
    run.ends(0, "aborted");
}

#[test]
fn a_frozen_stage_that_is_thawed_in_time_goes_on() {
    let mut run = Run::under_way("kf-thaw", "open-room", ENDLESS, 0.5);
    let beats = |status: &Value| {
        let controller = find(status, "controller");
        controller["state"] == "running" && controller["beat_age_s"].as_f64() < Some(0.1)
    };
    // The controller may be replaced before the second command; both are then sent again.
    let goes_on = || {
        let before = run.wait_until("the controller beats", beats);
        operate("kf-thaw", "stage freeze controller");
        let thaw = output(&["stage", "thaw", "controller", "--robot", "kf-thaw"]);
        let after = run.wait_until("the controller beats again", beats);
        let same = pid(&before, "controller") == pid(&after, "controller");
        assert!(!same || thaw.status.success(), "{thaw:?}");
        same.then_some(())
    };
    let mut attempts = std::iter::repeat_with(goes_on).take(20).flatten();
    attempts.next().unwrap();
    drop(attempts);
    run.stop();
}

fn resume(directory: &Path) -> std::process::Command {
    let mut command = firsthand(&["run", "--json", "--resume"]);
    command.arg(directory).stderr(Stdio::inherit());
    command
}

fn is_stopped(status: &Value) -> bool {
    status["order"] == "stopped by an operator"
}

#[test]
fn a_list_is_driven_to_its_end_although_all_and_then_the_supervisor_are_killed_in_between() {
    let robot = "kf-again";
    let mut first = Run::under_way(robot, "open-room", FAST, 4.0);
    operate(robot, "goto 1.0 -0.8 1.8 0.4");
    operate(robot, "goto 3.0 0.4 --heading -90 --append");
    for pid in processes_with(robot, "") {
        signal_process(pid, Signal::KILL);
    }
    first.reap();
    wait_until_all_ended(robot);
    let mut second = start_quietly(&mut resume(&first.directory()));
    wait_for_status(robot, |status| {
        status["order"] == "driving" && status["mission_time_s"].as_f64() > Some(8.0)
    });
    operate(robot, "stop");
    kill(&mut second);
    let third = start_piped(&mut resume(&first.directory()));
    wait_for_status(robot, |status| {
        assert_ne!(status["order"], "driving", "{status}");
        is_stopped(status) && all_run(status)
    });
    operate(robot, "resume");
    let output = third.wait_with_output().unwrap();
    let summary = reached(&output);
    assert_eq!(summary["resumes"], 2, "{summary}");
    assert_eq!(outcomes(&summary), ["replaced", "reached", "reached", "reached"]);
    assert_pose_was_not_lost(&summary);
    let poses = replayed_poses(&first.directory());
    let last = poses.iter().max_by_key(|pose| pose.stamp.tick).unwrap();
    let facing = wrap_angle(last.heading_rad);
    assert!((facing + std::f64::consts::FRAC_PI_2).abs() < 0.2, "it faces {facing}");
    assert_nothing_left(robot);
}
