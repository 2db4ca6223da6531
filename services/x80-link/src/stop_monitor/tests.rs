use super::*;
use std::path::Path;

/// From frame to frame, seconds: 7 Hz.
const PERIOD: f64 = 1.0 / 7.0;

fn stop_monitor() -> StopMonitor {
    StopMonitor::new(&Mission::parse("target = [3, 0]", Path::new("test.toml")).unwrap())
}

/// A robot told to stand at 1 s whose wheels go on at `speed(seconds since)` counts/s. When it does_not_stop, seconds since.
fn told_to_stand(speed: impl Fn(f64) -> f64) -> (StopMonitor, Option<f64>) {
    let mut stop_monitor = stop_monitor();
    let (mut rolled, mut first) = (0.0, None);
    stop_monitor.commanded([900, 900], MissionTime::default());
    for tick in 0..42 {
        let time = f64::from(tick) * PERIOD;
        rolled += PERIOD
            * if time <= 1.0 {
                700.0
            } else {
                speed(time - 1.0)
            };
        let now = MissionTime::from_seconds(time);
        stop_monitor.heard([rolled as u16; 2], now);
        if time >= 1.0 {
            stop_monitor.commanded([0, 0], now);
        }
        if stop_monitor.does_not_stop() {
            first.get_or_insert(time - 1.0);
        }
    }
    (stop_monitor, first)
}

#[test]
fn a_robot_that_comes_to_rest_half_a_second_after_it_was_told_to_obeys() {
    let (stop_monitor, did_not_stop) = told_to_stand(|since| if since < 0.5 { 560.0 } else { 0.0 });
    assert_eq!(did_not_stop, None);
    assert!(stop_monitor.is_at_rest());
}

#[test]
fn a_robot_that_rolls_on_disobeys_within_one_and_a_half_seconds_and_is_not_at_rest() {
    let (stop_monitor, did_not_stop) = told_to_stand(|_| 560.0);
    assert!(did_not_stop.unwrap() < 1.5, "{did_not_stop:?}");
    assert!(!stop_monitor.is_at_rest());
}

#[test]
fn a_robot_that_did_not_obey_does_when_it_has_been_seen_at_rest() {
    let (stop_monitor, did_not_stop) = told_to_stand(|since| if since < 3.0 { 560.0 } else { 0.0 });
    assert!(did_not_stop.is_some() && !stop_monitor.does_not_stop());
    assert!(stop_monitor.is_at_rest());
}

#[test]
fn encoders_that_tremble_are_at_rest() {
    let mut stop_monitor = stop_monitor();
    for tick in 0..4 {
        let now = MissionTime::from_seconds(f64::from(tick) * PERIOD);
        stop_monitor.heard([10 + 3 * (tick % 2) as u16, 7], now);
    }
    assert!(stop_monitor.is_at_rest());
}

#[test]
fn every_means_is_tried_in_turn() {
    let mut stop_monitor = stop_monitor();
    let mut tried = Vec::new();
    for _ in 0..4 {
        stop_monitor.try_next();
        tried.push(stop_monitor.method());
    }
    assert_eq!(
        tried,
        [
            StopMethod::Disable,
            StopMethod::Pwm,
            StopMethod::Suspend,
            StopMethod::Velocity
        ]
    );
}
