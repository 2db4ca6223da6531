//! Batteries, infrared and the other sensors of the robot's frames, in the units of the topics.

use common::{
    samples::{InfraredSample, PowerSample, SurroundingsSample},
    wire::{
        CustomSensors, LOGIC_SCALE_V, MOTOR_SCALE_V, MotorSensors, StandardSensors, board_celsius,
        driver_celsius, infrared_m, volts,
    },
};

/// The parts of earlier frames that the next sample needs.
#[derive(Clone, Debug, Default)]
pub struct Telemetry {
    currents: [u16; 6],
    /// The first infrared ranger comes in the standard frame, the other six in the custom one.
    first_infrared: Option<u16>,
}

impl Telemetry {
    /// Take a motor frame: its currents go into the next [`PowerSample`].
    pub const fn take_motor(&mut self, motor: &MotorSensors) {
        self.currents = motor.currents;
    }

    /// Take a standard frame; `low` says which of the boards', the motors' and the servos' battery is low.
    pub fn take_standard(
        &mut self,
        standard: &StandardSensors,
        low: [bool; 3],
    ) -> (PowerSample, SurroundingsSample) {
        self.first_infrared = Some(standard.infrared);
        let [board_low, motor_low, servo_low] = low.map(u8::from);
        let power = PowerSample {
            board_v: volts(standard.board_battery, LOGIC_SCALE_V),
            motor_v: volts(standard.motor_battery, MOTOR_SCALE_V),
            servo_v: volts(standard.servo_battery, LOGIC_SCALE_V),
            driver_c: standard.overheat.map(driver_celsius),
            current_ad: self.currents,
            board_low,
            motor_low,
            servo_low,
            ..PowerSample::default()
        };
        let [alarm_1, motion_1, alarm_2, motion_2] = standard.human;
        let surroundings = SurroundingsSample {
            temperature_c: board_celsius(standard.temperature),
            human_alarm_ad: [alarm_1, alarm_2],
            human_motion_ad: [motion_1, motion_2],
            tilt_ad: standard.tilt,
            ..SurroundingsSample::default()
        };
        (power, surroundings)
    }

    /// Take a custom frame. There is no sample before a standard frame has brought the first ranger.
    pub fn take_custom(&self, custom: &CustomSensors) -> Option<InfraredSample> {
        let [_, _, second, third, fourth, fifth, sixth, seventh] = custom.ad;
        let first = self.first_infrared?;
        let raw_ad = [first, second, third, fourth, fifth, sixth, seventh];
        Some(InfraredSample {
            range_m: raw_ad.map(infrared_m),
            raw_ad,
            ..InfraredSample::default()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_standard_frame_by_hand() {
        let mut telemetry = Telemetry::default();
        telemetry.take_motor(&MotorSensors {
            currents: [1, 2, 3, 4, 5, 6],
            ..MotorSensors::default()
        });
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
        let low = [false, true, false];
        let (power, surroundings) = telemetry.take_standard(&standard, low);
        assert_eq!(
            (power.board_low, power.motor_low, power.servo_low),
            (0, 1, 0)
        );
        assert!((power.board_v - 7.2).abs() < 1e-9);
        assert!((power.motor_v - 12.003).abs() < 1e-3);
        assert_eq!(power.driver_c, [60.0, 100.0]);
        assert_eq!(power.current_ad, [1, 2, 3, 4, 5, 6]);
        assert!((surroundings.temperature_c - 20.0).abs() < 1e-9);
        assert_eq!(surroundings.human_alarm_ad, [10, 30]);
        assert_eq!(surroundings.human_motion_ad, [20, 40]);
        assert_eq!(surroundings.tilt_ad, [50, 60]);
    }

    #[test]
    fn the_seven_infrared_rangers_come_from_two_frames() {
        let mut telemetry = Telemetry::default();
        let custom = CustomSensors {
            ad: [9, 9, 1000, 0, 4095, 0, 0, 0],
            io: 0,
        };
        assert_eq!(telemetry.take_custom(&custom), None, "one is missing");
        telemetry.take_standard(
            &StandardSensors {
                infrared: 1000,
                ..StandardSensors::default()
            },
            [false; 3],
        );
        let infrared = telemetry.take_custom(&custom).unwrap();
        assert_eq!(infrared.raw_ad, [1000, 1000, 0, 4095, 0, 0, 0]);
        assert_eq!(infrared.range_m[2..4], [0.81, 0.09]);
        assert!((infrared.range_m[0] - 0.375_79).abs() < 1e-5);
    }
}
