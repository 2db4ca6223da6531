use common::{
    driver::odometry::motion,
    samples::{
        RangeStatus::{Absent, Invalid, Measured, Nothing},
        Sweep,
    },
};

use super::*;
use crate::testing::*;

#[test]
fn a_laser_that_says_the_same_while_the_wheels_turn_or_nothing_where_much_was_gives_no_reading_until_it_changes()
 {
    // Each scan has the number of beams that end, their range, and a further turn of the wheels in
    // opposite directions, decimetres and tenths of a radian. Other beams see nothing.
    // Only a Jackal's last case turns so far that what was seen is out of view: 100 beams of its
    // laser are 25 degrees; 1 rad of a wheel turns it by 30.
    for (model, scans, expected) in [
        (
            "kobuki",
            &[(360, 10_u8, 0), (360, 10, 1), (360, 10, 8), (360, 10, 2)][..],
            &[Measured, Measured, Measured, Invalid][..],
        ),
        ("kobuki", &[(360, 10, 0), (360, 10, 11), (360, 15, 1)], &[Measured, Invalid, Measured]),
        (
            "kobuki",
            &[(30, 10, 0), (0, 0, 1), (0, 0, 90), (1, 30, 0), (0, 0, 0)],
            &[Measured, Invalid, Invalid, Measured, Nothing],
        ),
        // Small, and far.
        ("kobuki", &[(18, 10, 0), (0, 0, 0)], &[Measured, Nothing]),
        ("kobuki", &[(360, 70, 0), (0, 0, 0)], &[Measured, Nothing]),
        ("jackal", &[(100, 10, 0), (0, 0, 1)], &[Measured, Invalid]),
        ("jackal", &[(100, 10, 0), (0, 0, 10)], &[Measured, Nothing]),
    ] {
        let mission = mission(&format!("robot.model = '{model}'"));
        let (row, laser) = mission.laser().unwrap();
        let mut sensors = Sensors::new(&mission);
        let mut turned = 0.0;
        for (&(ending, range, turn), &expected) in scans.iter().zip(expected) {
            turned += f64::from(turn) / 10.0;
            let mut beams = vec![f32::from(range) / 10.0; ending];
            beams.resize(laser.beams, f32::INFINITY);
            let motion = motion(&mission.body(), [-turned, turned], [1.0; 2], [false; 2]);
            let scan = LaserScan { row, beams, ..LaserScan::default() };
            let mut heard = Heard { motion: Some(motion), scans: vec![scan], ..Heard::default() };
            let status = sensors.take_heard(&mut heard, None)[0].status();
            let (readings, given) = sensors.for_tick(&motion, MissionTime::default());
            let is = (status, readings[row].status(), given.is_empty());
            // Invalid readings come without scans.
            assert_eq!(is, (expected, expected, expected == Invalid), "{scans:?}");
        }
    }
}

#[test]
fn a_reading_counts_for_one_tick_and_only_as_often_as_its_sensor_measures_and_of_no_row_for_none() {
    let row = "[[robot.sensor]]\nname = 'front'\nkind = 'cone'\nchannel = 1\nforward_m = 0.19\nbearing_deg = 0\nrate_hz = 2.4";
    for (row, every) in [(row, 3), ("", 1)] {
        let mut sensors = Sensors::new(&mission(row));
        let motion = motion(&sensors.body, [0.0; 2], [0.0; 2], [false; 2]);
        for tick in 0..6 {
            let readings = vec![reading(0, Some(1.0)), reading(99, Some(1.0))];
            let mut heard = Heard { readings, ..Heard::default() };
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
    // The second tick comes late, right before the third, and the fourth too; a scan is newer than
    // that, one older than the first. The clock is set before the last.
    for (tick_ms, now_ms, scan_ms, expected_ms) in [
        (70_000, 5_000, 70_000, 0),
        (70_100, 5_180, 70_050, -90),
        (70_200, 5_200, 70_050, -110),
        (70_300, 5_330, 70_330, 30),
        (70_400, 5_400, 69_990, -410),
        (10, 5_500, 70_390, -30),
    ] {
        let ns = |ms: i64| ms * 1_000_000;
        let sweep = Sweep { first_beam_ns: ns(-30), ..Sweep::default() };
        let beams = vec![f32::INFINITY; laser.beams];
        let scan = LaserScan { row, beams, sweep, stamp_ns: Some(ns(scan_ms)) };
        let motion = Motion { stamp_ns: Some(ns(tick_ms)), ..still };
        let mut heard = Heard { motion: Some(motion), scans: vec![scan], ..Heard::default() };
        sensors.take_heard(&mut heard, None);
        let (_, scans) = sensors.for_tick(&motion, MissionTime(now_ms * MS));
        assert_eq!(scans[0].sweep.first_beam_ns / ns(1), expected_ms, "{tick_ms}");
    }
}
