use serde_json::Value;

use crate::support::{self, Run, assert_ended, assert_nothing_left, printed, run};

#[track_caller]
fn arrives_untouched(robot: &str, mission: &str, arguments: &[&str]) -> Value {
    println!("{arguments:?}");
    let summary = Run::at_own_speed(robot, mission, arguments).arrives();
    assert_eq!(summary["collisions"], 0, "{summary}");
    summary
}

fn detour(summary: &Value) -> f64 {
    let metres = |key: &str| summary[key].as_f64().unwrap();
    metres("path_length_m") / metres("straight_m")
}

#[track_caller]
fn ends(robot: &str, mission: &str, arguments: &[&str], code: i32, outcome: &str) -> Value {
    let (found, summary) = run(robot, mission, arguments);
    assert_ended(found, &summary, code, outcome);
    assert_nothing_left(robot);
    summary
}

const PAPER: [&str; 2] = ["--set", "method=\"paper\""];
/// Speed below which a car, or a robot by the paper's method, touches nothing with any seed.
const SLOW: [&str; 2] = ["--set", "controller.speed_m_s=0.2"];
const MEASURED: [&str; 2] = ["--set", "simulation.realism=\"measured\""];

#[test]
fn the_default_mission_reaches_its_target_untouched_for_seeds_1_to_10() {
    for seed in 1..=10 {
        arrives_untouched("seeds", "obstacle-course", &["--seed", &seed.to_string()]);
    }
}

#[test]
fn a_hall_that_five_people_cross_is_crossed_untouched_for_seeds_1_to_10() {
    for seed in 1..=10 {
        arrives_untouched("walkers", "walkers", &["--seed", &seed.to_string()]);
    }
}

#[test]
fn by_the_papers_method_it_does_for_seeds_1_to_8() {
    // The path is twice as long, so with measured wheels the arrival would be unsure. Laboratory
    // wheels are better.
    let wheels =
        ["--set", "robot.odometry.diameter_ratio_sd=0", "--set", "robot.odometry.slip=0.001"];
    for seed in 1..=8 {
        let seed = seed.to_string();
        let arguments = [&PAPER[..], &SLOW, &wheels, &["--seed", &seed]].concat();
        arrives_untouched("paper", "obstacle-course", &arguments);
    }
}

#[test]
fn wheels_and_sonar_as_measured_under_a_fading_radio_touch_nothing() {
    let fading = [
        "--set",
        "simulation.radio.outage_share=0.2",
        "--set",
        "simulation.radio.outage_mean_s=0.5",
    ];
    for seed in 1..=8 {
        let seed = seed.to_string();
        let arguments = [&MEASURED[..], &fading, &["--seed", &seed]].concat();
        let (_, summary) = run("faded", "obstacle-course", &arguments);
        let outcome = summary["outcome"].as_str().unwrap();
        // Measured wheels drift, and this test ignores the error of the believed target.
        let arrived = ["reached", "reached_unsure", "wrong_place"].contains(&outcome);
        assert!(arrived, "{arguments:?}: {summary}");
        assert_eq!(summary["collisions"], 0, "{arguments:?}");
    }
}

#[test]
fn a_robot_with_a_gyro_and_wheels_that_nobody_calibrated_knows_its_place() {
    // These options follow and replace the mission's own, which are for calibrated wheels.
    let wheels = [
        "--set=robot.odometry={}",
        "--set=simulation.wheels={}",
        "--set=robot.protocol='json'",
        "--set=robot.gyro=true",
    ];
    for seed in 1..=6 {
        let seed = seed.to_string();
        let summary = arrives_untouched(
            "gyro",
            "obstacle-course",
            &[&wheels[..], &["--seed", &seed]].concat(),
        );
        assert!(summary["pose_error_m"].as_f64().unwrap() < 0.3, "{summary}");
    }
}

