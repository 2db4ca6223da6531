//! Whole missions in lockstep, in one process.

#![allow(clippy::unwrap_used)]

use common::mission::Mission;
use console::missions;
use mission_control::{
    outcome::Outcome,
    target_list::{TargetOutcome, TargetResult},
};
use simulation::Scenario;
use summary::Summary;

use Outcome::*;

/// Settings under which every arrival is sure, in a time that suffices for every robot.
const SURE: [&str; 2] = ["sure_within_m=9", "timeout_s=900"];
const PAPER: &str = "method='paper'";
/// Speed below which a car, or a robot by the paper's method, touches nothing with any seed.
const SLOW: &str = "controller.speed_m_s=0.2";
const CAR: &str = "robot.model='car'";
const KOBUKI: &str = "robot={model='kobuki',rate_hz=10}";
const ARDUINO: &str =
    concat!(env!("CARGO_MANIFEST_DIR"), "/../../supervisor/guide/example-arduino/");

/// Drives a shipped mission with further settings.
fn drive(mission: &str, settings: &[&str]) -> Summary {
    let settings: Vec<_> = SURE.iter().chain(settings).map(ToString::to_string).collect();
    summary_of(&missions::load(mission, &settings).unwrap())
}

fn summary_of(mission: &Mission) -> Summary {
    let ran = Scenario::lockstep(mission).run();
    assert!(ran.broken.is_none(), "{}: {:?}", mission.name, ran.broken);
    ran.summary.unwrap()
}

#[track_caller]
fn ends(mission: &str, settings: &[&str], outcome: Outcome) -> Summary {
    let summary = drive(mission, settings);
    assert_eq!(summary.outcome, outcome, "{mission}, {settings:?}: {summary:?}");
    summary
}

#[track_caller]
fn arrives_untouched(mission: &str, settings: &[&str]) -> Summary {
    let summary = ends(mission, settings, Reached);
    assert_eq!(summary.collisions, Some(0), "{mission}, {settings:?}");
    summary
}

/// Drives a mission file without a touch.
#[track_caller]
fn text_ends(text: &str, outcome: Outcome) -> Summary {
    let text = format!("sure_within_m = 9\nseed = 3\n{text}");
    let summary = summary_of(&Mission::parse(&text, "text.toml").unwrap());
    assert_eq!((summary.outcome, summary.collisions), (outcome, Some(0)), "{text}: {summary:?}");
    summary
}

fn seeds(last: u64) -> impl Iterator<Item = String> {
    (1..=last).map(|seed| format!("seed={seed}"))
}

#[test]
fn the_default_mission_and_a_hall_with_five_people_are_crossed_untouched_for_seeds_1_to_10() {
    std::thread::scope(|threads| {
        for seed in seeds(10) {
            threads.spawn(move || {
                arrives_untouched("obstacle-course", &[&seed]);
                arrives_untouched("walkers", &[&seed]);
            });
        }
    });
}

#[test]
fn by_the_papers_method_it_does_for_seeds_1_to_8() {
    // The path is twice as long, so with measured wheels the arrival would be unsure. Laboratory
    // wheels are better.
    let wheels = "robot.odometry={diameter_ratio_sd=0,slip=0.001}";
    for seed in seeds(8) {
        arrives_untouched("obstacle-course", &[PAPER, SLOW, wheels, &seed]);
    }
}

#[test]
fn wheels_and_sonar_as_measured_under_a_fading_radio_touch_nothing() {
    let fading = "simulation.radio={outage_share=0.2,outage_mean_s=0.5}";
    for seed in seeds(8) {
        let settings = ["simulation.realism='measured'", fading, &seed];
        let summary = drive("obstacle-course", &settings);
        // Measured wheels drift, and this test ignores the error of the believed target.
        let arrived = [Reached, ReachedUnsure, WrongPlace];
        assert!(arrived.contains(&summary.outcome), "{seed}: {summary:?}");
        assert_eq!(summary.collisions, Some(0), "{seed}");
    }
}

#[test]
fn a_robot_with_a_gyro_and_wheels_that_nobody_calibrated_knows_its_place() {
    let gyro = "robot={protocol='json',gyro=true}";
    // The mission's own are those of calibrated wheels.
    let known = "robot.odometry={diameter_ratio_sd=0.005,track_scale_sd=0.015}";
    let wheels = "simulation.wheels={diameter_spread=0.008,track_spread=0.025}";
    for seed in seeds(6) {
        let settings = [known, wheels, gyro, &seed];
        let summary = arrives_untouched("obstacle-course", &settings);
        assert!(summary.pose_error_m < Some(0.3), "{seed}: {summary:?}");
    }
}

