//! The evidential method, reading by reading.

use super::*;
use common::wire::{infrared_ad, infrared_m};

/// Delta = 0.1 m, the origin in cell (25, 25). The sensor is 0.2 m ahead, the body's radius 0.19 m.
fn mapper(extra: &str) -> Mapper {
    let text = format!(
        "target = [2, 0]\nperimeter = {{ width_m = 5, cells = 50 }}\nsonar = {{ forward_m = 0.2 }}\n{extra}\n[mapper]\nmap_within_m = 1.0\n"
    );
    Mapper::new(&Mission::parse(&text, Path::new("test.toml")).unwrap())
}

/// A robot at (x, 0) facing `heading` hears an echo, or nothing.
fn hear(mapper: &mut Mapper, tick: u64, x: f64, heading: f64, echo: Option<f64>) -> Window {
    let stamp = Stamp { tick, ..Stamp::default() };
    let pose = PoseSample { stamp, x_m: x, heading_rad: heading, ..PoseSample::default() };
    let status = echo.map_or(RangeStatus::Nothing, |_| RangeStatus::Measured);
    mapper.hear(&pose, Some(&reading(status, echo.unwrap_or_default())))
}

fn state(mapper: &Mapper, x: f64, y: f64) -> CellState {
    let cell = mapper.frame().cell_at(DVec2::new(x, y)).unwrap();
    CellState::from_byte(mapper.state().cells()[mapper.frame().index(cell)])
}

#[test]
fn a_hit_is_hazard_as_far_as_the_body_reaches_and_the_ground_before_it_is_swept() {
    let mut mapper = mapper("");
    hear(&mut mapper, 0, 0.0, 0.0, Some(0.7));
    // The hit is at 0.9; the body and its clearance reach 0.22 m and half a cell around.
    assert!(state(&mapper, 0.9, 0.0).is_hazard());
    assert_eq!(state(&mapper, 0.7, 0.0), CellState::Margin);
    assert_eq!(state(&mapper, 0.5, 0.0), CellState::Scanned);
    assert_eq!(state(&mapper, 0.5, 0.5), CellState::Free);
    assert_eq!(mapper.state().safety_events(), 1);
}

#[test]
fn a_wall_just_outside_the_perimeter_blocks_what_the_body_would_touch_inside() {
    let mut mapper = mapper("");
    // The map ends at x = 2.45; a wall stands at 2.5, 0.5 m ahead of the sensor. The body reaches 0.22 m and half a cell.
    for tick in 0..3 {
        hear(&mut mapper, tick, 1.8, 0.0, Some(0.5));
    }
    assert!(state(&mapper, 2.3, 0.0).is_hazard());
    assert!(!state(&mapper, 2.2, 0.0).is_hazard());
}

/// A robot at the origin facing along x whose infrared rangers give these counts, and whose sonar gives nothing.
fn see(mapper: &mut Mapper, tick: u64, infrared_ad: [u16; 7]) {
    let stamp = Stamp { tick, ..Stamp::default() };
    let pose = PoseSample { stamp, ..PoseSample::default() };
    mapper.sense(&pose, rays(infrared_ad));
}

/// The readings that the link computes from these counts.
fn rays(infrared_ad: [u16; 7]) -> Vec<RangeReading> {
    let of = |(sensor, ad)| {
        let status = match ad {
            0 | 4095 => RangeStatus::Invalid,
            _ if infrared_m(ad) >= 0.81 => RangeStatus::Nothing,
            _ => RangeStatus::Measured,
        };
        RangeReading { sensor, ..reading(status, infrared_m(ad)) }
    };
    (3..).zip(infrared_ad).map(of).collect()
}

const INFRARED: &str = "sensors = 'front+infrared'";

/// The rear ranger, which looks along -x from (-0.19, 0), sees something at `range_m`; the others are dead.
fn rear(range_m: f64) -> [u16; 7] {
    let mut counts = [0; 7];
    counts[5] = infrared_ad(range_m);
    counts
}

