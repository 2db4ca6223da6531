//! Tests of recovery from injected stage faults.

use crate::support::{
    self, Run, STAGES, all_run, assert_ended, assert_nothing_left, find, generation,
    in_own_process, logged, operate, records, refused,
};
use common::{
    bus::Bus,
    clock::MissionTime,
    samples::{FaultAnswer, FaultKind, FaultSample, name, name_str},
    topics,
    waiter::Waiter,
};
use serde_json::Value;

/// Options that give a loaded machine time for a fault. Laboratory odometry keeps the arrival sure
/// after a hundred looks and turns.
const SLOW: [&str; 6] = [
    "--set",
    "controller.speed_m_s=0.012",
    "--set",
    "robot.odometry={slip=0.001,diameter_ratio_sd=0,track_scale_sd=0,distance_scale_sd=0}",
    "--timeout",
    "20000",
];
const PAPER: [&str; 2] = ["--set", "method=\"paper\""];

fn inject(robot: &str, stage: &str, fault: &str) {
    operate(robot, &["stage", "fault", stage, fault]);
}

fn count(stalls: &[Value], recovery: &str) -> usize {
    stalls.iter().filter(|stall| stall["recovery"] == recovery).count()
}

/// Breaks `stage` in a mission of open-room, which must still arrive. Returns its stalls.
fn broken(robot: &str, stage: &str, fault: &str, arguments: &[&str]) -> Vec<Value> {
    let mut run = Run::start(robot, "open-room", &[&SLOW[..], arguments].concat());
    run.wait_until("the robot drives", |status| {
        status["order"] == "driving" && status["mission_time_s"].as_f64() > Some(1.0)
    });
    inject(robot, stage, fault);
    let (code, summary, directory) = run.finish_in();
    assert_ended(code, &summary, 0, "reached");
    let directory = directory.path().join("run");
    let stalls = records(&directory.join("stalls.jsonl"));
    assert_eq!(summary["replans"], count(&stalls, "replan"), "{stalls:?}");
    assert_eq!(summary["resets"], count(&stalls, "reset"), "{stalls:?}");
    let logged = logged(&directory, "supervisor", &["recovery=", "cause="]);
    assert_eq!(logged, stalls.len(), "{stalls:?}");
    assert_nothing_left(robot);
    stalls
}

#[test]
fn a_robot_on_a_saddle_comes_free_by_a_fresh_planner() {
    let stalls = broken("saddle", "planner", "saddle", &[]);
    assert_eq!(stalls[0]["cause"], "still", "{stalls:?}");
    assert_eq!(stalls[0]["recovery"], "replan", "{stalls:?}");
    assert_eq!(count(&stalls, "reset"), 0, "{stalls:?}");
}

#[test]
fn a_robot_pinned_by_a_corrupted_field_comes_free_by_a_fresh_planner_by_either_method() {
    for (robot, method) in [("astray", &[][..]), ("astray-p", &PAPER[..])] {
        let stalls = broken(robot, "planner", "corrupt-field", method);
        assert_eq!(stalls[0]["recovery"], "replan", "{stalls:?}");
        assert_eq!(count(&stalls, "reset"), 0, "{stalls:?}");
    }
}

#[test]
fn a_robot_inside_a_margin_that_no_plan_leaves_comes_free_by_a_reset_map_by_either_method() {
    for (robot, method) in [("inside", &[][..]), ("inside-p", &PAPER[..])] {
        let stalls = broken(robot, "mapper", "hazard-around-robot", method);
        let first = stalls.iter().find(|stall| stall["recovery"] == "reset");
        // A slow robot may be pinned before it is far inside.
        let cause = &first.unwrap()["cause"];
        assert!(cause == "inside_hazard" || cause == "pinned", "{stalls:?}");
    }
}

#[test]
fn a_robot_cut_off_for_good_ends_unreachable_with_a_picture_that_says_so() {
    let mut run = Run::start("cut-off", "open-room", &SLOW);
    run.wait_until("the robot drives", |status| status["order"] == "driving");
    inject("cut-off", "mapper", "cut-off");
    let (code, summary, directory) = run.finish_in();
    assert_ended(code, &summary, 3, "unreachable");
    let directory = directory.path().join("run");
    let stalls = records(&directory.join("stalls.jsonl"));
    let recoveries: Vec<_> = stalls.iter().map(|stall| &stall["recovery"]).collect();
    assert_eq!(recoveries, ["reset", "reset", "reset", "give_up"], "{stalls:?}");
    assert!(stalls.iter().all(|stall| stall["cause"] == "cut_off"), "{stalls:?}");
    assert_eq!(summary["resets"], 3, "{summary}");
    let picture = std::fs::read_to_string(directory.join("picture.svg")).unwrap();
    for field in ["outcome", "reason"] {
        let value = summary[field].as_str().unwrap();
        assert!(picture.contains(value), "the picture does not say {value:?}");
    }
    assert_nothing_left("cut-off");
}

