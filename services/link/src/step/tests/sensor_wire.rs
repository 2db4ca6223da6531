//! Tests of a laser on its own wire.

use common::driver::{Heard, LaserScan};

use super::*;

/// Each byte is the range of all beams, metres; 0 is outside the protocol.
#[derive(Debug)]
struct Laser;

impl Driver for Laser {
    fn hear(&mut self, bytes: &[u8]) -> Heard {
        let mut heard = Heard { anything: true, ..Heard::default() };
        match bytes[0] {
            0 => heard.refused = Some("no scan".into()),
            metres => {
                let beams = vec![f32::from(metres); 360];
                heard.scans = vec![LaserScan { beams, ..LaserScan::default() }];
            }
        }
        heard
    }

    fn reset(&mut self) {}

    fn tally(&self) -> WireTally {
        WireTally::default()
    }

    fn greeting(&self) -> Vec<u8> {
        b"scan".to_vec()
    }
}

#[test]
fn a_sensor_with_a_wire_of_its_own_is_greeted_heard_at_the_next_tick_and_no_sign_of_the_robot() {
    let mut link = in_time(&mission("robot.model = 'kobuki'"));
    link.drivers.push(Box::new(Laser));
    let greeted = link.at(Event::SensorWire(0, true), 0);
    assert!(greeted.contains(&Effect::SendSensor(0, b"scan".to_vec())), "{greeted:?}");
    link.at(Event::Sensor(0, &[1]), 1);
    assert!(!link.connected());
    let wheels = b"{\"wheels\":[0,0],\"speeds\":[0,0]}\n";
    link.hears(wheels, 10);
    link.drive(11);
    link.at(Event::Sensor(0, &[2]), 50);
    // No such sensor.
    link.at(Event::Sensor(7, &[3]), 60);
    let effects = link.hears(wheels, 110);
    let scans = effects.iter().filter_map(|effect| match effect {
        Effect::Tick { ranges, scans, .. } => Some((ranges[0].range_m, scans.clone())),
        _ => None,
    });
    let [(2.0, scans)] = &Vec::from_iter(scans)[..] else {
        panic!("{effects:?}");
    };
    assert_eq!((scans[0].beams[0], scans[0].sweep.first_beam_ns), (2.0, -60_000_000));
    let refused = link.at(Event::Sensor(0, &[0]), 120);
    assert!(refused.contains(&Effect::Refused("no scan".into())));
    // The laser falls silent.
    let mut again = (3..30).flat_map(|tick| link.hears(wheels, 50 * tick));
    assert!(again.any(|effect| matches!(effect, Effect::SendSensor(..))));
}