#[test]
fn an_infrared_ray_frees_the_ground_up_to_its_distance_and_no_further() {
    let mut mapper = mapper(INFRARED);
    see(&mut mapper, 0, rear(0.6));
    // The echo is at -0.79; the body and its clearance reach 0.22 m and half a cell around it.
    assert_eq!(state(&mapper, -0.4, 0.0), CellState::Scanned);
    assert!(state(&mapper, -0.8, 0.0).is_hazard());
    assert!(!state(&mapper, -0.5, 0.0).is_hazard());
    assert_eq!(state(&mapper, -1.2, 0.0), CellState::Free);
    assert_eq!(state(&mapper, -0.4, 0.3), CellState::Free, "it is thin");
    assert_eq!(mapper.state().safety_events(), 1);
}

#[test]
fn an_infrared_ranger_that_sees_nothing_frees_ground_only_if_it_is_live() {
    let mut live = mapper(INFRARED);
    see(&mut live, 0, rear(0.81));
    assert_eq!(state(&live, -0.8, 0.0), CellState::Scanned);
    assert_eq!(live.state().safety_events(), 0);
    let mut dead = mapper(INFRARED);
    see(&mut dead, 0, [0; 7]);
    let mut saturated = mapper(INFRARED);
    see(&mut saturated, 0, [4095; 7]);
    for mapper in [dead, saturated] {
        assert_eq!(state(&mapper, -0.4, 0.0), CellState::Free);
        assert_eq!(mapper.state().safety_events(), 0);
    }
}

#[test]
fn an_infrared_reading_nearer_than_10_cm_frees_nothing() {
    let mut near = mapper(INFRARED);
    see(&mut near, 0, rear(0.81));
    assert_eq!(state(&near, -0.5, 0.0), CellState::Scanned);
    let mut nearer = mapper(INFRARED);
    see(&mut nearer, 0, rear(0.09));
    assert!(state(&nearer, -0.3, 0.0).is_hazard());
    assert_eq!(state(&nearer, -0.5, 0.0), CellState::Sensed);
}

#[test]
fn silence_of_the_sonar_does_not_take_back_what_infrared_saw() {
    let mut mapper = mapper(INFRARED);
    // The obstacle is ahead to the left, seen from (0.19, 0) at 11.25 degrees.
    let mut counts = [0; 7];
    counts[1] = infrared_ad(0.5);
    see(&mut mapper, 0, counts);
    for tick in 1..9 {
        hear(&mut mapper, tick, 0.0, 11.25_f64.to_radians(), None);
    }
    assert!(state(&mapper, 0.7, 0.15).is_hazard());
}

#[test]
fn without_infrared_among_the_sensors_its_readings_are_not_mapped() {
    let mut mapper = mapper("sensors = 'front'");
    see(&mut mapper, 0, rear(0.6));
    assert_eq!(state(&mapper, -0.4, 0.0), CellState::Free);
    assert_eq!(mapper.state().safety_events(), 0);
}

#[test]
fn a_false_echo_is_gone_after_a_look_without_an_echo_at_it() {
    let mut mapper = mapper("");
    hear(&mut mapper, 0, 0.0, 0.0, Some(0.4));
    assert!(state(&mapper, 0.6, 0.0).is_hazard());
    for tick in 1..=9 {
        let heading = 0.1 * (tick as f64 - 5.0);
        hear(&mut mapper, tick, 0.0, heading, None);
    }
    assert_eq!(state(&mapper, 0.6, 0.0), CellState::Scanned);
}

#[test]
fn no_echo_at_a_slant_does_not_take_back_what_was_heard_squarely() {
    let mut mapper = mapper("");
    for tick in 0..3 {
        hear(&mut mapper, tick, 0.0, 0.0, Some(0.7));
    }
    // The beam comes from the other side now, from where a smooth wall would give no echo.
    for tick in 3..30 {
        hear(&mut mapper, tick, 1.9, std::f64::consts::PI, None);
    }
    assert!(state(&mapper, 0.9, 0.0).is_hazard());
}

