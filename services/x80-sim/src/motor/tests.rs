use super::*;
use crate::noise::Source;
use crate::testing::near;
use common::{mission::Realism, wire::Quantity::*};

const DT: f64 = 0.005;

fn motor(physics: WheelPhysics) -> Motor {
    Motor::new(physics, 2000.0, 2500.0)
}

fn ideal() -> Motor {
    motor(WheelPhysics { lag_s: 0.0, ..WheelPhysics::preset(Realism::Laboratory) })
}

/// The measured loop without jitter.
fn measured() -> WheelPhysics {
    WheelPhysics { noise_counts: 0.0, ..WheelPhysics::preset(Realism::Measured) }
}

/// Returns the speed at every step for `seconds` from mission time `from`.
fn run(motor: &mut Motor, from: f64, seconds: f64) -> Vec<f64> {
    let mut noise = Noise::new(1, Source::Wheels);
    let steps = (seconds / DT).round() as usize;
    (0..steps)
        .map(|step| {
            let counts = motor.step(from + step as f64 * DT, DT, &mut noise);
            motor.turned += counts;
            motor.speed
        })
        .collect()
}

#[test]
fn the_measured_loop_has_its_gain_and_answers_late() {
    let mut motor = motor(measured());
    motor.order(Velocity, 500, None);
    let speeds = run(&mut motor, 0.0, 2.0);
    let steady = 500.0 * measured().gain;
    near(speeds[399], steady, 0.01);
    let late = speeds.iter().position(|s| *s > 0.63 * steady).unwrap() as f64 * DT;
    assert!((0.14..=0.16).contains(&late), "delay and lag are {late} s");
    motor.order(Velocity, 25, None);
    // 25 * 0.78 lies in the dead band.
    assert_eq!(run(&mut motor, 2.0, 2.0)[399], 0.0);
}

#[test]
fn a_turning_wheel_jitters_as_much_as_measured_and_a_standing_one_not_at_all() {
    let mut motor = motor(WheelPhysics::preset(Realism::Measured));
    motor.order(Velocity, 500, Some(100.0));
    let speeds = run(&mut motor, 0.0, 100.0);
    let settled = &speeds[200..];
    let mean = settled.iter().sum::<f64>() / settled.len() as f64;
    let variance = settled.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / settled.len() as f64;
    near(variance.sqrt(), 12.0, 1.0);
    let standing = run(&mut motor, 100.0, 4.0);
    assert_eq!(standing[799], 0.0);
}

#[test]
fn a_wheel_told_to_stand_does_within_three_tenths_of_a_second() {
    for realism in [Realism::Laboratory, Realism::Measured] {
        let mut motor = motor(WheelPhysics::preset(realism));
        motor.order(Velocity, 400, Some(1.0));
        let speeds = run(&mut motor, 0.0, 2.0);
        let after = speeds[200..].iter().position(|speed| *speed == 0.0);
        let seconds = after.map(|step| step as f64 * DT);
        assert!(seconds.is_some_and(|s| s < 0.3), "{realism:?}: {seconds:?}");
    }
}

#[test]
fn a_position_is_reached_the_shorter_way_round_to_the_last_count_by_a_measured_loop() {
    for (position, way) in [(-700, -700.0), (3, 3.0), (1200, 1200.0), (32_700, -68.0)] {
        let mut motor = motor(measured());
        motor.order(Position, position, Some(1.0));
        run(&mut motor, 0.0, 4.0);
        near(motor.turned, way, 1.5);
        assert_eq!(motor.speed, 0.0, "{way}");
    }
}

#[test]
fn half_a_pulse_width_stands_a_full_one_is_top_speed_and_8000_about_the_half_move_nothing() {
    let mut motor = ideal();
    for (width, speed) in
        [(16_383, 0.0), (16_384 - 8000, 0.0), (16_383 + 8000, 0.0), (32_767, 2000.0), (0, -2000.0)]
    {
        motor.order(Pwm, width, None);
        near(run(&mut motor, 0.0, 0.1)[19], speed, 1e-6);
    }
    motor.order(Pwm, 16_384 + 8100, None);
    assert!(run(&mut motor, 0.0, 0.1)[19] > 0.0);
}

#[test]
fn suspending_stops_and_resuming_does_not_start() {
    let mut motor = ideal();
    motor.order(Velocity, 400, None);
    motor.enable(false);
    motor.enable(true);
    run(&mut motor, 0.0, 1.0);
    assert_eq!(motor.turned, 0.0);
}
