//! Tests of robot errors, each set by its own key.

use super::{Robot, after, forward, ideal, motor, robot, send};
use crate::testing::near;
use common::wire::Command;

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
    near(lag_deg(0.0), 0.0, 0.5);
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
