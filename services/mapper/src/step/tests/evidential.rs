use super::*;
use common::wire::{infrared_ad, infrared_m};

/// Delta = 0.1 m, the origin in cell (25, 25). The sensor is 0.2 m ahead, the body's radius 0.19 m.
fn mapper(extra: &str) -> Mapper {
    mapper_of(&format!(
        "target = [2, 0]\nperimeter = {{ width_m = 5, cells = 50 }}\nsonar.forward_m = 0.2\nmapper.map_within_m = 1.0\n{extra}"
    ))
}

impl Mapper {
    fn hear(&mut self, heading: f64, heard: Option<f64>) {
        self.hear_from(0.0, heading, heard);
    }

    fn hear_from(&mut self, x: f64, heading: f64, heard: Option<f64>) {
        let heard = heard.map_or(reading(RangeStatus::Nothing, 0.0), echo);
        self.sense(at(x, 0.0, heading), &[heard]);
    }

    fn see(&mut self, infrared_ad: [u16; 7]) {
        self.sense(start(), &rays(infrared_ad));
    }
}

#[test]
fn a_wall_just_outside_the_perimeter_blocks_what_the_body_would_touch_inside() {
    let mut mapper = mapper("");
    // The map ends at x = 2.45. A wall stands at 2.5, 0.5 m ahead of the sensor. The body reaches
    // 0.22 m and half a cell.
    for _ in 0..3 {
        mapper.hear_from(1.8, 0.0, Some(0.5));
    }
    assert!(mapper.hazard_ahead(230) && !mapper.hazard_ahead(220));
}

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

/// Returns counts of the rear ranger, which looks along -x from (-0.19, 0); the others are dead.
fn rear(range_m: f64) -> [u16; 7] {
    let mut counts = [0; 7];
    counts[5] = infrared_ad(range_m);
    counts
}

#[test]
fn an_infrared_ray_frees_the_ground_up_to_its_distance_and_no_further() {
    let mut mapper = mapper(INFRARED);
    mapper.see(rear(0.6));
    // The echo is at -0.79. Body and clearance reach 0.22 m and half a cell around it.
    assert_eq!(mapper.ahead(-40), Scanned);
    assert!(mapper.hazard_ahead(-80) && !mapper.hazard_ahead(-50));
    assert_eq!(mapper.ahead(-120), Free);
    assert_eq!(mapper.state_at(-40, 30), Free, "it is thin");
    assert_eq!(mapper.state().safety_events, 1);
}

#[test]
fn an_infrared_ranger_that_sees_nothing_frees_ground_only_if_it_is_live_and_among_the_sensors() {
    for (set, counts, state) in [
        (INFRARED, rear(0.81), Scanned),
        (INFRARED, [0; 7], Free),
        (INFRARED, [4095; 7], Free),
        // Nor is an echo mapped.
        ("sensors = 'front'", rear(0.6), Free),
    ] {
        let mut mapper = mapper(set);
        mapper.see(counts);
        assert_eq!([-40, -80].map(|x| mapper.ahead(x)), [state; 2], "{set} {counts:?}");
        assert_eq!(mapper.state().safety_events, 0);
    }
}

#[test]
fn silence_of_the_sonar_does_not_take_back_what_infrared_saw() {
    let mut mapper = mapper(INFRARED);
    // The obstacle is ahead to the left, seen from (0.19, 0) at 11.25 degrees.
    let mut counts = [0; 7];
    counts[1] = infrared_ad(0.5);
    mapper.see(counts);
    for _ in 0..8 {
        mapper.hear(11.25_f64.to_radians(), None);
    }
    assert!(mapper.is_hazard(70, 15));
}

#[test]
fn a_false_echo_is_gone_after_a_look_without_an_echo_at_it() {
    let mut mapper = mapper("");
    mapper.hear(0.0, Some(0.4));
    assert!(mapper.hazard_ahead(60));
    for step in -4..=4 {
        mapper.hear(0.1 * f64::from(step), None);
    }
    assert_eq!(mapper.ahead(60), Scanned);
}

#[test]
fn no_echo_at_a_slant_does_not_take_back_what_was_heard_squarely() {
    let mut mapper = mapper("");
    for _ in 0..3 {
        mapper.hear(0.0, Some(0.7));
    }
    // The beam comes from the other side, where a smooth wall would give no echo.
    for _ in 0..27 {
        mapper.hear_from(1.9, std::f64::consts::PI, None);
    }
    assert!(mapper.hazard_ahead(90));
}

#[test]
fn scanned_ground_grows_stale_as_the_wheels_roll() {
    let mut mapper = mapper("");
    mapper.hear(0.0, None);
    assert_eq!(mapper.ahead(90), Scanned);
    // Six turns on the spot roll each wheel 4.9 m; the beam finally looks the other way.
    let heading = 13.0 * std::f64::consts::PI;
    mapper.hear(heading, None);
    assert_eq!(mapper.ahead(90), Free);
    assert_eq!(mapper.ahead(-90), Scanned);
}

#[test]
fn a_belief_of_the_other_method_is_refused() {
    let saved = mapper("method = 'paper'").state().clone();
    assert_eq!(mapper("").restore(saved), Err(ForeignState));
}