#[test]
fn a_stage_that_spins_is_aborted_as_hung() {
    let mut run = Run::under_way("spins", "open-room", &["--pace", "4"], 1.0);
    inject("spins", "controller", "spin");
    run.wait_until("it is replaced", |status| {
        generation(status, "controller") == 2 && find(status, "controller")["state"] == "running"
    });
    let death = run.records("deaths.jsonl").remove(0);
    assert_eq!(death["stage"], "controller", "{death}");
    assert_eq!(death["hung"], true, "{death}");
    run.arrives();
}

#[test]
fn a_stage_that_beats_and_answers_nothing_is_replaced_and_nobody_behind_it() {
    let slow = ["--pace", "4", "--set", "controller.speed_m_s=0.02", "--timeout", "2000"];
    let mut run = Run::under_way("mutes", "open-room", &slow, 1.0);
    // The link owes no answer to other stages' outputs.
    for stage in STAGES.into_iter().skip(1) {
        let status = run.wait_until("all run and it drives", |status| {
            status["order"] == "driving" && all_run(status)
        });
        inject("mutes", stage, "mute");
        let after = run.wait_until("it is replaced", |after| {
            generation(after, stage) > generation(&status, stage)
        });
        for other in STAGES {
            let more = u64::from(other == stage);
            assert_eq!(
                generation(&after, other),
                generation(&status, other) + more,
                "{stage}: {other}"
            );
        }
        let death = run.records("deaths.jsonl").pop().unwrap();
        assert_eq!(death["stage"], stage, "{death}");
        assert_eq!(death["hung"], true, "{death}");
        // The stage still sent heartbeats when it was found hung.
        assert!(death["noticed_after_s"].as_f64().unwrap() < 0.5, "{death}");
    }
    run.stop();
}

/// Requests a fault on the bus. Returns the planner's answer.
fn ask_planner(robot: &str, although_real: bool) -> FaultAnswer {
    let bus = Bus::join(&support::domain(robot), "careless").unwrap();
    let mut health = bus.reader(&topics::HEALTH).unwrap();
    let mut waiter = Waiter::default();
    waiter.on(bus.wakeup(&topics::HEALTH).unwrap());
    let request = FaultSample {
        id: 1 + u64::from(although_real),
        stage: name("planner"),
        kind: FaultKind::Saddle.into(),
        although_real: although_real.into(),
        ..FaultSample::default()
    };
    let mut faults = bus.writer(&topics::FAULTS, 1).unwrap();
    faults.publish(0, MissionTime::default(), request).unwrap();
    let began = std::time::Instant::now();
    loop {
        assert!(began.elapsed() < support::PATIENCE, "the planner says nothing");
        waiter.wait(support::PATIENCE).unwrap();
        while let Some(beat) = health.next_sample().unwrap() {
            if name_str(&beat.stage) == "planner" && beat.last_fault == request.id {
                return beat.fault_answer();
            }
        }
    }
}

#[test]
fn a_real_robot_is_not_broken_unless_it_is_meant_neither_by_the_command_line_nor_by_the_stage() {
    in_own_process(|| {
        // An address makes the robot a real one. It never moves, because the address is unused.
        let address = ["--set", "robot.address=\"127.0.0.1:9\"", "--pace", "1"];
        let mut run = Run::start("metal", "open-room", &address);
        run.wait_until("its stages run", |status| find(status, "planner")["state"] == "running");
        let fault = ["stage", "fault", "planner", "saddle", "--robot", "metal"];
        refused(&fault, "real-robot", &["--break-a-real-robot"]);
        assert_eq!(ask_planner("metal", false), FaultAnswer::Refused);
        assert_eq!(ask_planner("metal", true), FaultAnswer::Taken);
        operate("metal", &["stage", "fault", "planner", "saddle", "--break-a-real-robot"]);
        run.stop();
    });
}
