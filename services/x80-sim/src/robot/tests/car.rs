//! Tests of a robot with steering.

use common::{
    ground_truth::GroundTruthTick,
    wire::{Command, counts_between},
};

use super::{Robot, after, robot, send};

/// Drives a car for `ticks` at these counts/s: the wheel forward, the steering left.
fn drive(robot: &mut Robot, wheel: i16, steering: i16, ticks: u32) -> GroundTruthTick {
    send(robot, Command::velocity([Some(-wheel), Some(steering)], None));
    after(robot, ticks)
}

#[test]
fn the_steering_takes_its_time_ends_at_its_stop_and_turns_no_standing_car() {
    let mut car = robot("robot.model = 'car'\nsimulation.wheels.lag_s = 0");
    // 120 degrees/s are 1200 counts/s, the limit of any request; 30 degrees are 300 counts.
    for (steering, ticks, counts) in [(5000, 1, 171), (5000, 14, 300), (-5000, 14, -300)] {
        let truth = drive(&mut car, 0, steering, ticks);
        assert!((counts_between(0, truth.right_counts) - counts).abs() <= 1, "{truth:?}");
        assert_eq!((truth.x, truth.y, truth.heading), (0.0, 0.0, 0.0));
    }
}
