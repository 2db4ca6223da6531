//! Messages serialised by rclpy of ROS 2 Kilted with Fast DDS. Zeros stand for lists of zeros.

mod imu;

use common::samples::RangeStatus;

use super::*;
use ros2::{
    messages::{self, COVARIANCE},
    msg::{HazardDetection, HazardDetectionVector, Header},
};

const ROBOT: &str = "target = [3, 0]\nrobot.model = 'turtlebot3-burger'\nrobot.protocol = 'ros2'\nrobot.address = 'ros2'\n";
/// Stamp 12.5 s, at (1.5, -0.25) with heading 0.5, 0.2 m/s and -0.1 rad/s.
const ODOMETRY: [&[u8]; 2] = [
    b"\0\x01\0\0\x0c\0\0\0\0e\xcd\x1d\x05\0\0\0odom\0Gd\xb3\x0a\0\0\0base_link\0d\xafdF\x84\x01\0\0\0\0\0\0\xf8?\0\0\0\0\0\0\xd0\xbf\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0w\x15\xf3\xd4\xee\xaa\xcf?\xa1\xee}\x9fT\x01\xef?",
    b"\x9a\x99\x99\x99\x99\x99\xc9?\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x9a\x99\x99\x99\x99\x99\xb9\xbf",
];
/// 4 beams from 0 in steps of 1.5: 1 m, infinite, NaN and 0; from 0.16 m to 8 m.
const SCAN: &[u8] = b"\0\x01\0\0\0\0\0\0\0\0\0\0\x0a\0\0\0base_scan\0\xb1\x1e\0\0\0\0\0\0\xc0@\0\0\xc0?\0\0\0\0\0\0\0\0\x0a\xd7#>\0\0\0A\x04\0\0\0\0\0\x80?\0\0\x80\x7f\0\0\xc0\x7f\0\0\0\0\x02\0\0\0\0\0\x80?\0\0\x80?";
/// 1.25 m of 0.02 to 4 m.
const RANGE: &[u8] =
    b"\0\x01\0\0\0\0\0\0\0\0\0\0\x05\0\0\0nose\0\0pe\0\0\0?\x0a\xd7\xa3<\0\0\x80@\0\0\xa0?\0\0\0\0";
/// 12.1 V.
const BATTERY: &[u8] = b"\0\x01\0\0\0\0\0\0\0\0\0\0\x02\0\0\0b\0\x9b\x19\x9a\x99AA\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x01\0\0\0\0\0\0\0\0\x01\0\0\0\0\0\0\0\x01\0\0\0\0";
/// 0.2 m/s and -0.5 rad/s.
const TWIST: &[u8] = b"\0\x01\0\0\x9a\x99\x99\x99\x99\x99\xc9?\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\xe0\xbf";
const TWIST_STAMPED: &[u8] = b"\0\x01\0\0\0\0\0\0\0\0\0\0\x01\0\0\0\0\xd1\x97\x19\x9a\x99\x99\x99\x99\x99\xc9?\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\xe0\xbf";

fn odometry() -> Vec<u8> {
    let covariance = [0; 36 * 8];
    [ODOMETRY[0], &covariance, ODOMETRY[1], &covariance].concat()
}

fn header(stamp_ms: u32) -> Header {
    Header::at(u64::from(stamp_ms) * 1_000_000, "frame")
}

fn odometry_of(stamp_ms: u32, pose: [f64; 3]) -> Vec<u8> {
    let unknown = [0.0; COVARIANCE];
    messages::odometry(header(stamp_ms), "base_link", (pose, unknown), ([0.2, -0.1], unknown))
}

/// Odometry from (1, -0.25) with heading 0.5.
fn odometry_at(stamp_ms: u32) -> Vec<u8> {
    odometry_from(stamp_ms, 1.0)
}

fn odometry_from(stamp_ms: u32, x: f64) -> Vec<u8> {
    odometry_of(stamp_ms, [x, -0.25, 0.5])
}

/// Returns a scan of `fan`, first beam and step in degrees, with `beam_s` between its beams.
fn scan_at(stamp_ms: u32, beam_s: f64, fan: [f64; 2], ranges: Vec<f32>) -> Vec<u8> {
    messages::scan(header(stamp_ms), fan.map(f64::to_radians), [0.16, 8.0], [beam_s, 0.0], ranges)
}

