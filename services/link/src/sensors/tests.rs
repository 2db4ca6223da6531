use std::path::Path;

use common::{
    driver::odometry::motion,
    samples::{
        RangeStatus::{self, Absent, Invalid, Measured, Nothing},
        Sweep,
    },
};

use super::*;

fn mission(text: &str) -> Mission {
    Mission::parse(&format!("target = [3, 0]\n{text}"), Path::new("m.toml")).unwrap()
}

/// Returns the laser status after each of `scans`: the number of beams that end, their range, and a
/// further turn of the wheels in opposite directions. Other beams see nothing. Invalid readings
/// come without scans.
fn scanned(model: &str, scans: &[(usize, f32, f64)]) -> Vec<RangeStatus> {
    let mission = mission(&format!("robot.model = '{model}'"));
    let (row, laser) = mission.laser().unwrap();
    let mut sensors = Sensors::new(&mission);
    let mut turned = 0.0;
    let status = |&(ending, range, turn): &(usize, f32, f64)| {
        turned += turn;
        let mut beams = vec![range; ending];
        beams.resize(laser.beams, f32::INFINITY);
        let motion = motion(&mission.body(), [-turned, turned], [1.0; 2], [false; 2]);
        let scan = LaserScan { row, beams, ..LaserScan::default() };
        let mut heard = Heard { motion: Some(motion), scans: vec![scan], ..Heard::default() };
        let status = sensors.take_heard(&mut heard, None)[0].status();
        let (readings, scans) = sensors.for_tick(&motion, MissionTime::default());
        assert_eq!((readings[row].status(), scans.is_empty()), (status, status == Invalid));
        status
    };
    scans.iter().map(status).collect()
}

#[test]
fn a_laser_that_says_the_same_while_the_wheels_turn_gives_no_reading_until_it_changes() {
    let scans = [(360, 1.0, 0.0), (360, 1.0, 0.1), (360, 1.0, 0.8), (360, 1.0, 0.2)];
    assert_eq!(scanned("kobuki", &scans), [Measured, Measured, Measured, Invalid]);
    assert_eq!(
        scanned("kobuki", &[scans[0], (360, 1.0, 1.1), (360, 1.5, 0.1)])[1..],
        [Invalid, Measured]
    );
}

#[test]
fn a_laser_that_sees_nothing_where_much_was_near_gives_no_reading_until_it_sees_anything() {
    let blind = [(30, 1.0, 0.0), (0, 0.0, 0.1), (0, 0.0, 9.0), (1, 3.0, 0.0), (0, 0.0, 0.0)];
    assert_eq!(scanned("kobuki", &blind), [Measured, Invalid, Invalid, Measured, Nothing]);
}

#[test]
fn a_laser_sees_nothing_where_what_it_saw_was_small_far_or_is_out_of_view_by_the_turn() {
    for small_or_far in [(18, 1.0, 0.0), (360, 7.0, 0.0)] {
        assert_eq!(scanned("kobuki", &[small_or_far, (0, 0.0, 0.0)]), [Measured, Nothing]);
    }
    // 100 beams of a Jackal's laser are 25 degrees; 1 rad of a wheel turns it by 30.
    assert_eq!(scanned("jackal", &[(100, 1.0, 0.0), (0, 0.0, 1.0)]), [Measured, Nothing]);
    assert_eq!(scanned("jackal", &[(100, 1.0, 0.0), (0, 0.0, 0.1)]), [Measured, Invalid]);
}

#[test]
fn a_reading_counts_for_one_tick_and_only_as_often_as_its_sensor_measures_and_of_no_row_for_none() {
    let row = "[[robot.sensor]]\nname = 'front'\nkind = 'cone'\nchannel = 1\nforward_m = 0.19\nbearing_deg = 0\nrate_hz = 2.4";
    for (row, every) in [(row, 3), ("", 1)] {
        let mut sensors = Sensors::new(&mission(row));
        let motion = motion(&sensors.body, [0.0; 2], [0.0; 2], [false; 2]);
        for tick in 0..6 {
            let status = Measured.into();
            let readings =
                [0, 99].map(|sensor| RangeReading { sensor, status, ..RangeReading::default() });
            let mut heard = Heard { readings: readings.to_vec(), ..Heard::default() };
            assert_eq!(sensors.take_heard(&mut heard, None).len(), 1);
            let given = sensors.for_tick(&motion, MissionTime::default()).0[0].status();
            assert_eq!(given, if tick % every == 0 { Measured } else { Absent }, "{tick}");
        }
        assert_eq!(sensors.for_tick(&motion, MissionTime::default()).0[0].status(), Absent);
    }
}

#[test]
fn a_stamped_scan_is_placed_by_the_clocks_of_ticks_and_by_its_age_alone_once_the_clock_was_set() {
    let mission = mission("robot.model = 'kobuki'");
    let (row, laser) = mission.laser().unwrap();
    let mut sensors = Sensors::new(&mission);
    let still = motion(&mission.body(), [0.0; 2], [0.0; 2], [false; 2]);
    let mut placed_ms = |tick: [i64; 2], scan_ms: i64| {
        let ns = |ms: i64| ms * 1_000_000;
        let sweep = Sweep { first_beam_ns: ns(-30), ..Sweep::default() };
        let beams = vec![f32::INFINITY; laser.beams];
        let scan = LaserScan { row, beams, sweep, stamp_ns: Some(ns(scan_ms)) };
        let motion = Motion { stamp_ns: Some(ns(tick[0])), ..still };
        let mut heard = Heard { motion: Some(motion), scans: vec![scan], ..Heard::default() };
        sensors.take_heard(&mut heard, None);
        let now = MissionTime(ns(tick[1]) as u64);
        sensors.for_tick(&motion, now).1[0].sweep.first_beam_ns / 1_000_000
    };
    assert_eq!(placed_ms([70_000, 5_000], 70_000), 0);
    assert_eq!(placed_ms([70_100, 5_200], 70_050), -100);
    assert_eq!(placed_ms([10, 5_300], 70_190), -30, "the clock was set");
}
