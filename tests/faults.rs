//! Robots that do not get on, each pinned by a fault put into a running stage: every recovery frees one, and the last
//! says that it could not.

use crate::support::{
    self, Run, STAGES, assert_nothing_left, find, in_own_process, operate, output, records,
};
use common::{
    bus::Bus,
    clock::MissionTime,
    domain::Domain,
    samples::{FaultAnswer, FaultKind, FaultSample, name, name_str},
    topics,
    waiter::Waiter,
};
use serde_json::Value;

/// At this speed the mission has thousands of ticks: seconds to be broken in, in lockstep, which does not
/// care how loaded the machine is.
const SLOW: [&str; 4] = ["--set", "controller.speed_m_s=0.004", "--timeout", "20000"];
const PAPER: [&str; 2] = ["--set", "method=\"paper\""];

/// `firsthand fault`, which must succeed.
fn inject(robot: &str, stage: &str, fault: &str) {
    operate(robot, &["fault", stage, fault]);
}

/// What `firsthand` says when it refuses.
fn refusal(arguments: &[&str]) -> String {
    let output = output(arguments);
    assert!(!output.status.success(), "{arguments:?}: {output:?}");
    String::from_utf8(output.stderr).unwrap()
}

/// How many of them were met by `recovery`.
fn count(stalls: &[Value], recovery: &str) -> usize {
    stalls
        .iter()
        .filter(|stall| stall["recovery"] == recovery)
        .count()
}

/// A mission of open-room in which `stage` is broken on the way: summary, stalls, and what the supervisor logged.
fn broken(
    robot: &str,
    stage: &str,
    fault: &str,
    arguments: &[&str],
) -> (Value, Vec<Value>, String) {
    let mut run = Run::start(robot, "open-room", &[&SLOW[..], arguments].concat());
    run.wait_until("the robot drives", |status| {
        status["order"] == "driving" && status["mission_time_s"].as_f64() > Some(1.0)
    });
    inject(robot, stage, fault);
    let (_, summary, kept) = run.finish_in();
    let directory = kept.path().join("run");
    let log = std::fs::read_to_string(directory.join("supervisor.log")).unwrap();
    let stalls = records(&directory.join("stalls.jsonl"));
    assert_eq!(summary["replans"], count(&stalls, "replan"), "{stalls:?}");
    assert_eq!(summary["resets"], count(&stalls, "reset"), "{stalls:?}");
    assert_eq!(
        log.matches("the robot stalls").count(),
        stalls.len(),
        "{log}"
    );
    assert_nothing_left(robot);
    (summary, stalls, log)
}

#[test]
fn a_robot_on_a_saddle_comes_free_by_a_fresh_planner() {
    let (summary, stalls, _) = broken("saddle", "planner", "saddle", &[]);
    assert_eq!(summary["outcome"], "reached", "{summary}");
    assert_eq!(
        (&stalls[0]["cause"], &stalls[0]["recovery"]),
        (&"still".into(), &"replan".into())
    );
    assert_eq!(count(&stalls, "reset"), 0, "{stalls:?}");
}

#[test]
fn a_robot_pinned_by_a_corrupted_field_comes_free_by_a_fresh_planner_by_either_method() {
    for (robot, method) in [("astray", &[][..]), ("astray-p", &PAPER[..])] {
        let (summary, stalls, _) = broken(robot, "planner", "corrupt-field", method);
        assert_eq!(summary["outcome"], "reached", "{summary}");
        assert_eq!(stalls[0]["recovery"], "replan", "{stalls:?}");
        assert_eq!(count(&stalls, "reset"), 0, "{stalls:?}");
    }
}

#[test]
fn a_robot_inside_a_margin_that_no_plan_leaves_comes_free_by_a_forgotten_belief_by_either_method() {
    for (robot, method) in [("inside", &[][..]), ("inside-p", &PAPER[..])] {
        let (summary, stalls, _) = broken(robot, "mapper", "hazard-around-robot", method);
        assert_eq!(summary["outcome"], "reached", "{summary}");
        let first = stalls.iter().find(|stall| stall["recovery"] == "reset");
        assert_eq!(first.unwrap()["cause"], "inside_hazard", "{stalls:?}");
    }
}

