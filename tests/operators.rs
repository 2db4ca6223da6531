//! Test of a stage that is held until an operator releases it.

use crate::support::{Run, find, operate};

#[test]
fn a_stage_that_dies_again_and_again_is_held_until_an_operator_releases_it() {
    let mut run = Run::under_way("held", "open-room", "--pace 4", 1.0);
    // The next generation fails at its start.
    let checkpoint = run.directory().join("mapper.checkpoint");
    std::fs::remove_file(&checkpoint).unwrap();
    std::fs::create_dir(&checkpoint).unwrap();
    operate("held", "stage kill mapper");
    run.wait_until("it is held", |status| find(status, "mapper")["state"] == "held");
    let status = run
        .wait_until("the robot is stopped", |status| status["order"] == "stopped, a stage is held");
    for stage in status["stages"].as_array().unwrap() {
        let others = stage["name"] != "mapper";
        assert!(!others || stage["restarts"] == 0, "a sibling was touched: {status}");
    }
    let deaths = run.records("deaths.jsonl");
    assert_eq!(deaths[0]["cause"]["signalled"]["signal"], 9, "{deaths:?}");
    assert_eq!(deaths[0]["next"], "start_now", "{deaths:?}");
    let last = deaths.last().unwrap();
    assert_eq!((&last["cause"]["exited"], &last["next"]), (&1.into(), &"hold".into()));
    let log_tail = last["log_tail"].as_str().unwrap();
    assert!(log_tail.contains("mapper.checkpoint"), "{log_tail}");
    std::fs::remove_dir(&checkpoint).unwrap();
    operate("held", "stage restart mapper");
    run.arrives();
}