fn scan_of(fan: [f64; 2], ranges: &[f32]) -> Vec<u8> {
    scan_at(1000, 0.0, fan, ranges.to_vec())
}

fn mission(text: &str) -> Mission {
    Mission::parse(text, "m.toml").unwrap()
}

fn is_refused(heard: &Heard, words: &str) -> bool {
    heard.refused.as_ref().is_some_and(|why| why.to_string().contains(words))
}

fn names(topics: &Topics) -> Vec<String> {
    topics.heard.iter().map(|(_, topic)| topic.dds_name()).collect()
}

fn driver(extra: &str) -> Ros2 {
    Ros2::new(&mission(&format!("{ROBOT}{extra}")))
}

impl Ros2 {
    fn said(&mut self, row: u8, payload: &[u8]) -> Heard {
        self.hear(&[&[row], payload].concat())
    }

    fn beams_of(&mut self, scan: &[u8]) -> Vec<f32> {
        let mut heard = self.said(LASER, scan);
        assert_eq!(heard.refused, None);
        heard.scans.remove(0).beams
    }
}

fn counts(heard: &Heard) -> [u16; 2] {
    let wheels = heard.motion.unwrap().wheels;
    [wheels.left_counts, wheels.right_counts]
}

const ODOM: u8 = 0;
const LASER: u8 = 1;
const POWER: u8 = 2;
const NOSE: u8 = 3;
const COMMAND: u8 = 4;
const SONAR: &str = "robot.ros2.ranges = { nose = 'nose' }\n[[robot.sensor]]\nname = 'nose'\nkind = 'cone'\nchannel = 0\nforward_m = 0.1\nbearing_deg = 0\n\
    [[robot.sensor]]\nname = 'laser'\nkind = 'scan'\nchannel = 0\nforward_m = 0\nbearing_deg = 0\nmodel = 'lds-02'\n";

#[test]
fn what_rclpy_serialises_is_read_as_what_was_said() {
    let odometry = format!("{:.12?}", Odometry::read(&odometry()).unwrap());
    let said = "Odometry { stamp_ns: 12500000000, pose: [1.500000000000, -0.250000000000, 0.500000000000], twist: [0.200000000000, -0.100000000000] }";
    assert_eq!(odometry, said);
    let scan = format!("{:?}", Scan::read(SCAN).unwrap());
    let said = "Scan { stamp_ns: 0, beam_s: 0.0, fan: (0.0, 1.5), least_m: 0.16, most_m: 8.0, ranges: [1.0, inf, NaN, 0.0], is_reversed: false }";
    assert_eq!(scan, said);
    assert_eq!(read_range(RANGE), Ok(1.25));
    assert_eq!(BatteryState::decode(BATTERY).unwrap().voltage, 12.1);
}

#[test]
fn a_message_that_ends_anywhere_is_refused_and_none_makes_the_driver_panic_or_allocate() {
    let mut driver = driver(SONAR);
    let needed = [(ODOM, odometry(), 724), (LASER, SCAN.to_vec(), 88), (NOSE, RANGE.to_vec(), 40)];
    for (row, payload, needed) in needed {
        for length in 0..payload.len() {
            let heard = driver.said(row, &payload[..length]);
            assert!(length >= needed || is_refused(&heard, "ends early"));
        }
        for at in 0..payload.len().min(80) {
            for value in [0, 1, 0x7f, 0x80, 0xff] {
                let mut broken = payload.clone();
                broken[at] = value;
                driver.said(row, &broken);
            }
        }
    }
    assert!(driver.tally().bytes_dropped > 0);
    assert!(driver.hear(&[]).refused.is_some());
}

#[test]
fn a_refusal_names_the_topic_what_was_wrong_and_the_remedy() {
    let mut driver = driver("");
    let mut xcdr2 = odometry();
    xcdr2[1] = 7;
    let mut lying = odometry();
    lying[68..100].fill(0);
    for (row, payload, words) in [
        (ODOM, xcdr2, "/odom: its encoding is 0x0007 instead of plain CDR; set"),
        (ODOM, lying, "/odom: the orientation is not a rotation; set"),
        (ODOM, odometry_from(1000, f64::NAN), "/odom: the pose is out of range; publish metres"),
        (
            LASER,
            SCAN.to_vec(),
            "/scan: the scan has 4 beams from 0.0 degrees in steps of 85.944, and the mission's laser has 360 beams from -180.0 degrees in steps of 1.000; correct",
        ),
        (9, odometry(), "belongs to an unknown topic"),
    ] {
        let heard = driver.said(row, &payload);
        assert!(!heard.anything && heard.motion.is_none() && heard.scans.is_empty());
        assert!(is_refused(&heard, words), "{heard:?}");
    }
}

