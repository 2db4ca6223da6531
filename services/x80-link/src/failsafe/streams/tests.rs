use super::*;
use common::samples::RangeReading;
use std::path::Path;

const MS: u64 = 1_000_000;

fn streams(text: &str) -> Streams {
    let text = format!("target = [3, 0]\nsensors = 'front'\n{text}");
    let mut streams = Streams::new(&Mission::parse(&text, Path::new("test.toml")).unwrap());
    streams.observe(&Observation::Found { again: false }, Moment::default());
    streams
}

/// Take a standard frame with a reading of the front sonar.
fn range(streams: &mut Streams, machine_ns: u64) {
    let front = RangeReading { status: RangeStatus::Nothing.into(), ..RangeReading::default() };
    let now = Moment { time: MissionTime(machine_ns), machine_ns };
    streams.observe(&Observation::Readings(&[front]), now);
}

/// Take motor frames after these intervals, milliseconds. Returns the time of the last frame.
fn frames(streams: &mut Streams, intervals: impl IntoIterator<Item = u64>) -> u64 {
    let mut now = 0;
    streams.motor(MissionTime(now), now);
    for interval in intervals {
        now += interval * MS;
        streams.motor(MissionTime(now), now);
    }
    now
}

#[test]
fn a_robot_that_answers_without_motor_frames_is_asked_for_them_with_growing_pauses() {
    let mut streams = streams("");
    let last = frames(&mut streams, [143; 5]);
    assert_eq!(streams.motor_frames(last + 749 * MS), Motor::Regular);
    assert_eq!(streams.motor_frames(last + 750 * MS), Motor::Silent);
    let asks = |from: u64, to: u64, streams: &mut Streams| {
        let times = (from..to).step_by(10);
        times.filter(|at| streams.wants_request(at * MS)).count()
    };
    assert_eq!(asks(1500, 60_000, &mut streams), 9);
    streams.motor(MissionTime(0), 60_000 * MS);
    range(&mut streams, 60_000 * MS);
    assert_eq!(asks(60_000, 60_700, &mut streams), 0);
}

#[test]
fn three_frames_a_second_are_told_with_their_rate_and_a_fading_radio_is_not() {
    let mut slow = streams("");
    let last = frames(&mut slow, [333; 9]);
    let Motor::Slow(hz) = slow.motor_frames(last) else {
        panic!();
    };
    assert!((hz - 3.0).abs() < 0.01, "{hz}");
    let mut fading = streams("");
    let last = frames(&mut fading, [143, 700, 500, 143, 600, 400, 143, 500, 600]);
    assert_eq!(fading.motor_frames(last), Motor::Regular);
}

#[test]
fn a_front_sonar_without_readings_is_missed_by_a_mission_that_senses_only() {
    for (text, missed) in [("", true), ("sensing = false", false)] {
        let mut streams = streams(text);
        range(&mut streams, 100 * MS);
        assert!(streams.silent_sensor(849 * MS).is_none());
        assert_eq!(streams.silent_sensor(850 * MS).is_some(), missed);
        range(&mut streams, 900 * MS);
        assert!(streams.silent_sensor(1000 * MS).is_none(), "back");
    }
}

#[test]
fn each_sensor_that_the_mission_uses_must_give_valid_readings_and_the_one_that_does_not_is_named() {
    let mission = Mission::parse("target = [3, 0]", Path::new("test.toml")).unwrap();
    for silent in 0..10 {
        let mut streams = Streams::new(&mission);
        let readings: Vec<_> = (0..10)
            .map(|sensor| {
                let is_silent = sensor == silent;
                let status = if is_silent { RangeStatus::Invalid } else { RangeStatus::Nothing };
                RangeReading { sensor, status: status.into(), ..RangeReading::default() }
            })
            .collect();
        let now = Moment { time: MissionTime(900 * MS), machine_ns: 900 * MS };
        streams.observe(&Observation::Readings(&readings), now);
        let row = usize::from(silent);
        let named = streams.silent_sensor(now.machine_ns).map(|sensor| sensor.name.clone());
        assert_eq!(named, Some(mission.sensor_table().swap_remove(row).name));
        assert_eq!(streams.condition(Cause::RangeSilent, now), Condition::Holds);
    }
}