#[test]
fn a_robot_cut_off_for_good_ends_unreachable_with_a_picture_that_says_so() {
    let mut run = Run::start("cut-off", "open-room", &SLOW);
    run.wait_until("the robot drives", |status| status["order"] == "driving");
    inject("cut-off", "mapper", "cut-off");
    let (code, summary, kept) = run.finish_in();
    assert_eq!(
        (code, &summary["outcome"]),
        (Some(3), &"unreachable".into()),
        "{summary}"
    );
    let directory = kept.path().join("run");
    let stalls = records(&directory.join("stalls.jsonl"));
    let recoveries: Vec<_> = stalls.iter().map(|stall| &stall["recovery"]).collect();
    assert_eq!(
        recoveries,
        ["reset", "reset", "reset", "give_up"],
        "{stalls:?}"
    );
    assert!(
        stalls.iter().all(|stall| stall["cause"] == "cut_off"),
        "{stalls:?}"
    );
    assert_eq!(summary["resets"], 3, "{summary}");
    let picture = std::fs::read_to_string(directory.join("picture.svg")).unwrap();
    for words in [
        ">unreachable<",
        summary["reason"].as_str().unwrap(),
        "sensed, with margin",
        "no way to the target",
    ] {
        assert!(
            picture.contains(words),
            "the picture does not say {words:?}"
        );
    }
    assert_nothing_left("cut-off");
}

#[test]
fn a_stage_that_spins_is_aborted_as_hung() {
    let mut run = Run::start("spins", "open-room", &["--pace", "4"]);
    run.wait_until_under_way(1.0);
    inject("spins", "controller", "spin");
    run.wait_until("it is replaced", |status| {
        find(status, "controller")["generation"] == 2
            && find(status, "controller")["state"] == "running"
    });
    let death = run.records("deaths.jsonl").remove(0);
    assert_eq!(
        (&death["stage"], &death["hung"]),
        (&"controller".into(), &true.into())
    );
    let (_, summary) = run.finish();
    assert_eq!(summary["outcome"], "reached", "{summary}");
    assert_nothing_left("spins");
}

#[test]
fn a_stage_that_beats_and_answers_nothing_is_replaced_and_nobody_behind_it() {
    let slow = [
        "--pace",
        "4",
        "--set",
        "controller.speed_m_s=0.02",
        "--timeout",
        "2000",
    ];
    let mut run = Run::start("mutes", "open-room", &slow);
    run.wait_until_under_way(1.0);
    // The link has no input from a stage that it owes an answer for.
    for stage in STAGES.into_iter().skip(1) {
        let status = run.wait_until("all run and it drives", |status| {
            let mut stages = STAGES.iter().map(|stage| find(status, stage));
            status["order"] == "driving" && stages.all(|stage| stage["state"] == "running")
        });
        let generation =
            |status: &Value, stage: &str| find(status, stage)["generation"].as_u64().unwrap();
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
        assert_eq!(
            (&death["stage"], &death["hung"]),
            (&stage.into(), &true.into())
        );
        // It beat until its end.
        assert!(death["beat_age_s"].as_f64().unwrap() < 0.5, "{death}");
    }
    run.signal(rustix::process::Signal::TERM);
    run.finish();
    assert_nothing_left("mutes");
}

/// Ask the planner for a fault past the command line; what it answered.
fn ask_planner(robot: &str, although_real: bool) -> FaultAnswer {
    let bus = Bus::join(&Domain::of(robot.parse().unwrap()), "careless").unwrap();
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
        assert!(
            began.elapsed() < support::PATIENCE,
            "the planner says nothing"
        );
        waiter.wait(support::PATIENCE).unwrap();
        while let Some(beat) = health.take().unwrap() {
            if name_str(&beat.stage) == "planner" && beat.last_fault == request.id {
                return FaultAnswer::from_byte(beat.fault_answer);
            }
        }
    }
}

#[test]
fn a_real_robot_is_not_broken_unless_it_is_meant_neither_by_the_command_line_nor_by_the_stage() {
    in_own_process(|| {
        // An address makes it real. Nobody answers there: it never moves.
        let address = ["--set", "robot.address=\"127.0.0.1:9\"", "--pace", "1"];
        let mut run = Run::start("metal", "open-room", &address);
        run.wait_until("its stages run", |status| {
            find(status, "planner")["state"] == "running"
        });
        let fault = ["fault", "planner", "saddle", "--robot", "metal"];
        let said = refusal(&fault);
        assert!(said.contains("--break-a-real-robot"), "{said}");
        assert_eq!(ask_planner("metal", false), FaultAnswer::Refused);
        assert_eq!(ask_planner("metal", true), FaultAnswer::Taken);
        let meant = output(&[&fault[..], &["--break-a-real-robot"]].concat());
        assert!(meant.status.success(), "{meant:?}");
        run.signal(rustix::process::Signal::INT);
        run.finish();
        assert_nothing_left("metal");
    });
}

#[test]
fn a_fault_that_nobody_has_is_refused_with_those_there_are() {
    let said = refusal(&["fault", "mapper", "saddle", "--robot", "nobody"]);
    assert!(
        said.contains("hazard-around-robot") && said.contains("spin"),
        "{said}"
    );
    let said = refusal(&["fault", "wheel", "spin"]);
    assert!(said.contains("dead-reckoning"), "{said}");
    let said = refusal(&["fault", "mapper", "spin", "--robot", "nobody"]);
    assert!(said.contains("nobody"), "{said}");
}