#[test]
fn odometry_is_the_way_of_wheels_and_begins_a_tick_at_the_missions_rate() {
    let mut driver = driver("robot.rate_hz = 10");
    for stamp_ms in (1000..1450).step_by(50) {
        let is_tick = driver.said(ODOM, &odometry_at(stamp_ms)).motion.is_some();
        assert_eq!(is_tick, stamp_ms % 100 == 0, "{stamp_ms}");
    }
    // 0.02 m along x are 0.02 cos(0.5) along the heading of 0.5 rad.
    let heard = driver.said(ODOM, &odometry_from(1500, 1.02));
    let way = (0.02 * 0.5_f64.cos() / 0.033 * 3600.0 / TAU).round() as u16;
    assert_eq!(counts(&heard), [way; 2]);
    // 0.2 m/s and -0.1 rad/s with a track of 0.16 m.
    let left = ((0.2 + 0.008) / 0.033 * 3600.0 / TAU).round() as i32;
    assert_eq!(heard.motion.unwrap().wheels.left_counts_per_s, left);
}

#[test]
fn odometry_that_was_stamped_late_does_not_hide_the_next() {
    let mut driver = driver("robot.rate_hz = 10");
    for stamp_ms in [1000, 1100, 1250, 1300, 1400, 1540, 1590, 1690, 2000, 2010] {
        let is_tick = driver.said(ODOM, &odometry_at(stamp_ms)).motion.is_some();
        // A message right after three silent periods belongs to the tick that ended them.
        assert_eq!(is_tick, stamp_ms != 2010, "{stamp_ms}");
    }
}

#[test]
fn odometry_that_is_repeated_or_old_is_refused_until_it_goes_on() {
    let mut driver = driver("robot.rate_hz = 10");
    // At last the clock was set.
    for (stamp_ms, goes_on) in
        [(5000, true), (5000, false), (4900, false), (5100, true), (100, true), (200, true)]
    {
        let heard = driver.said(ODOM, &odometry_at(stamp_ms));
        assert_eq!(is_refused(&heard, "does not increase"), !goes_on, "{stamp_ms}");
        assert_eq!(heard.refused.is_none(), goes_on, "{stamp_ms}");
    }
}

#[test]
fn a_circle_of_beams_is_turned_to_the_missions_and_lacking_ones_have_no_reading() {
    let mut driver = driver("");
    // The first beam looks ahead, as on a TurtleBot 3: the mission's 180th.
    let mut ranges = vec![f32::INFINITY; 360];
    ranges[0] = 1.0;
    ranges[90] = 0.1;
    let beams = driver.beams_of(&scan_of([0.0, 1.0], &ranges));
    assert_eq!((beams[180], beams[181]), (1.0, f32::INFINITY));
    ranges[1] = 1e38;
    let garbage = driver.beams_of(&scan_of([0.0, 1.0], &ranges));
    assert!(garbage[181].is_nan(), "a range that no laser has is none");
    assert!(beams[270].is_nan(), "less than the least range");
    let beams = driver.beams_of(&scan_of([0.0, 1.5], &[2.0; 240]));
    assert_eq!(beams.iter().filter(|beam| beam.is_nan()).count(), 120);
}

#[test]
fn a_scan_has_its_age_at_the_tick_and_each_beam_its_time_whichever_is_the_first_and_the_next() {
    let sweep = |beam_s, fan| {
        let mut driver = driver("");
        driver.said(ODOM, &odometry_at(5000));
        let mut heard = driver.said(LASER, &scan_at(4950, beam_s, fan, vec![1.0; 360]));
        assert_eq!(heard.refused, None);
        let scan = heard.scans.remove(0);
        let tick = driver.said(ODOM, &odometry_at(5200)).motion.unwrap();
        Sweep { first_beam_ns: scan.stamp_ns.unwrap() - tick.stamp_ns.unwrap(), ..scan.sweep }
    };
    let at_once = Sweep { first_beam_ns: -250_000_000, ..Sweep::default() };
    assert_eq!(sweep(0.0, [0.0, 1.0]), at_once);
    for (fan, beams) in [
        ([-180.0, 1.0], [0, 1, 359]),
        ([0.0, 1.0], [180, 181, 179]),
        ([0.0, -1.0], [180, 179, 181]),
    ] {
        let sweep = sweep(0.0005, fan);
        let time = |beam| (sweep.beam_time_ns(beam, 360) as f64 / 5e5).round() as i64;
        assert_eq!(beams.map(time), [-500, -499, -141], "{fan:?}");
    }
}