#[test]
fn a_well_known_thing_explains_the_echo_and_does_not_grow_at_its_ends() {
    let mut mapper = mapper("");
    for tick in 0..4 {
        hear(&mut mapper, tick, 0.0, 0.0, Some(0.7));
    }
    let hazards = |mapper: &Mapper| {
        let cells = mapper.state().cells().iter();
        cells.filter(|&&cell| CellState::from_byte(cell).is_hazard()).count()
    };
    let before = hazards(&mapper);
    // The robot turned by half the arc: its edge meets the thing, its middle meets nothing new.
    hear(&mut mapper, 4, 0.0, 0.25, Some(0.7));
    assert_eq!(hazards(&mapper), before);
}

#[test]
fn an_echo_beyond_reach_is_not_mapped() {
    let mut mapper = mapper("");
    hear(&mut mapper, 0, 0.0, 0.0, Some(1.4));
    assert_eq!(mapper.state().safety_events(), 0);
    assert_eq!(state(&mapper, 1.0, 0.0), CellState::Scanned);
}

#[test]
fn scanned_ground_grows_stale_as_the_wheels_roll() {
    let mut mapper = mapper("");
    hear(&mut mapper, 0, 0.0, 0.0, None);
    assert_eq!(state(&mapper, 0.9, 0.0), CellState::Scanned);
    // The robot turns six times on the spot: each wheel rolls 4.9 m, and the beam looks the other way at the end.
    let heading = 13.0 * std::f64::consts::PI;
    hear(&mut mapper, 1, 0.0, heading, None);
    assert_eq!(state(&mapper, 0.9, 0.0), CellState::Free);
    assert_eq!(state(&mapper, -0.9, 0.0), CellState::Scanned);
}

#[test]
fn a_mapper_that_was_killed_goes_on_to_the_bit() {
    let mut first = mapper("");
    for tick in 0..5 {
        hear(&mut first, tick, 0.0, 0.1 * tick as f64, Some(0.6));
    }
    let mut successor = mapper("");
    successor.restore(first.state().clone()).unwrap();
    for tick in 5..9 {
        let echo = (tick % 2 == 0).then_some(0.5);
        for mapper in [&mut first, &mut successor] {
            hear(mapper, tick, 0.02, -0.1 * tick as f64, echo);
        }
    }
    assert_eq!(first.state(), successor.state());
}

#[test]
fn a_belief_of_the_other_method_is_refused() {
    let saved = mapper("method = 'paper'").state().clone();
    assert_eq!(mapper("").restore(saved), Err(ForeignState));
}

#[test]
fn what_is_forgotten_first_is_what_is_not_near_and_then_all_of_it() {
    let mut mapper = mapper("");
    hear(&mut mapper, 0, 0.0, 0.0, Some(0.9));
    hear(&mut mapper, 1, 0.0, 2.0, Some(0.3));
    assert!(mapper.reset(1) && !mapper.reset(1));
    assert!(!state(&mapper, 1.1, 0.0).is_hazard());
    let near = DVec2::from_angle(2.0) * 0.5;
    assert!(state(&mapper, near.x, near.y).is_hazard());
    assert!(mapper.reset(2));
    assert!(!state(&mapper, near.x, near.y).is_hazard());
}

#[test]
fn the_targets_cell_is_never_hazard() {
    let mut mapper = mapper("");
    hear(&mut mapper, 0, 1.3, 0.0, Some(0.5));
    assert!(state(&mapper, 1.9, 0.0).is_hazard());
    assert!(!state(&mapper, 2.0, 0.0).is_hazard());
}

