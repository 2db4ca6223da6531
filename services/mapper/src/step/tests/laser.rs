//! Tests of a laser beside a sonar.

use common::kinematics::Pose2;

use super::*;
use crate::testing::range_in_room;

/// The laser has 360 beams around the robot's centre; the sonar looks ahead from 0.2 m.
fn mapper() -> Mapper {
    let text = "target = [2, 0]\nrobot.model = 'kobuki'\nperimeter = { width_m = 5, cells = 50 }\n\
        [[robot.sensor]]\nname = 'laser'\nkind = 'scan'\nchannel = 0\nforward_m = 0\nbearing_deg = 0\nmodel = 'rplidar-a1'\n\
        [[robot.sensor]]\nname = 'sonar'\nkind = 'cone'\nchannel = 0\nforward_m = 0.2\nbearing_deg = 0\n";
    mapper_of(text)
}

impl Mapper {
    /// Maps a wall at `wall` metres by laser, and an echo, at the origin facing along x.
    fn sense_wall(&mut self, ticks: usize, wall: f64, echo: f64) {
        let beam = |degrees: u32| {
            let ahead = (f64::from(degrees) - 180.0).to_radians().cos();
            if ahead > 0.1 { (wall / ahead) as f32 } else { f32::INFINITY }
        };
        for _ in 0..ticks {
            let ranges = vec![RangeReading { sensor: 1, ..super::echo(echo) }];
            let scans = vec![Scan { beams: (0..360).map(beam).collect(), ..Scan::default() }];
            self.give(Tick { ranges, scans, ..Tick::default() });
        }
    }
}

#[test]
fn a_thing_that_the_laser_looks_over_is_hazard_while_the_sonar_hears_it_and_after_a_restart() {
    let mut mapper = mapper();
    mapper.sense_wall(20, 2.0, 0.4);
    assert!(mapper.hazard_ahead(60));
    let mut restarted = self::mapper();
    restarted.restore(mapper.state().clone()).unwrap();
    for mapper in [&mut mapper, &mut restarted] {
        mapper.sense_wall(1, 2.0, 0.4);
    }
    assert_eq!(mapper.state(), restarted.state());
    mapper.sense_wall(19, 2.0, 1.8);
    assert!(!mapper.hazard_ahead(60), "the sonar hears that it is gone");
}

#[test]
fn an_echo_of_what_the_laser_sees_marks_nothing_beside_it() {
    let mut mapper = mapper();
    mapper.sense_wall(1, 1.0, 0.8);
    let by_scan = mapper.hazards();
    for echo in [0.79, 0.8, 0.81, 0.82] {
        mapper.sense_wall(1, 1.0, echo);
    }
    assert_eq!(mapper.hazards(), by_scan);
    mapper.sense_wall(1, 1.0, 0.5);
    assert!(mapper.hazards().len() > by_scan.len(), "another echo does");
}

#[test]
fn a_pane_of_glass_stays_though_the_laser_looks_through_it_at_a_slant() {
    let mut mapper = mapper();
    mapper.sense_wall(5, 0.7, 0.5);
    mapper.sense_wall(10, 2.0, 0.5);
    assert!(mapper.hazard_ahead(60));
}