#[test]
fn a_scan_without_a_plausible_stamp_counts_as_taken_at_the_tick_and_the_log_says_so_once() {
    for stamp_ms in [0, 1000, 9000] {
        let mut driver = driver("");
        driver.said(ODOM, &odometry_at(5000));
        let scan = scan_at(stamp_ms, 0.0005, [0.0, 1.0], vec![1.0; 360]);
        assert!(is_refused(&driver.said(LASER, &scan), "stamp"), "{stamp_ms}");
        let again = driver.said(LASER, &scan);
        let scan = &again.scans[0];
        assert_eq!((again.refused, scan.sweep, scan.stamp_ns), (None, Sweep::default(), None));
    }
}

#[test]
fn a_scan_whose_beams_go_back_in_time_or_take_longer_than_a_laser_does_is_refused() {
    for beam_s in [-0.0005, f64::NAN, f64::INFINITY, 0.1] {
        let scan = scan_at(5000, beam_s, [0.0, 1.0], vec![1.0; 360]);
        assert!(is_refused(&driver("").said(LASER, &scan), "time_increment"), "{beam_s}");
    }
}

#[test]
fn a_laser_upside_down_has_what_it_saw_on_its_left_on_the_robots_right() {
    let laser = |keys: &str| {
        format!(
            "[[robot.sensor]]\nname = 'laser'\nkind = 'scan'\nforward_m = 0\nbearing_deg = 0\nroll_deg = 180\n{keys}"
        )
    };
    // 90 degrees to the laser's left; a circle may begin anywhere.
    for (first, left) in [(0.0, 90), (-180.0, 270)] {
        let mut driver = driver(&laser("model = 'lds-02'"));
        let mut ranges = vec![f32::INFINITY; 360];
        ranges[left] = 1.0;
        let beams = driver.beams_of(&scan_of([first, 1.0], &ranges));
        assert_eq!((beams[90], beams[270]), (1.0, f32::INFINITY), "{first}");
    }
    let mut driver = driver(&laser("beams = 181\nfield_of_view_deg = 180"));
    let mut ranges = vec![2.0; 181];
    ranges[180] = 1.0;
    assert_eq!(driver.beams_of(&scan_of([-90.0, 1.0], &ranges))[..2], [1.0, 2.0]);
}

#[test]
fn a_scan_of_16384_beams_is_taken_whole() {
    let mut driver = driver(
        "[[robot.sensor]]\nname = 'laser'\nkind = 'scan'\nforward_m = 0\nbearing_deg = 0\nmodel = 'lds-02'\nbeams = 16384",
    );
    let ranges = Vec::from_iter((0..16_384).map(|beam| 1.0 + beam as f32 * 1e-4));
    let scan = scan_of([-180.0, 360.0 / 16_384.0], &ranges);
    assert!(scan.len() < 98_304 - 1024, "a reader of DDS takes it whole");
    assert_eq!(driver.beams_of(&scan), ranges);
}

#[test]
fn ranges_and_the_battery_are_those_of_their_topics() {
    let mut driver = driver(SONAR);
    let nose = driver.said(NOSE, RANGE).readings[0];
    assert_eq!((nose.status(), nose.range_m), (RangeStatus::Measured, 1.25));
    for (range, status) in [
        (f32::INFINITY, RangeStatus::Nothing),
        (5.0, RangeStatus::Nothing),
        (f32::NAN, RangeStatus::Invalid),
        (1e38, RangeStatus::Invalid),
        (0.01, RangeStatus::Invalid),
    ] {
        let mut payload = RANGE.to_vec();
        payload[36..40].copy_from_slice(&range.to_le_bytes());
        assert_eq!(driver.said(NOSE, &payload).readings[0].status(), status, "{range}");
    }
    let power = driver.said(POWER, BATTERY).power.unwrap();
    assert!((power.motor_v - 12.1).abs() < 1e-6);
}

