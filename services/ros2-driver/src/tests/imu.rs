//! Tests of the gyro beside odometry.

use super::*;
use crate::messages::ImuTurn;

/// Stamp 12.5 s, no orientation, 0.75 rad/s with the variance 0.0004.
const IMU: [&[u8]; 3] = [
    b"\0\x01\0\0\x0c\0\0\0\0e\xcd\x1d\x04\0\0\0imu\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0w\x15\xf3\xd4\xee\xaa\xcf?\xa1\xee}\x9fT\x01\xef?\0\0\0\0\0\0\xf0\xbf",
    b"\0\0\0\0\0\0\xe8?-C\x1c\xeb\xe26:?",
    b"-C\x1c\xeb\xe26:?",
];
const GYRO: &str = "robot.rate_hz = 10\nrobot.ros2.imu = '/imu'\n";
const TURNS: u8 = 3;

fn imu() -> Vec<u8> {
    let zeros = |count: usize| &[0; 9 * 8][..count * 8];
    let [begin, rate, variance] = IMU;
    let diagonal = [zeros(3), variance, zeros(3), variance].concat();
    [begin, zeros(8), zeros(2), rate, &diagonal, zeros(3), zeros(9)].concat()
}

fn imu_at(stamp_us: u64, rate: f64) -> Vec<u8> {
    let header = Header::at(stamp_us * 1000, "imu");
    let mut imu = ros2::msg::Imu { header, ..Default::default() };
    imu.angular_velocity.z = rate;
    imu.angular_velocity_covariance[8] = 0.0004;
    imu.encode()
}

/// Winding robot. `odometry`, at 10 Hz, and `gyro`, at 100 Hz, scale its measured turns.
struct Winding {
    driver: Ros2,
    odometry: f64,
    gyro: f64,
    ms: u32,
}

impl Winding {
    fn new(odometry: f64, gyro: f64) -> Self {
        Self { driver: driver(GYRO), odometry, gyro, ms: 10_000 }
    }

    fn heading(&self) -> f64 {
        0.8 * (f64::from(self.ms) / 1000.0).sin()
    }

    /// Runs a tick, with IMU messages or not. Returns its turn, and any refusal.
    fn tick(&mut self, imu_speaks: bool) -> (Option<Turn>, Option<String>) {
        let mut refused = None;
        for _ in 0..10 {
            self.ms += 10;
            // 3 ms before odometry.
            let at_us = u64::from(self.ms) * 1000 - 3000;
            let rate = self.gyro * 0.8 * (at_us as f64 / 1e6).cos();
            if imu_speaks {
                refused = self.driver.said(TURNS, &imu_at(at_us, rate)).refused.or(refused);
            }
        }
        let pose = [0.0, 0.0, self.odometry * self.heading()];
        let heard = self.driver.said(ODOM, &odometry_of(self.ms, pose));
        assert!(heard.motion.is_some());
        (self.driver.turn_for_tick(), heard.refused.or(refused).map(|why| why.to_string()))
    }
}

#[test]
fn an_imu_is_read_as_rclpy_serialises_it_and_what_it_does_not_state_is_not_used() {
    let read = Imu::read(&imu()).unwrap();
    assert_eq!((read.stamp_ns, read.turn), (12_500_000_000, ImuTurn::Rate(0.75, Some(0.0004))));
    let mut heading = imu();
    let mut set = |at: usize, value: f64| {
        heading[at..at + 8].copy_from_slice(&value.to_le_bytes());
        Imu::read(&heading).map(|imu| imu.turn)
    };
    // Without a rate the orientation gives the turn.
    assert!(set(148, -1.0).unwrap_err().contains("remove robot.ros2.imu"));
    assert!(matches!(set(52, 0.0), Ok(ImuTurn::Heading(at)) if (at - 0.5).abs() < 1e-12));
    assert!(set(44, 7.0).unwrap_err().contains("not a rotation"));
    assert_eq!(set(148, 0.0), Ok(ImuTurn::Rate(0.75, Some(0.0004))));
    for unknown in [0.0, -1.0, f64::NAN] {
        assert_eq!(set(212, unknown), Ok(ImuTurn::Rate(0.75, None)), "{unknown}");
    }
    assert_eq!(set(212, f64::INFINITY), Ok(ImuTurn::Rate(0.75, Some(2500.0))));
    for no_rate in [f64::NAN, f64::INFINITY, 2000.0] {
        assert!(set(140, no_rate).unwrap_err().contains("in rad/s"), "{no_rate}");
    }
    for length in 0..220 {
        assert!(Imu::read(&imu()[..length]).is_err(), "{length}");
    }
}