#[test]
fn what_one_laser_sees_is_hazard_though_another_looks_over_it_and_both_scan_ground() {
    let text = "target = [2, 0]\nrobot.model = 'kobuki'\n\
        perimeter = { width_m = 5, cells = 50 }\nrobot.sensor = [\n\
        { name = 'low', kind = 'scan', forward_m = 0, bearing_deg = 0, \
        beams = 181, field_of_view_deg = 180 },\n\
        { name = 'high', kind = 'scan', forward_m = 0, bearing_deg = 0, \
        beams = 181, field_of_view_deg = 180 },\n\
        { name = 'back', kind = 'scan', forward_m = 0, bearing_deg = 180, \
        beams = 181, field_of_view_deg = 180 },\n]";
    let mut mapper = mapper_of(text);
    let scan = |row: usize, range: f32| Scan { row, beams: vec![range; 181], ..Scan::default() };
    for _ in 0..10 {
        mapper.scan(start(), vec![scan(0, 0.8), scan(1, 2.0), scan(2, 1.2)]);
    }
    let hazards = [80, 180, -120, -80].map(|x| mapper.hazard_ahead(x));
    assert_eq!(hazards, [true, true, true, false]);
    assert_eq!([-60, 40, 140].map(|x| mapper.ahead(x)), [Scanned; 3]);
    let mut restarted = mapper_of(text);
    restarted.restore(mapper.state().clone()).unwrap();
    assert!(restarted.hazard_ahead(80) && restarted.hazard_ahead(-120));
    for _ in 0..4 {
        mapper.scan(start(), vec![scan(0, 2.0), scan(1, 2.0)]);
    }
    assert!(!mapper.hazard_ahead(80) && mapper.hazard_ahead(-120));
}

/// Returns the least hazard y before the wall y = 1.25 for several x.
///
/// The laser of `row` is mounted at `at`, ahead and left of the robot's centre; its middle beam
/// looks to `looks_deg`.
fn wall_of(row: &str, at: DVec2, looks_deg: f64) -> Vec<f64> {
    let text = format!(
        "target = [2, 0]\nrobot.model = 'create3'\nperimeter = {{ width_m = 5, cells = 100 }}\n\
        [[robot.sensor]]\nname = 'laser'\nkind = 'scan'\nchannel = 0\nmodel = 'rplidar-a1'\n{row}\n"
    );
    let mut mapper = mapper_of(&text);
    let robot = Pose2 { position: dvec2(0.3, -0.2), heading: 0.5 };
    let origin = robot.position + DVec2::from_angle(robot.heading).rotate(at);
    let beam = |degrees: u32| {
        let angle = robot.heading + (looks_deg - 180.0 + f64::from(degrees)).to_radians();
        let walls = dvec2(f64::INFINITY, 1.25);
        range_in_room(walls, origin, DVec2::from_angle(angle)) as f32
    };
    let Pose2 { position, heading } = robot;
    for _ in 0..5 {
        let scan = Scan { beams: (0..360).map(beam).collect(), ..Scan::default() };
        mapper.scan(super::at(position.x, position.y, heading), vec![scan]);
    }
    let before = |x| {
        (52..125).find(|y| mapper.is_hazard(x, *y)).map_or(f64::INFINITY, |y| f64::from(y) / 100.0)
    };
    [-50, 0, 30, 80, 120].map(before).to_vec()
}

#[test]
fn a_laser_that_is_turned_and_off_the_centre_maps_a_wall_where_it_is() {
    let centred = wall_of("forward_m = 0\nbearing_deg = 0", DVec2::ZERO, 0.0);
    assert!(centred.iter().all(|y| (0.95..=1.25).contains(y)), "{centred:?}");
    for (row, at, looks_deg) in [
        ("forward_m = -0.04\nbearing_deg = 0\nturned_deg = 90", dvec2(-0.04, 0.0), 90.0),
        ("forward_m = 0.3\nbearing_deg = 90\nturned_deg = -120", dvec2(0.0, 0.3), -30.0),
    ] {
        let wall = wall_of(row, at, looks_deg);
        let is_there = centred.iter().zip(&wall).all(|(one, other)| (one - other).abs() < 0.06);
        assert!(is_there, "{row}: {wall:?} instead of {centred:?}");
    }
}

fn circling(s: f64) -> Pose2 {
    Pose2::default().along_arc(0.5 * s, s)
}

/// Returns a tick's laser scan on the circling robot in a room of 6 m by 4 m.
fn scan_in_room(s: f64, sweep: Sweep) -> Vec<f32> {
    let beam = |beam: usize| {
        let robot = circling(s + sweep.beam_time_ns(beam, 360) as f64 / 1e9);
        let along = DVec2::from_angle(robot.heading + (beam as f64 - 180.0).to_radians());
        range_in_room(dvec2(3.0, 2.0), robot.position, along) as f32
    };
    (0..360).map(beam).collect()
}