#[test]
fn a_command_is_the_bytes_of_rclpy_and_one_of_nothing_is_a_stop() {
    assert_eq!(write_twist(0.2, -0.5, false), TWIST);
    let mut stamped = TWIST_STAMPED.to_vec();
    // Fast DDS leaves padding unchanged.
    stamped[17..20].fill(0);
    assert_eq!(write_twist(0.2, -0.5, true), stamped);
    let stop = driver("").velocity([0, 0], Duration::from_millis(250));
    assert_eq!(stop, write_twist(0.0, 0.0, false));
    // Half a turn of each wheel per second is pi r.
    let told = driver("").velocity([1800, 1800], Duration::from_millis(250));
    assert_eq!(told, write_twist(twist(&driver("").body, [1800; 2]).v, 0.0, false));
}

#[test]
fn the_missions_names_are_those_of_its_topics() {
    let text = format!("{ROBOT}robot.ros2.odom = 'a/odom'\nrobot.ros2.stamped = true\n{SONAR}");
    let topics = Topics::of(&mission(&text));
    let expected = ["rt/a/odom", "rt/scan", "rt/battery_state", "rt/nose", "rt/cmd_vel"];
    assert_eq!(names(&topics), expected);
    assert_eq!(topics.command.type_name, "geometry_msgs::msg::dds_::TwistStamped_");
}

#[test]
fn each_of_several_lasers_has_a_topic_of_its_own_and_its_scan_is_that_of_its_row() {
    let mut driver = driver(
        "robot.ros2.ranges = { back = '/b', front = '/f' }\n\
        [[robot.sensor]]\nname = 'front'\nkind = 'scan'\nforward_m = 0\nbearing_deg = 0\nmodel = 'lds-02'\n\
        [[robot.sensor]]\nname = 'back'\nkind = 'scan'\nforward_m = 0\nbearing_deg = 0\nroll_deg = 180\nmodel = 'lds-02'\n",
    );
    let ranges = Vec::from_iter((0..360_u16).map(|beam| 1.0 + f32::from(beam) / 100.0));
    let scan = scan_of([-180.0, 1.0], &ranges);
    assert_eq!(names(&driver.topics)[..4], ["rt/odom", "rt/f", "rt/b", "rt/battery_state"]);
    for (topic, row, second) in [(1, 0, 1.01), (2, 1, 4.59)] {
        let scan = driver.said(topic, &scan).scans.remove(0);
        assert_eq!((scan.row, scan.beams[1]), (row, second));
    }
}

#[test]
fn bumpers_are_heard_as_hazards_of_a_create_or_each_by_a_topic_of_its_own() {
    let hazards = |all: &[(u8, &str)]| {
        let hazard = |(kind, frame): &(u8, &str)| HazardDetection {
            header: Header::at(0, frame),
            r#type: *kind,
        };
        let detections = all.iter().map(hazard).collect();
        HazardDetectionVector { detections, ..Default::default() }.encode()
    };
    let create = ROBOT.replace("turtlebot3-burger", "turtlebot4");
    let mut driver = Ros2::new(&mission(&create));
    assert_eq!(names(&driver.topics)[3], "rt/hazard_detection");
    let mut feel = |all: &[(u8, &str)]| {
        let touched = driver.said(3, &hazards(all)).touched;
        assert_eq!(touched.len(), 9);
        let rows = touched.into_iter().filter(|(_, feels)| *feels).map(|(row, _)| row);
        Vec::from_iter(rows)
    };
    assert_eq!(feel(&[(1, "bump_left"), (3, "base"), (2, "cliff_front_right")]), [0, 7]);
    assert_eq!(feel(&[(0, "bump_left")]), [] as [usize; 0], "a limit of backing up is no bump");
    let row = "robot.ros2.ranges = { nose = '/bump' }\n[[robot.touch]]\nname = 'nose'\nkind = 'bumper'\nbearing_deg = 0\n";
    let mut driver = self::driver(row);
    assert_eq!(driver.said(3, &[0, 1, 0, 0, 1]).touched, [(0, true)]);
    assert!(driver.said(3, &[0, 1, 0, 0]).refused.is_some());
}