#[test]
fn mission_time_and_timeout_count_the_time_in_which_nobody_hears_the_robot() {
    let out = "simulation.radio.outage_share=0.2";
    let silent_share = |summary: &Summary| {
        let heard_s = (summary.ticks as f64 - 1.0) / 7.0;
        1.0 - heard_s / summary.mission_time_s
    };
    let silent = silent_share(&drive("obstacle-course", &[out]));
    assert!((0.1..0.3).contains(&silent), "{silent}");
    let late = ends("obstacle-course", &[out, "timeout_s=8"], Timeout);
    assert!((7.5..=8.0).contains(&late.mission_time_s), "{late:?}");
    let never = silent_share(&drive("obstacle-course", &[]));
    assert!(never.abs() < 1e-4, "{never}");
}

#[test]
fn a_finer_grid_is_no_more_dangerous() {
    for cells in ["perimeter.cells=100", "perimeter.cells=256", "perimeter.cells=512"] {
        for seed in seeds(2) {
            arrives_untouched("obstacle-course", &[cells, &seed]);
        }
    }
}

#[test]
fn the_trap_is_left_from_every_heading_by_either_method() {
    for heading in ["start.heading_deg=0", "start.heading_deg=90", "start.heading_deg=180"] {
        for seed in seeds(2) {
            arrives_untouched("trap", &[heading, &seed]);
            arrives_untouched("trap", &[PAPER, heading, &seed]);
        }
    }
}

#[test]
fn a_car_crosses_the_course_untouched_for_seeds_1_to_5() {
    for seed in seeds(5) {
        arrives_untouched("obstacle-course", &[CAR, SLOW, &seed]);
    }
}

#[test]
fn a_car_that_faces_a_wall_too_near_to_turn_ends_with_its_turning_radius() {
    // The pocket is open behind, and a robot that turns on the spot leaves it.
    let wall = "world.wall=[{points=[[0.5,0.6],[0.5,-0.6]]},{points=[[0.5,0.6],[-0.3,0.6]]},\
                {points=[[0.5,-0.6],[-0.3,-0.6]]}]";
    let long = "timeout_s=600";
    arrives_untouched("open-room", &[wall, long]);
    let summary = ends("open-room", &[CAR, wall, long], Unreachable);
    assert_eq!(summary.collisions, Some(0), "{summary:?}");
    assert!(summary.reason.contains("0.31 m"), "{summary:?}");
}

#[test]
fn an_empty_room_or_hall_is_crossed_straight_ahead_and_without_a_safety_event() {
    let summary = arrives_untouched("open-room", &[]);
    let restarts: u32 = summary.restarts.values().sum();
    assert_eq!((summary.safety_events, restarts), (0, 0), "{summary:?}");
    let detour = |summary: &Summary| summary.path_length_m / summary.straight_m;
    assert!(detour(&summary) < 1.01, "{summary:?}");
    let turned = arrives_untouched("open-room", &["start.heading_deg=90"]);
    assert!(detour(&turned) < 1.1, "{turned:?}");
    let hall = "target = [7, 0]\nsensors = 'front'\nsimulation.realism = 'laboratory'\n\
                perimeter = { width_m = 20, centre = [3.5, 0] }";
    text_ends(hall, Reached);
}

#[test]
fn by_the_papers_method_a_known_course_is_crossed_faster_than_an_unknown_one() {
    let known = "known.drum=[{at=[1.7,0.2],radius_m=0.35},{at=[3.7,-0.7],radius_m=0.4},\
                 {at=[2.3,-1.7],radius_m=0.3},{at=[3.9,1.2],radius_m=0.3}]";
    let laboratory = "simulation.realism='laboratory'";
    let sensing = drive("obstacle-course", &[PAPER, SLOW, laboratory]);
    let knowing = ends("obstacle-course", &[PAPER, SLOW, laboratory, known], Reached);
    assert!(knowing.mission_time_s < sensing.mission_time_s, "{knowing:?} against {sensing:?}");
}

