use common::{
    json_wire::Order,
    wire::{Addressing, CustomSensors, MotorSensors, Report as Frame, StandardSensors},
};

use super::*;
use Protocol::{Arduino, Json, Ros2, X80};

const ADDRESS: &str = "udp://127.0.0.1:5600";

/// A JSON robot that has sent `line` `times` times, at 20 Hz.
fn said(line: &str, times: u32) -> Seen {
    let mut seen = Seen::new(Json).unwrap();
    for time in 0..times {
        seen.hear(format!("{line}\n").as_bytes(), f64::from(time) / 20.0);
    }
    seen
}

fn mission_of(seen: &Seen) -> Mission {
    parsed(&seen.mission_at(ADDRESS)).unwrap()
}

fn parsed(text: &str) -> Result<Mission, String> {
    Mission::parse(text, "m.toml").map_err(|error| format!("{error}\n{text}"))
}

#[test]
fn the_words_of_a_json_robot_become_a_mission_with_its_sensors_and_its_rate() {
    let report = r#"{"heard":1,"wheels":[0,0],"speeds":[0,0],"gyro":0,"battery_v":12.4,"ranges":{"front":1.25,"left":null},"scan":[1,2.5,null],"touched":{"bump":false}}"#;
    let seen = said(report, 41);
    let mission = seen.mission_at(ADDRESS);
    assert_eq!(mission, include_str!("tests/json.toml"));
    parsed(&mission).unwrap();
}

#[test]
fn a_robot_that_only_answers_or_says_nothing_of_sensors_has_a_valid_mission() {
    let odometry = said(r#"{"odometry":[0,0,0],"speeds":[0,0]}"#, 1);
    assert_eq!(mission_of(&odometry).robot.rate_hz, 10.0);
    assert!(said(r#"{"heard":1}"#, 1).is_known());
    for protocol in [X80, Json, Arduino, Ros2] {
        let seen = Seen::new(protocol).unwrap();
        assert!(!seen.is_known());
        let address = if protocol == Ros2 { "ros2:7" } else { ADDRESS };
        let text = seen.mission_at(address);
        let mission = parsed(&text).unwrap();
        assert_eq!(mission.robot.protocol(), protocol);
        assert_eq!(text.contains("ROS_DOMAIN_ID"), protocol == Ros2);
    }
}

#[test]
fn hostile_names_are_refused_as_names_and_few_are_kept() {
    let hostile = said(r#"{"ranges":{"a\"\n[robot]\n":1}}"#, 1).mission_at(ADDRESS);
    let refused = parsed(&hostile).unwrap_err();
    assert!(refused.contains("invalid as a sensor name"), "{refused}");
    let mut seen = Seen::new(Json).unwrap();
    for name in 0..1000 {
        seen.hear(format!("{{\"ranges\":{{\"n{name}\":1e300}}}}\n").as_bytes(), 0.0);
    }
    assert_eq!(seen.report.ranges.len(), MOST);
    let refused = parsed(&seen.mission_at(ADDRESS)).unwrap_err();
    assert!(refused.contains("33 rows"), "{refused}");
}

#[test]
fn an_echo_and_what_another_protocol_says_are_not_known() {
    for protocol in [X80, Json, Arduino] {
        let mut seen = Seen::new(protocol).unwrap();
        let echo = seen.ask();
        seen.hear(&echo, 0.0);
        seen.hear(b"HTTP/1.1 400 Bad Request\r\n\r\n{\"wheel\":1}\n", 0.1);
        assert_eq!(seen.refused.contains("unknown field `wheel`"), protocol == Json);
        seen.hear(format!("{{\"\\u001b{}\":1}}\n", "x".repeat(1000)).as_bytes(), 0.2);
        assert!(!seen.is_known(), "{protocol:?}");
        assert!(seen.refused.len() <= MOST_TOLD && !seen.refused.contains('\u{1b}'));
    }
}

#[test]
fn the_frames_of_an_x80_tell_its_rate_and_the_sensors_that_read() {
    let standard = StandardSensors { ultrasonic: [0, 80, 135, 0, 0, 0], ..Default::default() };
    let mut bytes = Vec::new();
    for frame in [
        Frame::Standard(standard),
        Frame::Custom(CustomSensors { ad: [1000; 8], io: 0 }),
        Frame::Motor(MotorSensors::default()),
    ] {
        frame.encode(Addressing::default(), &mut bytes);
    }
    let mut seen = Seen::new(X80).unwrap();
    for tick in 0..8 {
        seen.hear(&bytes, f64::from(tick) / 7.0);
    }
    assert_eq!(mission_of(&seen).robot.rate_hz, 7.0);
    let sonars = ["front", "front-left"].map(|name| seen.words.contains(name));
    assert_eq!(sonars, [true, false], "{:?}", seen.words);
}

#[test]
fn an_arduino_is_known_by_its_counts() {
    let mut seen = Seen::new(Arduino).unwrap();
    assert_eq!(seen.ask(), b"\rb\r");
    seen.hear(b"57600\r\n", 0.0);
    assert!(!seen.is_known());
    assert_eq!(seen.ask(), b"e\r");
    seen.hear(b"10 -12\r\n", 0.1);
    assert!(seen.is_known() && seen.ask().is_empty());
}

#[test]
fn a_robot_is_asked_for_reports_and_its_brake_is_never_released() {
    let asked = Seen::new(Json).unwrap().ask();
    assert_eq!(parse(&asked), Ok(Order::Ping {}));
}