#[test]
fn the_counts_of_a_link_that_is_started_again_go_on_where_they_were_and_take_what_was_driven_meanwhile()
 {
    let mut first = driver("");
    first.said(ODOM, &odometry_at(1000));
    first.said(ODOM, &odometry_from(1200, 1.1));
    let memory = first.odometry.memory().unwrap();
    let started = || {
        let mut second = driver("");
        second.odometry.remember(memory);
        second
    };
    let then = |mut driver: Ros2| counts(&driver.said(ODOM, &odometry_from(2000, 1.3)));
    let (alone, after) = (then(first), then(started()));
    assert!(alone == after && alone[0] > 3000, "{alone:?} {after:?}");
    // Odometry that started again while no link listened is no motion.
    for (pose, jumped) in [([0.0; 3], true), ([9.0, -0.2, 0.5], true), ([0.9, -0.3, 0.6], false)] {
        let heard = started().said(ODOM, &odometry_of(2000, pose));
        assert_eq!(heard.jumped, jumped, "{pose:?}");
    }
}

#[test]
fn what_others_tell_the_robot_is_theirs_and_no_sign_of_the_robot() {
    let command =
        |driver: &mut Ros2, payload: &[u8]| driver.said(COMMAND, &[&[7; 16], payload].concat());
    let other = |moves| Some(Commander { number: [7; 16], moves });
    for (stamped, twist) in [(false, TWIST), (true, TWIST_STAMPED)] {
        let mut driver = driver(&format!("robot.ros2.stamped = {stamped}\n{SONAR}"));
        let heard = command(&mut driver, twist);
        assert_eq!((heard.commander, heard.anything, heard.refused), (other(true), false, None));
        let stand = driver.velocity([0, 0], Duration::from_millis(250));
        assert_eq!(command(&mut driver, &stand).commander, other(false));
        let cut = command(&mut driver, &stand[..40]);
        assert!(cut.commander.is_none() && is_refused(&cut, "/cmd_vel: "), "{stamped}");
    }
}

/// Returns whether odometry jumps from (1, 0.5), heading 0.3, to `pose`, and whether counts stay.
fn jump(after_ms: u32, pose: [f64; 3]) -> [bool; 2] {
    let mut driver = driver("");
    let before = counts(&driver.said(ODOM, &odometry_of(1000, [1.0, 0.5, 0.3])));
    let heard = driver.said(ODOM, &odometry_of(1000 + after_ms, pose));
    let refused = is_refused(&heard, "odometry jumps to");
    assert_eq!((heard.anything, refused), (true, heard.jumped), "{heard:?}");
    let after = counts(&heard);
    // The next pose continues from this one.
    let [x, y, heading] = pose;
    let next = [x + 0.01 * heading.cos(), y + 0.01 * heading.sin(), heading];
    let next = driver.said(ODOM, &odometry_of(1100 + after_ms, next));
    assert!(!next.jumped && counts(&next) != after, "{next:?}");
    [heard.jumped, after == before]
}

#[test]
fn odometry_that_jumps_aside_or_farther_than_the_robot_moves_or_starts_again_counts_as_no_motion() {
    let ahead = |way: f64| [1.0 + way * 0.3_f64.cos(), 0.5 + way * 0.3_f64.sin(), 0.3];
    let aside = |way: f64| [1.0 - way * 0.3_f64.sin(), 0.5 + way * 0.3_f64.cos(), 0.3];
    for (after_ms, pose, jumps) in [
        (100, ahead(0.1), true),
        (100, ahead(-0.1), true),
        // A whole cycle of the counts.
        (100, ahead(1.887), true),
        (100, aside(0.05), true),
        (100, aside(-2.0), true),
        (100, [1.0, 0.5, 1.3], true),
        (100, [0.0; 3], true),
        (10_000, [0.0; 3], true),
        (10_000, [0.02, -0.01, 0.03], true),
        (100, ahead(0.022), false),
        (100, ahead(-0.022), false),
        (1000, ahead(0.22), false),
        (10_000, ahead(2.0), false),
        (100, [1.0, 0.5, 0.575], false),
        (10_000, [0.2, 0.1, 0.3], false),
    ] {
        assert_eq!(jump(after_ms, pose), [jumps; 2], "{after_ms} {pose:?}");
    }
}