#[test]
fn what_is_forgotten_first_is_what_is_not_near_and_then_all_of_it() {
    let mut mapper = mapper("");
    mapper.hear(0.0, Some(0.9));
    mapper.hear(2.0, Some(0.3));
    assert!(mapper.reset(1) && !mapper.reset(1));
    assert!(!mapper.hazard_ahead(110) && mapper.is_hazard(-21, 45));
    assert!(mapper.reset(2) && !mapper.is_hazard(-21, 45));
}

#[test]
fn readings_are_published_until_the_wheels_have_rolled_too_far() {
    let beams = |mapper: &Mapper| {
        let header = mapper.header(Part::default());
        header.clear_beams().to_vec()
    };
    let mut mapper = mapper("sensors = 'front'");
    mapper.hear(0.0, Some(0.7));
    mapper.hear(0.5, None);
    let [echo, silence] = beams(&mapper)[..] else {
        panic!("{:?}", beams(&mapper));
    };
    assert!((f64::from(echo.x_m) - 0.2).abs() < 1e-6 && echo.bearing_rad == 0.0);
    assert!((0.6..0.7).contains(&echo.clear_m), "{echo:?}");
    assert!(silence.bearing_rad == 0.5 && silence.clear_m >= 1.5, "{silence:?}");
    for tick in 2..200 {
        mapper.hear(0.5 + tick as f64, None);
    }
    assert!(beams(&mapper).len() < 50);
    // A wrong pose may be the cause of a reset.
    mapper.reset(1);
    assert!(beams(&mapper).is_empty());
}

#[test]
fn a_contact_is_hazard_where_the_body_touches_and_no_ranger_is_evidence_against_it() {
    let mut mapper = mapper(INFRARED);
    mapper.touch(0.0);
    let touched = |mapper: &Mapper| {
        assert!(!mapper.hazard_ahead(-40), "behind it is free");
        mapper.hazard_ahead(20) && mapper.hazard_ahead(40)
    };
    assert!(touched(&mapper));
    // The ranger looks over the object.
    let mut readings = rays([infrared_ad(0.8); 7]);
    readings.push(reading(RangeStatus::Nothing, 0.0));
    for _ in 0..39 {
        mapper.sense(at(-0.3, 0.0, 0.0), &readings);
    }
    assert!(touched(&mapper));
    mapper.hear_from(0.2, 0.0, None);
    assert!(!mapper.hazard_ahead(20));
}

#[test]
fn three_sonars_have_room_for_as_many_ticks_of_readings_as_one_and_map_what_is_at_45_degrees() {
    let left = RangeReading { sensor: 1, ..echo(0.5) };
    for (sensors, readings) in [("front", 128), ("three-front", 384), ("all", 384)] {
        let mut mapper = mapper(&format!("sensors = '{sensors}'"));
        let mut beside = mapper.clone();
        beside.sense(start(), &[left]);
        assert_eq!(beside.is_hazard(49, 49), sensors != "front", "{sensors}");
        assert!(!beside.is_hazard(49, -49));
        let heard = |sensor| RangeReading { sensor, ..reading(RangeStatus::Nothing, 0.0) };
        for _ in 0..200 {
            mapper.sense(start(), &[0, 1, 2].map(heard));
        }
        let kept = mapper.header(Part::default()).clear_beams().len();
        assert!(kept == readings || sensors == "all", "{sensors}: {kept}");
    }
}

#[test]
fn a_reading_that_no_sensor_can_give_is_ignored() {
    let mut mapper = mapper("");
    let wrong = [(200, 0.5), (0, f64::NAN), (4, f64::NAN), (5, -1.0)];
    let readings = wrong.map(|(sensor, range_m)| RangeReading { sensor, ..echo(range_m) });
    mapper.sense(start(), &readings);
    assert_eq!(mapper.state().safety_events, 0);
}

#[test]
fn evidence_that_nothing_renews_is_weaker_with_time_and_gone_when_it_should_be() {
    let hear = |mapper: &mut Mapper, second: u64, heard: Option<f64>| {
        let stamp = Stamp { stamp_ns: second * 1_000_000_000, ..Stamp::default() };
        mapper.sense(PoseSample { stamp, ..start() }, heard.map(echo).as_slice());
    };
    let gone_after = |set: &str, echoes: u64| {
        let mut mapper = mapper(set);
        (0..echoes).for_each(|second| hear(&mut mapper, second, Some(0.7)));
        assert!(mapper.hazard_ahead(90) && mapper.ahead(50) == Scanned);
        let gone = (echoes..400).find(|second| {
            hear(&mut mapper, *second, None);
            !mapper.hazard_ahead(90)
        });
        (gone, mapper.ahead(50))
    };
    let forgets = "mapper.forget_after_s = 120";
    // Three echoes reach the maximum weight, one a third of it.
    assert_eq!(gone_after(forgets, 3), (Some(120), Free));
    assert_eq!(gone_after(forgets, 1), (Some(40), Scanned));
    assert_eq!(gone_after("", 3), (None, Scanned));
}
