//! Tests of robot errors, each set by its own key.

use super::{Robot, after, forward, ideal, motor, robot, send};
use crate::testing::near;
use common::wire::{Command, counts_between};

fn driven(text: &str, command: Command, ticks: u32) -> Robot {
    let mut robot = robot(text);
    send(&mut robot, command);
    after(&mut robot, ticks);
    robot
}

#[test]
fn a_larger_right_wheel_curves_the_path_to_the_left_and_a_wider_track_turns_less() {
    let with = |key: &str, command, ticks| driven(key, command, ticks).ground_truth();
    let command = forward(562, None);
    let straight = with("", command, 28);
    let curved = with("simulation.wheels.diameter_ratio = 1.01", command, 28);
    assert_eq!((straight.heading, straight.y), (0.0, 0.0));
    assert_eq!(curved.right_counts, straight.right_counts);
    // The rims differ by 0.01 / 1.005 of the distance.
    let want = straight.x * 0.01 / 1.005 / ideal("").body().track_m;
    near(curved.heading, want, 1e-9);
    assert!(curved.y > 0.0 && curved.omega > 0.0, "{curved:?}");
    let command = Command::velocity([Some(300); 2], None);
    let nominal = with("", command, 14);
    let wide = with("simulation.wheels.track_scale = 1.02", command, 14);
    assert_eq!(wide.right_counts, nominal.right_counts);
    let ratio = nominal.heading / wide.heading;
    near(ratio, 1.02, 1e-9);
}

#[test]
fn an_aged_range_lags_a_turn_by_age_times_turn_rate() {
    // The beam has zero width and meets a rough wall: range + forward_m = 1.5 m / cos(heading).
    let wall = "world.wall = [{ points = [[1.5, -9], [1.5, 9]] }]\n\
        [simulation.wheels]\nlag_s = 0\n\
        [simulation.sonar]\ncone_deg = 0\nlobe_deg = 0\nnoise_m = 0\nnoise_per_m = 0\n";
    let lag_deg = |age_s: f64| {
        let text = format!("{wall}age_s = {age_s}");
        let mission = ideal(&text);
        let (body, forward_m) = (mission.body(), mission.sonar.forward_m);
        let counts = 1.4 * body.track_m / 2.0 / body.metres_per_count();
        let command = Command::velocity([Some(counts as i16); 2], None);
        let robot = &mut driven(&text, command, 3);
        let truth = robot.ground_truth();
        near(truth.omega, 1.4, 0.01);
        let range = f64::from(truth.sonar_cm) / 100.0;
        truth.heading.to_degrees() - (1.5 / (range + forward_m)).acos().to_degrees()
    };
    assert!(lag_deg(0.0).abs() < 0.5, "{}", lag_deg(0.0));
    // The robot turns for 0.07 s at 1.4 rad/s.
    near(lag_deg(0.07), 5.6, 0.5);
    // Ranges are at most a tick old.
    let tick_deg = 1.4_f64.to_degrees() / 7.0;
    near(lag_deg(0.9), tick_deg, 0.5);
}

#[test]
fn wheels_count_on_at_a_contact_where_they_slip_and_not_where_they_stall() {
    let counted = |slip: f64| {
        let text = format!(
            "simulation.wheels.contact_slip = {slip}\nworld.wall = [{{ points = [[0.5, -1], [0.5, 1]] }}]"
        );
        let truth = driven(&text, forward(562, None), 28).ground_truth();
        near(truth.x, 0.31, 1e-3);
        let way = f64::from(truth.right_counts) * ideal("").body().metres_per_count();
        (way, truth.v)
    };
    let (stalled, slipping) = (counted(0.0), counted(1.0));
    near(stalled.0, 0.31, 0.005);
    // The robot drives for four seconds at 0.25 m/s, less the lag of the speed loop.
    near(slipping.0, 0.985, 0.02);
    assert!(stalled.1 < 0.01 && slipping.1 > 0.24, "{stalled:?} {slipping:?}");
}