#[test]
fn a_scan_is_matched_and_mapped_where_it_was_taken_however_late_it_is_and_however_long_it_took() {
    let text = "target = [0, 0]\nrobot.model = 'kobuki'\nrobot.rate_hz = 10\nperimeter = { width_m = 8, cells = 80 }\n\
        [[robot.sensor]]\nname = 'laser'\nkind = 'scan'\nchannel = 0\nforward_m = 0\nbearing_deg = 0\nmodel = 'rplidar-a1'\n";
    let mission = mission(text);
    let beam_ns = 200_000_000 / 360;
    let sweeps = [
        Sweep::default(),
        Sweep { first_beam_ns: -100_000_000, ..Sweep::default() },
        Sweep { first_beam_ns: -300_000_000, ..Sweep::default() },
        Sweep { first_beam_ns: 50_000_000, ..Sweep::default() },
        Sweep { first_beam_ns: -200_000_000, beam_ns, first_beam: 0 },
        Sweep { first_beam_ns: -250_000_000, beam_ns: -beam_ns, first_beam: 100 },
    ];
    for sweep in sweeps {
        let mut mapper = Mapper::new(&mission);
        for tick in 10..80_u64 {
            let s = tick as f64 / 10.0;
            let mut pose = circling(s);
            // Corrections of the pose are no motion.
            let moved = if tick > 40 { dvec2(0.0, 0.02) } else { DVec2::ZERO };
            pose.position += moved;
            let Pose2 { position, heading } = pose;
            let mut pose = at(position.x, position.y, heading);
            (pose.map_from_odom, pose.v_m_s) = ([moved.x, moved.y, 0.0], 0.5);
            pose.stamp.stamp_ns = tick * 100_000_000;
            mapper.scan(pose, vec![Scan { beams: scan_in_room(s, sweep), sweep, row: 0 }]);
            let Some(fix) = mapper.take_fix() else {
                assert!(tick < 15, "{sweep:?} {tick}");
                continue;
            };
            let truth = circling(fix.capture_ns as f64 / 1e9);
            let off = truth.position.distance(dvec2(fix.x_m, fix.y_m));
            let turned = (fix.heading_rad - truth.heading).abs();
            assert!(off < 0.015 && turned < 0.01, "{sweep:?} {tick}: {off} m, {turned} rad");
        }
        let reach = hazard_reach_m(&mission);
        for cell in mapper.hazards() {
            let there = mapper.frame().centre_of(cell);
            let to_wall = (3.0 - there.x.abs()).min(2.0 - there.y.abs());
            assert!(to_wall <= reach + 0.1, "{sweep:?}: {there} is {to_wall} m from a wall");
        }
    }
}

#[test]
fn a_scan_of_impossible_times_is_left_out() {
    for sweep in [
        Sweep { first_beam_ns: i64::MIN, beam_ns: i64::MIN, first_beam: u64::MAX },
        Sweep { first_beam_ns: -1_900_000_000, ..Sweep::default() },
        Sweep { first_beam_ns: 0, beam_ns: i64::MAX, first_beam: 3 },
        Sweep { first_beam_ns: 0, beam_ns: 1, first_beam: 360 },
    ] {
        let mut mapper = mapper();
        let before = mapper.state().cells.to_vec();
        for tick in 1..4 {
            let mut pose = start();
            (pose.stamp.stamp_ns, pose.v_m_s) = (tick * 100_000_000, 0.3);
            mapper.scan(pose, vec![Scan { beams: vec![1.0; 360], sweep, row: 0 }]);
            assert!(mapper.take_fix().is_none());
        }
        assert_eq!(mapper.state().cells, before, "{sweep:?}");
    }
}
