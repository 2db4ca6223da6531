use super::*;
use crate::failsafe::{monitor::Clears, rule};
use std::path::Path;

/// Frame period at 7 Hz, seconds.
const PERIOD: f64 = 1.0 / 7.0;

fn stop_monitor() -> StopMonitor {
    StopMonitor::new(&Mission::parse("target = [3, 0]", Path::new("test.toml")).unwrap())
}

struct Watch {
    monitor: StopMonitor,
    clears: Clears,
    does_not_stop: bool,
}

fn last() -> MissionTime {
    MissionTime::from_seconds(41.0 * PERIOD)
}

/// Stops a robot at 1 s whose wheels then turn at `speed(seconds since)` counts/s. Returns when the
/// monitor found that it does not stop, seconds.
fn told_to_stand(speed: impl Fn(f64) -> f64) -> (Watch, Option<f64>) {
    let mut watch = Watch {
        monitor: stop_monitor(),
        clears: rule(Cause::RobotDoesNotStop).unwrap().clears,
        does_not_stop: false,
    };
    let (mut rolled, mut first) = (0.0, None);
    watch.monitor.commanded([900, 900], MissionTime::default());
    for tick in 0..42 {
        let time = f64::from(tick) * PERIOD;
        rolled += PERIOD * if time <= 1.0 { 700.0 } else { speed(time - 1.0) };
        let now = MissionTime::from_seconds(time);
        watch.monitor.heard([rolled as u16; 2], now);
        if time >= 1.0 {
            watch.monitor.commanded([0, 0], now);
        }
        let condition = watch.monitor.condition(Cause::RobotDoesNotStop, Moment::default());
        watch.does_not_stop = watch.clears.applies(watch.does_not_stop, condition);
        if watch.does_not_stop {
            first.get_or_insert(time - 1.0);
        }
    }
    (watch, first)
}

#[test]
fn a_robot_that_comes_to_rest_half_a_second_after_it_was_told_to_obeys() {
    let (watch, did_not_stop) = told_to_stand(|since| if since < 0.5 { 560.0 } else { 0.0 });
    assert_eq!(did_not_stop, None);
    assert_eq!(watch.monitor.rest(last()), Rest::AtRest);
}

#[test]
fn a_robot_that_rolls_on_disobeys_within_one_and_a_half_seconds_and_is_not_at_rest() {
    let (watch, did_not_stop) = told_to_stand(|_| 560.0);
    assert!(did_not_stop.unwrap() < 1.5, "{did_not_stop:?}");
    assert_eq!(watch.monitor.rest(last()), Rest::Moving);
}

#[test]
fn a_robot_that_does_not_stop_is_not_taken_for_a_base_that_brakes_slowly_before_it_was_seen_at_rest()
 {
    let slow = Response { acceleration_m_s2: 0.2, ..Response::X80 };
    let (mut monitor, mut rolled) = (stop_monitor(), 0.0);
    monitor.commanded([900, 900], MissionTime::default());
    let mut after = |speed: f64, ticks: std::ops::Range<u32>, monitor: &mut StopMonitor| {
        for tick in ticks {
            rolled += PERIOD * speed;
            let now = MissionTime::from_seconds(f64::from(tick) * PERIOD);
            monitor.heard([rolled as u16; 2], now);
            monitor.commanded([0, 0], now);
        }
        monitor.condition(Cause::RobotDoesNotStop, Moment::default())
    };
    after(700.0, 0..4, &mut monitor);
    monitor.observe(&Observation::Responds(slow), Moment::default());
    assert_eq!(after(700.0, 4..11, &mut monitor), Condition::Holds);
    assert_eq!(monitor.response, Response::X80);
    after(0.0, 11..15, &mut monitor);
    assert_eq!(monitor.response, slow);
}

#[test]
fn a_robot_that_did_not_obey_does_when_it_has_been_seen_at_rest() {
    let (watch, did_not_stop) = told_to_stand(|since| if since < 3.0 { 560.0 } else { 0.0 });
    assert!(did_not_stop.is_some() && !watch.does_not_stop);
    assert_eq!(watch.monitor.rest(last()), Rest::AtRest);
}