#[test]
fn a_touch_ends_the_mission_as_a_collision() {
    // The robot is blind, because hits beyond 5 cm are not mapped.
    let summary = ends("obstacle-course", &[PAPER, "mapper.map_within_m=0.05"], Collision);
    assert!(summary.collisions > Some(0), "{summary:?}");
}

#[test]
fn a_target_where_the_robot_stands_is_reached_in_a_finite_ratio() {
    let printed = ends("open-room", &["target=[0,0]"], Reached).to_string();
    assert!(!printed.contains("NaN") && !printed.contains("inf"), "{printed}");
}

#[test]
fn a_target_behind_closed_walls_is_called_unreachable() {
    let walls = "world.wall=[{points=[[2.4,-3.4],[2.4,3.4]]},{points=[[-1.9,1.4],[2.6,1.4]]},\
                 {points=[[-1.9,-1.4],[2.6,-1.4]]},{points=[[-1.7,-1.6],[-1.7,1.6]]}]";
    ends("open-room", &[walls], Unreachable);
    ends("open-room", &[walls, PAPER, "mapper.margin_m=0.35"], Unreachable);
}

#[test]
fn a_wheel_that_is_blocked_for_5_s_costs_a_fresh_planner_and_for_ever_the_target() {
    let block = "simulation.block=[{wheels='left',from_s=7,until_s=12}]";
    let blocked = ends("open-room", &[SLOW, block], Reached);
    assert!(blocked.replans > 0, "{blocked:?}");
    let block = "simulation.block=[{wheels='both',from_s=7}]";
    let held = ends("open-room", &[SLOW, block], Unreachable);
    assert!(held.reason.contains("held fast") && held.replans > 1, "{held:?}");
}

#[test]
fn by_its_laser_a_robot_whose_wheels_are_not_what_they_should_be_knows_where_it_is() {
    for seed in seeds(3) {
        let settings = [KOBUKI, "controller.speed_m_s=0.5", "simulation.realism='harsh'", &seed];
        let summary = ends("obstacle-course", &settings, Reached);
        assert!(summary.pose_error_m < Some(0.12), "{seed}: {summary:?}");
    }
}

#[test]
fn a_laser_that_is_late_and_turns_slowly_and_says_so_places_the_robot_like_a_prompt_one() {
    for laser in [
        "simulation.laser={delay_s=0.2,sweep_s=0}",
        "simulation.laser={delay_s=0,sweep_s=0.2}",
        "simulation.laser={delay_s=0.3,sweep_s=0.2}",
    ] {
        let settings = ["robot.model='kobuki'", "seed=2", laser];
        let summary = ends("obstacle-course", &settings, Reached);
        assert!(summary.pose_error_m < Some(0.1), "{laser}: {summary:?}");
    }
}

#[test]
fn a_long_robot_turns_behind_a_gap_narrower_than_its_length_and_refuses_to_in_a_corridor() {
    let gap = "[{ points = [[1, -4], [1, -0.35]] }, { points = [[1, 0.35], [1, 4]] }]";
    let corridor = "[{ points = [[0.8, 0.4], [3.2, 0.4], [3.2, -0.4], [0.8, -0.4]] }]";
    for (targets, walls, outcome) in [
        ("[[2.5, 0.5, 90]]", gap, Reached),
        ("[[2.5, 0]]\nstart.heading_deg = 90", gap, Reached),
        ("[[2.5, 0]]\nstart = [0, 1.2, -135]", gap, Reached),
        ("[[2.5, 0]]\nstart = [0, -1.2, 180]", gap, Reached),
        ("[[2.2, 0, 90]]", corridor, Unreachable),
        ("[[2.2, 0], [-0.5, 0, 180]]", corridor, Reached),
    ] {
        let text = format!(
            "targets = {targets}\nperimeter = {{ width_m = 8, centre = [1.5, 0] }}\n\
             world.wall = {walls}\n[robot]\nmodel = 'jackal'\n\
             footprint = [[-0.45, -0.2], [0.45, -0.2], [0.45, 0.2], [-0.45, 0.2]]"
        );
        let summary = text_ends(&text, outcome);
        assert!(summary.departed_s > Some(0.0), "from its start: {summary:?}");
    }
}

