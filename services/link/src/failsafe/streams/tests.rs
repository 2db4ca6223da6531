use super::*;
use crate::testing::*;

fn streams(text: &str) -> Streams {
    let mut streams = Streams::new(&mission(&format!("sensors = 'front'\n{text}")));
    streams.observe(&Observation::Found { again: false }, Moment::default());
    streams
}

const fn moment(ms: u64) -> Moment {
    Moment { time: MissionTime(ms * MS), machine_ns: ms * MS, is_after_pause: false }
}

impl Streams {
    fn hears_front(&mut self, ms: u64) {
        self.observe(&Observation::Readings(&[reading(0, None)]), moment(ms));
    }

    fn hears_motor(&mut self, ms: u64) {
        self.motor(MissionTime(ms * MS), ms * MS);
    }
}

/// Takes motor frames at these intervals, milliseconds. Returns the last time.
fn frames(streams: &mut Streams, intervals: impl IntoIterator<Item = u64>) -> u64 {
    let mut now = 0;
    streams.hears_motor(now);
    for interval in intervals {
        now += interval;
        streams.hears_motor(now);
    }
    now
}

#[test]
fn a_robot_that_answers_without_motor_frames_is_asked_for_them_with_growing_pauses() {
    let mut streams = streams("");
    let last = frames(&mut streams, [143; 5]);
    assert_eq!(streams.motor_frames((last + 749) * MS), Motor::Regular);
    assert_eq!(streams.motor_frames((last + 750) * MS), Motor::Silent);
    let asks = (1500..60_000).step_by(10).filter(|ms| streams.wants_request(ms * MS)).count();
    assert_eq!(asks, 9);
    streams.hears_motor(60_000);
    streams.hears_front(60_000);
    assert!(!(60_000..60_700).step_by(10).any(|ms| streams.wants_request(ms * MS)));
}

#[test]
fn three_frames_a_second_are_told_with_their_rate_and_a_fading_radio_is_not() {
    let mut slow = streams("");
    let last = frames(&mut slow, [333; 9]);
    assert!(matches!(slow.motor_frames(last * MS), Motor::Slow(hz) if (hz - 3.0).abs() < 0.01));
    let words = slow.explain(Cause::FramesSlow, moment(last)).unwrap();
    assert!(words.contains("3.0 motor frames") && words.contains("raise robot.command_limit_s"));
    let mut fading = streams("");
    let last = frames(&mut fading, [143, 700, 500, 143, 600, 400, 143, 500, 600]);
    assert_eq!(fading.motor_frames(last * MS), Motor::Regular);
}

#[test]
fn a_front_sonar_without_readings_is_missed_by_a_mission_that_senses_only() {
    for (text, missed) in [("", true), ("sensing = false", false)] {
        let mut streams = streams(text);
        streams.hears_front(100);
        assert_eq!(streams.silent(849 * MS), None);
        assert_eq!(streams.silent(850 * MS) == Some(Cause::RangeSilent), missed);
        streams.hears_front(900);
        assert_eq!(streams.silent(1000 * MS), None, "back");
    }
}

/// Returns streams with readings of ten sensors, of which the `silent` give no valid one.
fn heard(text: &str, silent: &[u8]) -> Streams {
    let mut streams = Streams::new(&mission(text));
    let mut readings = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9].map(|sensor| reading(sensor, None));
    for sensor in silent {
        readings[usize::from(*sensor)].status = RangeStatus::Invalid.into();
    }
    streams.observe(&Observation::Readings(&readings), moment(900));
    streams
}

/// Returns the cause and explanation while the `silent` give no valid reading.
fn without(text: &str, silent: &[u8]) -> (Option<Cause>, String) {
    let (streams, now) = (heard(text, silent), moment(900));
    let holds = |it: &Cause| streams.condition(*it, now) == Condition::Holds;
    let mut holding = [Cause::RangeSilent, Cause::InfraredSilent].into_iter().filter(holds);
    let cause = holding.next();
    assert_eq!(holding.next(), None);
    (cause, cause.and_then(|cause| streams.explain(cause, now)).unwrap_or_default())
}

#[test]
fn each_sensor_that_the_mission_uses_must_give_valid_readings_and_the_one_that_does_not_is_named() {
    assert_eq!(without("", &[]).0, None);
    for (row, sensor) in (0..).zip(mission("").sensor_table()) {
        let (cause, told) = without("", &[row]);
        // X80 infrared rangers look aside, back, or into a sonar's cone.
        let stands = sensor.kind == SensorKind::Cone;
        let expected = if stands { Cause::RangeSilent } else { Cause::InfraredSilent };
        assert_eq!(cause, Some(expected), "{}", sensor.name);
        assert!(told.contains(&sensor.name), "{told}");
    }
}

#[test]
fn without_a_second_sensor_or_a_ranger_whose_ground_no_sonar_covers_the_robot_stands() {
    let (cause, told) = without("", &[4, 7]);
    assert_eq!(cause, Some(Cause::RangeSilent));
    assert!(told.contains("infrared-1") && told.contains("infrared-4"), "{told}");
    // Without side sonars, only the front cone and the sides are covered.
    let infrared = "sensors = 'front+infrared'";
    for ranger in 3..9 {
        let stands = [3, 6].contains(&ranger);
        let cause = if stands { Cause::RangeSilent } else { Cause::InfraredSilent };
        assert_eq!(without(infrared, &[ranger]).0, Some(cause), "{ranger}");
    }
}

#[test]
fn a_ranger_without_which_the_robot_goes_on_is_not_asked_for() {
    let mut streams = heard("", &[4]);
    streams.hears_motor(900);
    assert!(!streams.wants_request(900 * MS));
}
