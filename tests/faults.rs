//! Faults injected into stages' processes. `simulation` breaks fields and maps.

use crate::support::{Run, STAGES, all_run, find, generation, operate, printed, refused};

#[test]
fn a_stage_that_spins_or_beats_and_answers_nothing_is_replaced_and_nobody_behind_it() {
    let robot = "mutes";
    let slow = "--pace 4 --set controller.speed_m_s=0.02 --timeout 2000";
    let mut run = Run::under_way(robot, "open-room", slow, 1.0);
    // The link owes no answer to other stages' outputs.
    let mutes = STAGES.into_iter().skip(1).map(|stage| (stage, "mute"));
    for (stage, fault) in mutes.chain([("controller", "spin")]) {
        let status = run.wait_until("all run and it drives", |status| {
            status["order"] == "driving" && all_run(status)
        });
        operate(robot, &format!("stage fault {stage} {fault}"));
        let after = run.wait_until("it is replaced", |after| {
            generation(after, stage) > generation(&status, stage)
        });
        for other in STAGES {
            let expected = generation(&status, other) + u64::from(other == stage);
            assert_eq!(generation(&after, other), expected, "{stage}: {other}");
        }
        let death = run.records("deaths.jsonl").pop().unwrap();
        assert_eq!((&death["stage"], &death["hung"]), (&stage.into(), &true.into()), "{death}");
        // A mute stage still sends heartbeats when it is found hung.
        let beats = death["noticed_after_s"].as_f64() < Some(0.5);
        assert_eq!(beats, fault == "mute", "{death}");
    }
    run.stop();
}

#[test]
fn a_real_robot_is_not_broken_unless_it_is_meant() {
    // An address makes the robot a real one. It never moves, because the address is unused.
    let address = "--set robot.address='127.0.0.1:9' --pace 1";
    let mut run = Run::start("metal", "open-room", address);
    run.wait_until("its stages run", |status| find(status, "planner")["state"] == "running");
    let fault = ["stage", "fault", "planner", "saddle", "--robot", "metal"];
    refused(&fault, "real-robot", &["--break-a-real-robot"]);
    printed(&[&fault[..], &["--break-a-real-robot"]].concat());
    run.stop();
}