#[test]
fn a_heavy_rectangle_passes_the_loose_end_of_a_wall_untouched_as_stated_and_as_found() {
    for stated in ["robot.response = { delay_s = 0.1, acceleration_m_s2 = 0.3 }", ""] {
        let text = format!(
            "target = [7.05, -0.44]\nstart.heading_deg = -76.5\ntimeout_s = 144\n{stated}\n\
             perimeter = {{ width_m = 10.7, centre = [3.53, 0.12] }}\nrobot.model = 'jackal'\n\
             simulation.wheels = {{ acceleration_m_s2 = 0.3, delay_s = 0.1 }}\n\
             world.drum = [{{ at = [2.604, -0.51], radius_m = 0.254 }},\
                           {{ at = [3.682, -0.471], radius_m = 0.234 }}]\n\
             world.wall = [{{ points = [[-1.2, -1.897], [8.25, -1.897], [8.25, 1.897],\
                                        [-1.2, 1.897], [-1.2, -1.897]] }},\
                           {{ points = [[1.894, 0.466], [2.344, 2.141]] }}]"
        );
        text_ends(&text, Reached);
    }
}

#[test]
fn a_robot_that_bumps_into_a_low_board_or_comes_to_a_hole_marks_it_and_goes_around() {
    for (world, touches) in [
        ("world.box=[{at=[2,0],size_m=[0.3,0.8],top_m=0.1}]", true),
        ("simulation.hole=[{at=[2,0],size_m=[0.4,0.8]}]", false),
    ] {
        let settings = [KOBUKI, SLOW, "simulation.goes_on_after_contact=true", world];
        let summary = ends("open-room", &settings, Reached);
        let found = (summary.collisions > Some(0), summary.replans, summary.resets);
        assert_eq!(found, (touches, 0, 0), "no wheel goes over the hole: {summary:?}");
    }
}

#[test]
fn two_lasers_of_half_a_circle_cross_the_course_untouched() {
    let lasers = "robot.sensor=[{name='front',kind='scan',forward_m=0.1,bearing_deg=0,\
                  field_of_view_deg=180,beams=91},{name='back',kind='scan',forward_m=0.1,\
                  bearing_deg=180,field_of_view_deg=180,beams=91}]";
    arrives_untouched("obstacle-course", &[KOBUKI, lasers]);
}

#[test]
fn a_low_battery_doubles_the_time_and_an_empty_one_ends_the_mission_with_the_reason() {
    let full = ends("open-room", &["simulation.battery.start_v=7.8"], Reached);
    let low = ends("open-room", &["simulation.battery.start_v=6.5"], Reached);
    assert!(low.mission_time_s > 1.5 * full.mission_time_s, "{low:?} against {full:?}");
    let empty = ends("open-room", &["simulation.battery.start_v=5.9"], Aborted);
    assert_eq!(empty.cause.as_deref(), Some("battery empty"), "{empty:?}");
    assert!((1.9..3.0).contains(&empty.mission_time_s), "{empty:?}");
}

#[test]
fn the_targets_of_a_list_are_reached_in_turn_and_each_has_its_time_and_truth() {
    let text = "targets = [[1.5, -1.0], [2.5, 0.5, 180], [0.5, 0.8]]\n\
                world.drum = [{ at = [2.0, 0.0], radius_m = 0.2 }]";
    let summary = text_ends(text, Reached);
    let targets = &summary.targets;
    assert!(targets.len() == 3 && targets.is_sorted_by_key(|it| it.at_s), "{summary:?}");
    let is_there = |it: &TargetResult| {
        it.outcome == TargetOutcome::Reached && it.truth_m.is_some_and(|off_m| off_m < 0.5)
    };
    assert!(targets.iter().all(is_there), "{summary:?}");
    let legs = 1.5_f64.hypot(1.0) + 1.0_f64.hypot(1.5) + 2.0_f64.hypot(0.3);
    assert!((summary.straight_m - legs).abs() < 1e-9, "{summary:?}");
}

#[test]
fn an_arduino_arrives_by_sonars_by_an_rplidar_and_by_the_gyro_of_wheels_nobody_calibrated() {
    for mission in ["robot.toml", "laser.toml"] {
        arrives_untouched(&format!("{ARDUINO}{mission}"), &[]);
    }
    for seed in seeds(6) {
        let settings = ["robot.gyro=true", "simulation.realism='measured'", &seed];
        let summary = arrives_untouched(&format!("{ARDUINO}robot.toml"), &settings);
        assert!(summary.pose_error_m < Some(0.15), "{seed}: {summary:?}");
    }
}