#[test]
fn readings_are_published_until_the_wheels_have_rolled_too_far() {
    let beams = |mapper: &Mapper| {
        let header = mapper.header(Part::default());
        header.clear_beams().to_vec()
    };
    let mut mapper = mapper("sensors = 'front'");
    hear(&mut mapper, 0, 0.0, 0.0, Some(0.7));
    hear(&mut mapper, 1, 0.0, 0.5, None);
    let [echo, silence] = beams(&mapper)[..] else {
        panic!("{:?}", beams(&mapper));
    };
    assert!((f64::from(echo.x_m) - 0.2).abs() < 1e-6 && echo.bearing_rad == 0.0);
    assert!((0.6..0.7).contains(&echo.clear_m), "{echo:?}");
    assert!(silence.bearing_rad == 0.5 && silence.clear_m >= 1.5, "{silence:?}");
    // The robot turns on the spot until the wheels have rolled farther than a reading is valid.
    for tick in 2..200 {
        hear(&mut mapper, tick, 0.0, 0.5 + tick as f64, None);
    }
    assert!(beams(&mapper).len() < 50, "{}", beams(&mapper).len());
    // A reset deletes the readings, because a wrong pose may be the cause.
    mapper.reset(1);
    assert!(beams(&mapper).is_empty());
}

#[test]
fn a_contact_is_hazard_where_the_body_touches_and_no_ranger_is_evidence_against_it() {
    let mut mapper = mapper(INFRARED);
    mapper.touch(&PoseSample::default(), 0.0);
    let touched = |mapper: &Mapper| {
        assert!(!state(mapper, -0.4, 0.0).is_hazard(), "behind it is free");
        state(mapper, 0.2, 0.0).is_hazard() && state(mapper, 0.4, 0.0).is_hazard()
    };
    assert!(touched(&mapper));
    // The robot has backed off, and the ranger looks over the thing.
    let far = [infrared_ad(0.8); 7];
    for tick in 1..40 {
        let stamp = Stamp { tick, ..Stamp::default() };
        let pose = PoseSample { stamp, x_m: -0.3, ..PoseSample::default() };
        let mut readings = rays(far);
        readings.push(reading(RangeStatus::Nothing, 0.0));
        mapper.sense(&pose, readings);
    }
    assert!(touched(&mapper));
    // Nothing stands where the body is.
    hear(&mut mapper, 40, 0.2, 0.0, None);
    assert!(!state(&mapper, 0.2, 0.0).is_hazard());
}

/// The number of readings of sonars in `grid` after so many ticks of a robot that stands.
fn beams_after(sensors: &str, ticks: u64) -> usize {
    let mut mapper = mapper(&format!("sensors = '{sensors}'"));
    for tick in 0..ticks {
        let stamp = Stamp { tick, ..Stamp::default() };
        let heard = |sensor| RangeReading { sensor, ..reading(RangeStatus::Nothing, 0.0) };
        mapper.sense(&PoseSample { stamp, ..PoseSample::default() }, (0..3).map(heard).collect());
    }
    mapper.header(Part::default()).clear_beams().len()
}

#[test]
fn three_sonars_have_room_for_as_many_ticks_of_readings_as_one() {
    assert_eq!(beams_after("front", 200), 128);
    assert_eq!(beams_after("three-front", 200), 384);
}

#[test]
fn the_sonars_beside_the_front_one_map_what_is_at_45_degrees() {
    let there = DVec2::from_angle(std::f64::consts::FRAC_PI_4) * (0.194 + 0.5);
    let left = RangeReading { sensor: 1, ..reading(RangeStatus::Measured, 0.5) };
    for (sensors, is_mapped) in [("front", false), ("three-front", true), ("all", true)] {
        let mut mapper = mapper(&format!("sensors = '{sensors}'"));
        mapper.sense(&PoseSample::default(), vec![left]);
        assert_eq!(state(&mapper, there.x, there.y).is_hazard(), is_mapped, "{sensors}");
        assert!(!state(&mapper, there.x, -there.y).is_hazard());
    }
}

#[test]
fn a_reading_that_no_sensor_can_give_is_ignored() {
    let mut mapper = mapper("");
    let wrong = [(200, 0.5), (0, f64::NAN), (4, f64::NAN), (5, -1.0)];
    let readings = wrong.map(|(sensor, range_m)| RangeReading {
        sensor,
        ..reading(RangeStatus::Measured, range_m)
    });
    mapper.sense(&PoseSample::default(), readings.to_vec());
    assert_eq!(mapper.state().safety_events(), 0);
}