#[test]
fn a_robot_that_is_stopped_before_it_obeys_a_command_to_drive_is_not_at_rest_until_that_would_show()
{
    // Also with a loaded machine's frames.
    for period in [PERIOD, 0.25] {
        let mut stop_monitor = stop_monitor();
        let time = |frame: i32| MissionTime::from_seconds(1.0 + f64::from(frame) * period);
        for frame in -4..=0 {
            stop_monitor.heard([0; 2], time(frame));
        }
        assert_eq!(stop_monitor.rest(time(0)), Rest::AtRest);
        stop_monitor.commanded([900, 900], MissionTime::from_seconds(1.01));
        stop_monitor.commanded([0, 0], MissionTime::from_seconds(1.02));
        let known = (1..6).map(time).find(|now| {
            stop_monitor.heard([0; 2], *now);
            stop_monitor.rest(*now) == Rest::AtRest
        });
        assert!(known.unwrap().seconds() - 1.02 >= 0.35, "{period}: {known:?}");
    }
}

#[test]
fn encoders_that_tremble_are_at_rest() {
    let mut stop_monitor = stop_monitor();
    for tick in 0..4 {
        let now = MissionTime::from_seconds(f64::from(tick) * PERIOD);
        stop_monitor.heard([10 + 3 * (tick % 2) as u16, 7], now);
    }
    assert_eq!(stop_monitor.rest(MissionTime::from_seconds(3.0 * PERIOD)), Rest::AtRest);
}

#[test]
fn whether_a_robot_rests_or_moves_is_not_known_without_two_new_frames_that_can_be_used() {
    let at = |frame: i32| MissionTime::from_seconds(f64::from(frame) * PERIOD);
    for (speed, seen) in [(0, Rest::AtRest), (100, Rest::Moving)] {
        let mut monitor = stop_monitor();
        assert_eq!(monitor.rest(at(0)), Rest::Unknown, "before any frame");
        let hear = |monitor: &mut StopMonitor, frame: i32| {
            monitor.heard([(speed * frame) as u16; 2], at(frame));
            monitor.rest(at(frame))
        };
        assert_eq!(hear(&mut monitor, 0), Rest::Unknown, "one frame");
        for frame in 1..4 {
            hear(&mut monitor, frame);
        }
        assert_eq!(hear(&mut monitor, 4), seen);
        assert_eq!(monitor.rest(at(5)), seen, "a frame late");
        assert_eq!(monitor.rest(at(7)), Rest::Unknown, "frames end");
        for frame in [7, 10, 13] {
            // Motion between them is known.
            let seen = if seen == Rest::Moving { seen } else { Rest::Unknown };
            assert_eq!(hear(&mut monitor, frame), seen, "frames too far apart");
        }
        for frame in 14..17 {
            hear(&mut monitor, frame);
        }
        assert_eq!(hear(&mut monitor, 17), seen);
        let implausible = Observation::Motor([0; 2].into(), Counts::Implausible);
        monitor.observe(&implausible, Moment::default());
        assert_eq!(monitor.rest(at(17)), Rest::Unknown, "a frame that cannot be used");
    }
}

#[test]
fn every_method_is_tried_in_turn_while_the_robot_does_not_stop() {
    let mut stop_monitor = stop_monitor();
    let mut tried = |from_ms: u64, to_ms: u64, does_not_stop| {
        let times = (from_ms..to_ms).step_by(20);
        let tried = times.filter_map(|ms| {
            let now = MissionTime(ms * 1_000_000);
            let takes = stop_monitor.takes_next_method(does_not_stop, now);
            takes.then_some((ms, stop_monitor.method))
        });
        tried.collect::<Vec<_>>()
    };
    assert_eq!(tried(0, 1000, true), [(0, 1), (300, 2), (600, 3), (900, 4)]);
    assert_eq!(tried(1000, 1100, false), []);
    assert_eq!(tried(1100, 1120, true), [(1100, 5)]);
}

#[test]
fn a_robot_that_another_host_moves_and_whose_frames_it_takes_does_not_stop() {
    let mut monitor = stop_monitor();
    monitor.commanded([0, 0], MissionTime::default());
    for frame in 0..8_u16 {
        let now = MissionTime::from_seconds(4.0 * PERIOD * f64::from(frame));
        monitor.heard([100 * frame; 2], now);
        assert_ne!(monitor.rest(now), Rest::AtRest);
    }
    assert_eq!(monitor.condition(Cause::RobotDoesNotStop, Moment::default()), Condition::Holds);
}
