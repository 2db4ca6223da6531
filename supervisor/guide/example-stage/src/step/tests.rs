use super::*;
use common::samples::Stamp;
use std::path::Path;

fn odometer() -> Odometer {
    Odometer::new(&Mission::parse("target = [3, 0]", Path::new("test.toml")).unwrap())
}

/// The sums after the robot is at x metres, two ticks a second.
fn step(odometer: &mut Odometer, tick: u64, x_m: f64) -> (f64, f64) {
    let stamp = Stamp {
        tick,
        stamp_ns: tick * 500_000_000,
        ..Stamp::default()
    };
    let pose = PoseSample {
        stamp,
        x_m,
        ..PoseSample::default()
    };
    let sums = odometer.step(&pose, stamp.time());
    (sums.driven_m, sums.moving_s)
}

#[test]
fn forth_and_back_adds_up_and_standing_takes_no_time() {
    let mut odometer = odometer();
    assert_eq!(step(&mut odometer, 0, 1.0), (0.0, 0.0));
    assert_eq!(step(&mut odometer, 1, 1.5), (0.5, 0.5));
    assert_eq!(step(&mut odometer, 2, 1.5), (0.5, 0.5));
    assert_eq!(step(&mut odometer, 3, 1.25), (0.75, 1.0));
}

#[test]
fn a_tick_given_twice_counts_once() {
    let mut odometer = odometer();
    step(&mut odometer, 0, 0.0);
    step(&mut odometer, 1, 0.5);
    assert_eq!(step(&mut odometer, 1, 0.5), (0.5, 0.5));
}

#[test]
fn the_next_process_goes_on_where_the_last_one_was_killed() {
    let mut first = odometer();
    step(&mut first, 0, 0.0);
    step(&mut first, 1, 0.5);
    let mut second = odometer();
    second.restore(*first.state()).unwrap();
    assert_eq!(step(&mut second, 2, 0.75), (0.75, 1.0));
}