#[test]
fn mission_time_and_timeout_count_the_time_in_which_nobody_hears_the_robot() {
    let out = ["--set", "simulation.radio.outage_share=0.2"];
    let (_, summary) = run("silences", "obstacle-course", &out);
    let time_s = summary["mission_time_s"].as_f64().unwrap();
    let heard_s = (summary["ticks"].as_f64().unwrap() - 1.0) / 7.0;
    let silent = 1.0 - heard_s / time_s;
    assert!((0.1..0.3).contains(&silent), "{silent}: {summary}");

    let (_, summary) =
        run("silences", "obstacle-course", &[&out[..], &["--timeout", "8"]].concat());
    let time_s = summary["mission_time_s"].as_f64().unwrap();
    assert_eq!(summary["outcome"], "timeout", "{summary}");
    assert!((7.5..=8.0).contains(&time_s), "{summary}");

    let (_, summary) = run("silences", "obstacle-course", &[]);
    let time_s = summary["mission_time_s"].as_f64().unwrap();
    let heard_s = (summary["ticks"].as_f64().unwrap() - 1.0) / 7.0;
    assert!((time_s - heard_s).abs() < 1e-3, "{summary}");
    assert_nothing_left("silences");
}

#[test]
fn a_finer_grid_is_no_more_dangerous() {
    for cells in ["100", "256", "512"] {
        for seed in ["1", "2"] {
            let cells = format!("perimeter.cells={cells}");
            arrives_untouched("grids", "obstacle-course", &["--set", &cells, "--seed", seed]);
        }
    }
}

#[test]
fn the_trap_is_left_from_every_heading_by_either_method() {
    for heading in ["0", "90", "180"] {
        for seed in ["1", "2"] {
            let heading = format!("start.heading_deg={heading}");
            let arguments = ["--set", &heading, "--seed", seed];
            arrives_untouched("trap", "trap", &arguments);
            arrives_untouched("trap-p", "trap", &[&PAPER[..], &arguments].concat());
        }
    }
}

const CAR: [&str; 2] = ["--set", "robot.model=\"car\""];

#[test]
fn a_car_crosses_the_course_untouched_for_seeds_1_to_5() {
    for seed in 1..=5 {
        let seed = seed.to_string();
        let arguments = [&CAR[..], &SLOW, &["--seed", &seed]].concat();
        arrives_untouched("car", "obstacle-course", &arguments);
    }
}

#[test]
fn a_car_that_faces_a_wall_too_near_to_turn_ends_with_its_turning_radius() {
    // The pocket is open behind, and a robot that turns on the spot leaves it.
    let wall = "world.wall=[{points=[[0.5,0.6],[0.5,-0.6]]},{points=[[0.5,0.6],[-0.3,0.6]]},\
                {points=[[0.5,-0.6],[-0.3,-0.6]]}]";
    let arguments = ["--set", wall, "--timeout", "600"];
    arrives_untouched("pocket", "open-room", &arguments);
    let car = [&CAR[..], &arguments].concat();
    let summary = ends("pocket", "open-room", &car, 3, "unreachable");
    assert_eq!(summary["collisions"], 0, "{summary}");
    let reason = summary["reason"].as_str().unwrap();
    assert!(reason.contains("0.31 m"), "{reason}");
}

#[test]
fn an_empty_room_is_crossed_without_a_safety_event() {
    let summary = arrives_untouched("room", "open-room", &[]);
    assert_eq!(summary["safety_events"], 0, "{summary}");
    assert!(detour(&summary) < 1.01, "{summary}");
}

#[test]
fn a_robot_with_a_sonar_alone_crosses_an_empty_hall() {
    let text = "target = [7, 0]\nsensors = 'front'\nperimeter = { width_m = 20, centre = [3.5, 0] }\n\
                simulation.realism = 'laboratory'";
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("hall.toml");
    std::fs::write(&file, text).unwrap();
    arrives_untouched("hall", file.to_str().unwrap(), &[]);
}

#[test]
fn a_turn_of_a_quarter_at_the_start_costs_little() {
    let turned = ["--set", "start.heading_deg=90"];
    let summary = arrives_untouched("quarter", "open-room", &turned);
    assert!(detour(&summary) < 1.1, "{summary}");
}

