//! Whole missions through real processes.
#![allow(clippy::unwrap_used, clippy::panic)]

mod support;

use support::{assert_nothing_left, run};

#[test]
fn the_default_mission_reaches_its_target_untouched_for_seeds_1_to_50() {
    for seed in 1..=50 {
        let (code, summary) = run("seeds", "obstacle-course", &["--seed", &seed.to_string()]);
        assert_eq!(summary["outcome"], "reached", "seed {seed}: {summary}");
        assert_eq!(
            (code, summary["collisions"].as_u64()),
            (Some(0), Some(0)),
            "seed {seed}"
        );
    }
    assert_nothing_left("seeds");
}

#[test]
fn the_trap_is_left_from_every_heading() {
    for heading in ["0", "90", "180"] {
        for seed in ["1", "2"] {
            let heading = format!("start.heading_deg={heading}");
            let (_, summary) = run("trap", "trap", &["--set", &heading, "--seed", seed]);
            assert_eq!(
                summary["outcome"], "reached",
                "{heading}, seed {seed}: {summary}"
            );
            assert_eq!(summary["collisions"], 0);
        }
    }
}

#[test]
fn an_empty_room_is_crossed_without_a_safety_event() {
    let (_, summary) = run("room", "open-room", &[]);
    assert_eq!(summary["outcome"], "reached", "{summary}");
    assert_eq!(
        (&summary["safety_events"], &summary["local_updates"]),
        (&0.into(), &0.into())
    );
    let ratio =
        summary["path_length_m"].as_f64().unwrap() / summary["straight_m"].as_f64().unwrap();
    assert!(ratio < 1.01, "the way was {ratio} times the straight line");
}

#[test]
fn a_turn_of_a_quarter_at_the_start_costs_little() {
    let (_, summary) = run("quarter", "open-room", &["--set", "start.heading_deg=90"]);
    assert_eq!(summary["outcome"], "reached", "{summary}");
    let ratio =
        summary["path_length_m"].as_f64().unwrap() / summary["straight_m"].as_f64().unwrap();
    assert!(ratio < 1.1, "the way was {ratio} times the straight line");
}

#[test]
fn a_known_course_is_crossed_faster_than_an_unknown_one() {
    let known = "known.drum=[{at=[1.7,0.2],radius_m=0.35},{at=[3.7,-0.7],radius_m=0.4},\
                 {at=[2.3,-1.7],radius_m=0.3},{at=[3.9,1.2],radius_m=0.3}]";
    let (_, sensing) = run("sensing", "obstacle-course", &[]);
    let (_, knowing) = run("knowing", "obstacle-course", &["--set", known]);
    assert_eq!(knowing["outcome"], "reached", "{knowing}");
    let time = |summary: &serde_json::Value| summary["mission_time_s"].as_f64().unwrap();
    assert!(
        time(&knowing) < time(&sensing),
        "{knowing} against {sensing}"
    );
}

#[test]
fn the_same_seed_gives_the_same_run_to_the_bit() {
    let numbers = |robot: &str| {
        let run = support::Run::start(robot, "obstacle-course", &["--seed", "7"]);
        let (_, mut summary, kept) = run.finish_in();
        // Wall-clock is the one thing that differs.
        for wall_clock in ["tick_latency_us", "full_solve_us", "local_update_us"] {
            summary.as_object_mut().unwrap().remove(wall_clock);
        }
        let checkpoint = |stage: &str| {
            let file = kept.path().join("run").join(format!("{stage}.checkpoint"));
            assert!(file.exists(), "{}", file.display());
        };
        checkpoint("mapper");
        summary
    };
    assert_eq!(numbers("once"), numbers("twice"));
}

#[test]
fn a_target_behind_closed_walls_is_called_unreachable() {
    let walls = "world.wall=[{points=[[2.4,-3.4],[2.4,3.4]]},{points=[[-1.9,1.4],[2.6,1.4]]},\
                 {points=[[-1.9,-1.4],[2.6,-1.4]]},{points=[[-1.7,-1.6],[-1.7,1.6]]}]";
    let arguments = [
        "--set",
        walls,
        "--set",
        "timeout_s=900",
        "--set",
        "mapper.margin_m=0.35",
    ];
    let (code, summary) = run("walled", "open-room", &arguments);
    assert_eq!(
        (code, &summary["outcome"]),
        (Some(3), &"unreachable".into()),
        "{summary}"
    );
    assert_nothing_left("walled");
}

#[test]
fn a_mission_that_takes_too_long_ends_in_time() {
    let (code, summary) = run("late", "obstacle-course", &["--timeout", "5"]);
    assert_eq!(
        (code, &summary["outcome"]),
        (Some(4), &"timeout".into()),
        "{summary}"
    );
}

#[test]
fn a_touch_ends_the_mission_as_a_collision() {
    // Blind: hits beyond 5 cm are not mapped.
    let (code, summary) = run(
        "blind",
        "obstacle-course",
        &["--set", "mapper.map_within_m=0.05"],
    );
    assert_eq!(
        (code, &summary["outcome"]),
        (Some(5), &"collision".into()),
        "{summary}"
    );
    assert!(summary["collisions"].as_u64() > Some(0));
}

#[test]
fn every_run_leaves_a_picture_a_summary_and_logs() {
    let run = support::Run::start("picture", "obstacle-course", &[]);
    let (_, summary, kept) = run.finish_in();
    let directory = kept.path().join("run");
    let picture = std::fs::read_to_string(directory.join("picture.svg")).unwrap();
    assert!(
        picture.starts_with("<svg") || picture.starts_with("<?xml"),
        "{}",
        &picture[..80]
    );
    let written = std::fs::read_to_string(directory.join("summary.json")).unwrap();
    assert_eq!(
        serde_json::from_str::<serde_json::Value>(&written).unwrap(),
        summary
    );
    for stage in [
        "x80-link",
        "dead-reckoning",
        "mapper",
        "planner",
        "controller",
        "x80-sim",
    ] {
        let log = std::fs::read_to_string(directory.join(format!("{stage}.log"))).unwrap();
        assert!(!log.is_empty(), "{stage} logged nothing");
    }
}

#[test]
fn latency_measures_ticks_beside_bare_hops_and_leaves_nothing() {
    let arguments = ["latency", "--rounds", "1", "--json", "--robot", "hops"];
    let output = support::output(&arguments);
    assert!(output.status.success(), "{output:?}");
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    for key in [
        "tick_p50_us",
        "tick_p99_us",
        "hops_p50_us",
        "hops_p99_us",
        "ratio",
    ] {
        assert!(report[key].as_f64().unwrap() > 0.0, "{key}: {report}");
    }
    assert_nothing_left("hops");
}
