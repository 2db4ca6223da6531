//! Sensors that no tick needs, in the units of the topics.

use common::{
    samples::{PowerSample, SurroundingsSample},
    wire::{LOGIC_SCALE_V, MOTOR_SCALE_V, StandardSensors, board_celsius, driver_celsius, volts},
};

pub(crate) fn power(standard: &StandardSensors, current_ad: [u16; 6]) -> PowerSample {
    PowerSample {
        board_v: volts(standard.board_battery, LOGIC_SCALE_V),
        motor_v: volts(standard.motor_battery, MOTOR_SCALE_V),
        servo_v: volts(standard.servo_battery, LOGIC_SCALE_V),
        driver_c: standard.overheat.map(driver_celsius),
        current_ad,
        ..PowerSample::default()
    }
}

pub(crate) fn surroundings(standard: &StandardSensors) -> SurroundingsSample {
    let [alarm_1, motion_1, alarm_2, motion_2] = standard.human;
    SurroundingsSample {
        temperature_c: board_celsius(standard.temperature),
        human_alarm_ad: [alarm_1, alarm_2],
        human_motion_ad: [motion_1, motion_2],
        tilt_ad: standard.tilt,
        ..SurroundingsSample::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_standard_frame_by_hand() {
        let standard = StandardSensors {
            human: [10, 20, 30, 40],
            tilt: [50, 60],
            // 100 - (1444 - 980) / 11.6 = 60; (1952 - 1256) / 34.8 = 20.
            overheat: [1444, 980],
            temperature: 1952,
            board_battery: 3276,
            motor_battery: 2048,
            ..StandardSensors::default()
        };
        let (power, surroundings) = (power(&standard, [1, 2, 3, 4, 5, 6]), surroundings(&standard));
        assert!((power.board_v - 7.2).abs() < 1e-9);
        assert!((power.motor_v - 12.003).abs() < 1e-3);
        assert_eq!((power.driver_c, power.current_ad), ([60.0, 100.0], [1, 2, 3, 4, 5, 6]));
        assert!((surroundings.temperature_c - 20.0).abs() < 1e-9);
        let SurroundingsSample { human_alarm_ad, human_motion_ad, tilt_ad, .. } = surroundings;
        assert_eq!([human_alarm_ad, human_motion_ad, tilt_ad], [[10, 30], [20, 40], [50, 60]]);
    }
}
