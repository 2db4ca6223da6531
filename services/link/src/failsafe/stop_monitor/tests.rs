use super::*;
use crate::failsafe::rule;
use crate::testing::{PERIOD_S, mission};

fn stop_monitor() -> StopMonitor {
    StopMonitor::new(&mission(""))
}

/// Time of a frame.
fn at(frame: impl Into<f64>) -> MissionTime {
    MissionTime::from_seconds(PERIOD_S * frame.into())
}

fn does_not_stop(monitor: &StopMonitor) -> Condition {
    monitor.condition(Cause::RobotDoesNotStop, Moment::default())
}

#[test]
fn a_robot_obeys_that_comes_to_rest_in_half_a_second_and_one_that_rolls_on_when_it_has_rested_so_long()
 {
    for (rolls_for_s, disobeys, rest) in
        [(0.5, false, Rest::AtRest), (3.0, true, Rest::AtRest), (9.0, true, Rest::Moving)]
    {
        let mut monitor = stop_monitor();
        let clears = rule(Cause::RobotDoesNotStop).unwrap().clears;
        let (mut rolled, mut first, mut last, mut applies) = (0.0, None, None, false);
        monitor.commanded([900, 900], MissionTime::default());
        for tick in 0..42 {
            let since_s = f64::from(tick) * PERIOD_S - 1.0;
            let speed = if since_s <= 0.0 { 700.0 } else { 560.0 };
            rolled += PERIOD_S * if since_s < rolls_for_s { speed } else { 0.0 };
            monitor.heard([rolled as u16; 2], at(tick));
            if since_s >= 0.0 {
                monitor.commanded([0, 0], at(tick));
            }
            applies = clears.applies(applies, does_not_stop(&monitor));
            if applies {
                first.get_or_insert(since_s);
                last = Some(since_s);
            }
        }
        assert_eq!((first.is_some(), monitor.rest(at(41))), (disobeys, rest), "{rolls_for_s}");
        assert_eq!(applies, rest == Rest::Moving, "{rolls_for_s}");
        assert!(first.is_none_or(|first_s| first_s < 1.5), "{first:?}");
        assert!(last.is_none_or(|last_s| last_s > 3.2), "{last:?}");
    }
}

#[test]
fn a_robot_that_does_not_stop_is_not_taken_for_a_base_that_brakes_slowly_before_it_was_seen_at_rest()
 {
    let slow = Response { acceleration_m_s2: 0.2, ..Response::X80 };
    let (mut monitor, mut rolled) = (stop_monitor(), 0.0);
    monitor.commanded([900, 900], MissionTime::default());
    let mut after = |speed: f64, ticks: std::ops::Range<u32>, monitor: &mut StopMonitor| {
        for tick in ticks {
            rolled += PERIOD_S * speed;
            monitor.heard([rolled as u16; 2], at(tick));
            monitor.commanded([0, 0], at(tick));
        }
        does_not_stop(monitor)
    };
    after(700.0, 0..4, &mut monitor);
    monitor.observe(&Observation::Responds(slow), Moment::default());
    assert_eq!(after(700.0, 4..11, &mut monitor), Condition::Holds);
    assert_eq!(monitor.response, Response::X80);
    after(0.0, 11..15, &mut monitor);
    assert_eq!(monitor.response, slow);
}

#[test]
fn a_robot_that_is_stopped_before_it_obeys_a_command_to_drive_is_not_at_rest_until_that_would_show()
{
    // Also with a loaded machine's frames.
    for period in [PERIOD_S, 0.25] {
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
fn whether_a_robot_rests_or_moves_is_not_known_without_two_new_frames_that_can_be_used() {
    for (speed, seen) in [(0, Rest::AtRest), (100, Rest::Moving)] {
        let mut monitor = stop_monitor();
        assert_eq!(monitor.rest(at(0)), Rest::Unknown, "before any frame");
        let hear = |monitor: &mut StopMonitor, frame: i32| {
            // Encoders that tremble are at rest.
            monitor.heard([(speed * frame + 3 * (frame % 2)) as u16; 2], at(frame));
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
fn a_robot_that_another_host_moves_and_whose_frames_it_takes_does_not_stop() {
    let mut monitor = stop_monitor();
    monitor.commanded([0, 0], MissionTime::default());
    for frame in 0..8_u16 {
        monitor.heard([100 * frame; 2], at(4 * frame));
        assert_ne!(monitor.rest(at(4 * frame)), Rest::AtRest);
    }
    assert_eq!(does_not_stop(&monitor), Condition::Holds);
}