#[test]
fn the_turns_of_ticks_are_those_of_the_gyro_up_to_the_stamp_of_odometry_and_follow_on_each_other() {
    // These wheels slip in turns.
    let mut robot = Winding::new(1.3, 1.0);
    while robot.tick(true).0.is_none() {}
    let (from, mut sum, mut variance) = (robot.heading(), 0.0, 0.0);
    for number in 3..60 {
        let (turn, refused) = robot.tick(true);
        let turn = turn.unwrap();
        assert_eq!((turn.sequence, refused), (number, None));
        (sum, variance) = (sum + turn.turn_rad, variance + turn.variance_rad2);
    }
    assert!((sum - (robot.heading() - from)).abs() < 1e-4, "{sum}");
    // 10 messages with 0.02 rad/s of error for 10 ms each, and 3 ms at both ends with up to 5
    // rad/s^2 of change.
    let ends = 2.0 * 2.25e-5_f64.powi(2);
    assert!((variance / 57.0 - 10.0 * 4e-8 - ends).abs() < 1e-10, "{variance}");
}

#[test]
fn a_gyro_that_contradicts_odometry_is_not_used_and_the_log_says_so() {
    for gyro in [-1.0, 0.0, 0.3, 57.3 / 2.0] {
        let mut robot = Winding::new(1.0, gyro);
        let mut refusals = Vec::new();
        for _ in 0..100 {
            let (turn, refused) = robot.tick(true);
            assert_eq!(turn, None, "{gyro}");
            refusals.extend(refused);
        }
        assert!(refusals[0].contains("the IMU: a turn of "), "{gyro}: {refusals:?}");
        assert!(refusals[0].contains("an axis that points up"), "{refusals:?}");
    }
}

#[test]
fn after_a_gap_of_the_gyro_turns_begin_anew_and_a_gyro_of_another_clock_is_never_used() {
    let mut robot = Winding::new(1.0, 1.0);
    while robot.tick(true).0.is_none() {}
    let before = robot.tick(true).0.unwrap().sequence;
    let silent = Vec::from_iter((0..3).map(|_| robot.tick(false)));
    assert!(silent.iter().all(|(turn, _)| turn.is_none()));
    let refusals = Vec::from_iter(silent.into_iter().filter_map(|(_, refused)| refused));
    assert!(refusals.len() == 1 && refusals[0].contains("older than odometry"), "{refusals:?}");
    let first = robot.tick(true).0.unwrap();
    assert!(first.turn_rad == 0.0 && first.sequence > before + 1, "{first:?}");
    assert_eq!(robot.tick(true).0.unwrap().sequence, first.sequence + 1);
    let (mut other, mut refusals) = (driver(GYRO), Vec::new());
    for tick in 0..20_u32 {
        for part in 0..10 {
            other.said(TURNS, &imu_at(u64::from(tick * 10 + part) * 10_000, 0.5));
        }
        let pose = [0.0, 0.0, 0.05 * f64::from(tick)];
        let heard = other.said(ODOM, &odometry_of(10_000 + 100 * tick, pose));
        refusals.extend(heard.refused);
        assert_eq!(other.turn_for_tick(), None);
    }
    assert!(
        refusals.len() == 1 && refusals[0].to_string().contains("the same clock"),
        "{refusals:?}"
    );
}