#[test]
fn a_held_motor_draws_several_times_the_current_of_a_rolling_one_and_a_standing_one_the_least() {
    let currents = |text: &str, counts: i16| {
        let mut robot = driven(text, forward(counts, None), 14);
        let [left, right, ..] = motor(&mut robot).currents;
        [left, right]
    };
    let [rolls, _] = currents("", 1200);
    let wall = "world.wall = [{ points = [[0.5, -1], [0.5, 1]] }]";
    let [held, _] = currents(wall, 1200);
    let [slips, _] = currents(&format!("simulation.wheels.contact_slip = 1\n{wall}"), 1200);
    assert!(held > 4 * rolls && slips > rolls && slips < held, "{held} {slips} {rolls}");
    let block = "simulation.block = [{ wheels = 'right', from_s = 1 }]";
    let [free, blocked] = currents(block, 1200);
    assert!((free, blocked) == (rolls, held), "{free} {blocked}");
    assert!(currents(wall, 0)[0] < rolls);
}

#[test]
fn a_blocked_wheel_stands_while_the_block_lasts_and_its_robot_turns_about_it() {
    let block = "simulation.block = [{ wheels = 'left', from_s = 1, until_s = 3 }]";
    let driven_for = |ticks| driven(block, forward(562, None), ticks).ground_truth();
    let (before, during, after) = (driven_for(7), driven_for(20), driven_for(28));
    assert!(before.heading.abs() < 1e-6 && during.heading > 1.5, "{before:?} {during:?}");
    assert_eq!(driven_for(14).left_counts, during.left_counts);
    assert!(counts_between(during.left_counts, after.left_counts) > 300, "{after:?}");
}

#[test]
fn what_is_low_is_heard_at_middle_ranges_only_and_touched_and_a_sill_is_passed_over() {
    let driven_to = |top_m: f64| {
        let text = format!(
            "[simulation]\nrealism = 'measured'\n\
             [simulation.sonar]\nedge_share = 1\nsilence_share = 0\nfalse_echo_share = 0\n\
             [[world.wall]]\npoints = [[1.7, -1], [1.7, 1]]\ntop_m = {top_m}"
        );
        let mut robot = robot(&text);
        send(&mut robot, forward(562, None));
        let (mut outside, mut inside) = (0, 0);
        for _ in 0..70 {
            let truth = after(&mut robot, 1);
            let ahead = 1.7 - truth.x - 0.1915;
            let heard = u32::from(truth.sonar_cm < 255);
            // Beyond 1.2 m the box's edge is too weak. Below 0.08 m / tan(15 degrees) = 0.3 m the
            // beam passes above it.
            if !(0.27..1.25).contains(&ahead) {
                outside += heard;
            } else if (0.35..1.15).contains(&ahead) {
                inside += heard;
            }
        }
        (outside, inside, robot.ground_truth())
    };
    let (outside, inside, truth) = driven_to(0.1);
    assert!(outside == 0 && inside > 10, "{outside} {inside}");
    assert_eq!(truth.contacts, 1, "{truth:?}");
    assert!(truth.x < 1.52, "{truth:?}");
    let sill = driven_to(0.02).2;
    assert_eq!(sill.contacts, 0, "{sill:?}");
    assert!(sill.x > 1.7, "{sill:?}");
}

#[test]
fn a_resumed_robot_has_the_wheels_and_the_silences_it_had() {
    let text = "seed = 4\n[simulation.wheels]\ndiameter_spread = 0.05\n[simulation.sonar]\nsilence_share = 0.5\nsilence_mean_s = 60";
    let curvature = |robot: &mut Robot| {
        let before = robot.ground_truth();
        send(robot, forward(562, None));
        robot.advance_to(robot.time + 4.0);
        let after = robot.ground_truth();
        let way = (after.x - before.x).hypot(after.y - before.y);
        (after.heading - before.heading) / way
    };
    let mut first = robot(text);
    let had = curvature(&mut first);
    assert!(had.abs() > 0.01, "{had}");
    first.come_to_rest(|_| ());
    let saved = first.saved_state();
    let mut resumed = Robot::restored(&ideal(text), &saved);
    assert_eq!(resumed.saved_state().silent, saved.silent);
    near(curvature(&mut resumed), had, 1e-3);
}
