//! Tests that infrared ranges, power and surroundings reach a consumer.

use std::time::Instant;

use crate::support::{self, Run, in_own_process};
use common::{bus::Bus, topics, waiter::Waiter};

#[test]
fn infrared_power_and_surroundings_reach_a_consumer_and_a_low_battery_is_told_once() {
    in_own_process(|| {
        let low = ["--pace", "4", "--set", "simulation.battery.start_v=6.4"];
        let mut run = Run::start("telemetry", "obstacle-course", &low);
        let status = run
            .wait_until("the battery is known to be low", |status| status["power"]["low"] == true);
        let volts = status["power"]["motor_v"].as_f64().unwrap();
        assert!((volts - 6.4).abs() < 0.01, "{status}");
        run.wait_until_under_way(2.0);

        let bus = Bus::join(&support::domain("telemetry"), "dashboard").unwrap();
        let mut infrareds = bus.reader(&topics::INFRARED).unwrap();
        let mut powers = bus.reader(&topics::POWER).unwrap();
        let mut surroundings = bus.reader(&topics::SURROUNDINGS).unwrap();
        let mut waiter = Waiter::default();
        waiter.on(bus.wakeup(&topics::INFRARED).unwrap());
        waiter.on(bus.wakeup(&topics::POWER).unwrap());
        waiter.on(bus.wakeup(&topics::SURROUNDINGS).unwrap());
        let began = Instant::now();
        let (mut infrared, mut power, mut around) = (None, None, None);
        let (infrared, power, around) = loop {
            assert!(began.elapsed() < support::PATIENCE, "nothing is published");
            waiter.wait(support::PATIENCE).unwrap();
            infrared = infrareds.newest().unwrap().or(infrared);
            power = powers.newest().unwrap().or(power);
            around = surroundings.newest().unwrap().or(around);
            if let (Some(infrared), Some(power), Some(around)) = (infrared, power, around) {
                break (infrared, power, around);
            }
        };
        let in_reach = |range: &f64| (0.09..=0.81).contains(range);
        assert!(infrared.range_m.iter().all(in_reach), "{infrared:?}");
        assert!(infrared.raw_ad.iter().all(|&ad| ad > 0), "{infrared:?}");
        let wheels = &power.current_ad[..2];
        assert!(wheels.iter().all(|&ad| ad > 0), "{power:?}");
        assert!((power.board_v - 6.4).abs() < 0.01, "{power:?}");
        assert_eq!(power.board_low, 1);
        assert!((around.temperature_c - 22.8).abs() < 0.1, "{around:?}");
        drop((infrareds, powers, surroundings, waiter, bus));

        for pack in ["board", "motor", "servo"] {
            let told = ["WARN", &format!("pack=\"{pack}\"")];
            let told = support::logged(&run.directory(), "link", &told);
            assert_eq!(told, 1, "{pack}");
        }
        run.stop();
    });
}