#[test]
fn by_the_papers_method_a_known_course_is_crossed_faster_than_an_unknown_one() {
    let known = "known.drum=[{at=[1.7,0.2],radius_m=0.35},{at=[3.7,-0.7],radius_m=0.4},\
                 {at=[2.3,-1.7],radius_m=0.3},{at=[3.9,1.2],radius_m=0.3}]";
    let laboratory = [&PAPER[..], &SLOW, &["--set", "simulation.realism='laboratory'"]].concat();
    let (_, sensing) = run("sensing", "obstacle-course", &laboratory);
    let knows = [&laboratory[..], &["--set", known]].concat();
    let (_, knowing) = run("knowing", "obstacle-course", &knows);
    assert_eq!(knowing["outcome"], "reached", "{knowing}");
    let time = |summary: &Value| summary["mission_time_s"].as_f64().unwrap();
    assert!(time(&knowing) < time(&sensing), "{knowing} against {sensing}");
}

#[test]
fn a_target_behind_closed_walls_is_called_unreachable() {
    let walls = "world.wall=[{points=[[2.4,-3.4],[2.4,3.4]]},{points=[[-1.9,1.4],[2.6,1.4]]},\
                 {points=[[-1.9,-1.4],[2.6,-1.4]]},{points=[[-1.7,-1.6],[-1.7,1.6]]}]";
    let evidential = ["--set", walls, "--set", "timeout_s=900"];
    let paper = [&evidential[..], &PAPER, &["--set", "mapper.margin_m=0.35"]].concat();
    for arguments in [&evidential[..], &paper] {
        ends("walled", "open-room", arguments, 3, "unreachable");
    }
}

#[test]
fn a_mission_that_takes_too_long_ends_in_time() {
    ends("late", "obstacle-course", &["--timeout", "5"], 4, "timeout");
}

#[test]
fn a_touch_ends_the_mission_as_a_collision() {
    // The robot is blind, because hits beyond 5 cm are not mapped.
    let blind = [&PAPER[..], &["--set", "mapper.map_within_m=0.05"]].concat();
    let summary = ends("blind", "obstacle-course", &blind, 5, "collision");
    assert!(summary["collisions"].as_u64() > Some(0));
}

#[test]
fn every_run_leaves_a_picture_a_summary_and_logs() {
    let (summary, directory) = Run::start("picture", "open-room", &[]).arrives_in();
    let directory = directory.path().join("run");
    let picture = std::fs::read_to_string(directory.join("picture.svg")).unwrap();
    assert!(picture.starts_with("<svg") && picture.ends_with("</svg>\n"));
    let written = support::records(&directory.join("summary.json"));
    assert_eq!(written, [summary]);
    for process in support::STAGES.iter().copied().chain(["x80-sim"]) {
        assert!(support::logged(&directory, process, &[]) > 0, "{process}");
    }
}

/// Returns the reports of `bench tick` with these arguments, one per regime. The mission lasts a
/// few seconds.
fn latency(robot: &str, arguments: &[&str]) -> Vec<Value> {
    let short = ["bench", "tick", "--rounds", "1", "--set", "timeout_s=5", "--json"];
    let printed = printed(&[&short[..], &["--robot", robot], arguments].concat());
    assert_nothing_left(robot);
    printed.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn latency_measures_ticks_beside_hops_in_both_regimes_and_leaves_nothing() {
    let reports = latency("hops", &["--busy", "1", "--set", "robot.rate_hz=20"]);
    let regimes: Vec<_> = reports.iter().map(|report| &report["regime"]).collect();
    assert_eq!(regimes, ["back to back", "at 20 Hz"]);
    for report in &reports {
        let times = report["times"].as_array().unwrap();
        assert_eq!(times.len(), 2, "{report}");
        for (row, key) in times.iter().flat_map(|row| ["p50_us", "p99_us"].map(|key| (row, key))) {
            assert!(row[key].as_f64() > Some(0.0), "{key}: {report}");
        }
        assert!(report["ratio"].as_f64() > Some(0.0), "{report}");
    }
}

#[test]
fn latency_at_a_rate_is_measured_at_that_rate_alone() {
    let reports = latency(
        "hops-30hz",
        &["--rate", "30", "--set", "timeout_s=12", "--no-record", "--consumers", "0"],
    );
    assert_eq!(reports.len(), 1, "{reports:?}");
    assert_eq!(reports[0]["regime"], "at 30 Hz");
}
