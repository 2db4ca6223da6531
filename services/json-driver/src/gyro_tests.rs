use common::driver::Base as _;

use crate::{Driver as _, tests::driver};

/// Returns ticks' turns, by sequence and angle, and any refusal. Wheels turn the robot by 0.1 rad a
/// tick; its gyro reports `said`.
fn told(said: &[Option<f64>]) -> (Vec<(u64, f64)>, Option<String>) {
    let mut driver = driver();
    let body = driver.body;
    let (mut turns, mut refused) = (Vec::new(), None);
    for (tick, gyro) in said.iter().enumerate() {
        let side = 0.05 * tick as f64 * body.track_m / body.wheel_radius_m;
        let gyro = gyro.map_or(String::new(), |gyro| format!(",\"gyro\":{gyro}"));
        let line = format!("{{\"wheels\":[{},{side}],\"speeds\":[0,0]{gyro}}}\n", -side);
        refused = driver.hear(line.as_bytes()).refused.or(refused);
        let rounded = |turn: f64| (turn * 1e6).round() / 1e6;
        turns.extend(driver.turn_for_tick().map(|it| (it.sequence, rounded(it.turn_rad))));
    }
    (turns, refused.map(|why| why.to_string()))
}

#[test]
fn the_turns_of_ticks_are_those_of_a_gyro_that_was_seen_to_agree_and_begin_anew_after_a_gap() {
    let said = [0.0, 0.11, 0.22, 0.33].map(Some);
    let gap = [None, Some(0.55), Some(0.66), Some(20.0), Some(20.11)];
    let (turns, refused) = told(&[&said[..], &gap].concat());
    let want = [(2, 0.0), (3, 0.11), (5, 0.0), (6, 0.11), (8, 0.0), (9, 0.11)];
    assert_eq!((&turns[..], refused), (&want[..], None));
}

#[test]
fn a_gyro_in_degrees_or_clockwise_is_not_used_and_named() {
    for factor in [57.3, -1.0] {
        let said = Vec::from_iter((0..8).map(|tick| Some(0.1 * factor * f64::from(tick) / 4.0)));
        let (turns, refused) = told(&said);
        assert!(turns.is_empty(), "{turns:?}");
        assert!(refused.unwrap().contains("in the unit of the protocol"));
    }
    let heard = driver().hear(b"{\"gyro\":1}\n");
    assert!(heard.refused.unwrap().to_string().contains("send both"));
}
