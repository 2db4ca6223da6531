//! The speeds of a command in counts of the encoders.

use common::{
    mission::{Body, Mission},
    samples::{CommandSample, WheelSample},
    wire::counts_between,
};

/// The share of the remaining angle that the steering turns in a tick. It is below 1 so that the delay of the speed loop does not
/// make the steering oscillate.
const STEERING_GAIN: f64 = 0.6;

/// Converts the speeds of commands to counts/s of one robot.
#[derive(Clone, Debug)]
pub(crate) struct WheelSpeeds {
    body: Body,
    rate_hz: f64,
}

impl WheelSpeeds {
    pub(crate) fn new(mission: &Mission) -> Self {
        Self { body: mission.body(), rate_hz: mission.robot.rate_hz }
    }

    /// The speeds of the two wheels, or of a car's wheel and steering, for `command` at `share` of its speed, counts/s; `wheels` are the
    /// newest encoder counts. A car's steering has a speed loop like a wheel's and is driven towards its angle, so its motion ends with
    /// a timed command too.
    pub(crate) fn of(&self, command: &CommandSample, share: f64, wheels: &WheelSample) -> [i16; 2] {
        let driven = self.counts_per_second(share * command.left_rad_s);
        let Some(steering) = self.body.steering else {
            return [driven, self.counts_per_second(share * command.right_rad_s)];
        };
        let angle = command.right_rad_s.clamp(-steering.limit_rad, steering.limit_rad);
        let left = steering.counts(angle) - f64::from(counts_between(0, wheels.right_counts));
        let top = steering.counts(steering.rate_rad_s);
        let rate = (left * STEERING_GAIN * self.rate_hz).clamp(-top, top);
        [driven, whole(rate)]
    }

    /// Convert rad/s to counts/s, limited to the wheel's top speed; NaN gives 0.
    fn counts_per_second(&self, speed: f64) -> i16 {
        let per_radian = self.body.counts_per_turn / std::f64::consts::TAU;
        let top = self.body.top_speed_m_s / self.body.metres_per_count();
        whole((speed * per_radian).clamp(-top, top))
    }
}

/// Round to whole counts/s; NaN gives 0.
fn whole(counts: f64) -> i16 {
    counts.round() as i16
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use common::wire::COUNT_CYCLE;

    use super::*;

    /// The speeds for a car whose steering encoder reads `counts`, at 7 Hz with 3600 counts a turn.
    fn counts(left_rad_s: f64, angle: f64, share: f64, counts: u16) -> [i16; 2] {
        let text = "target = [3, 0]\nrobot.model = 'car'";
        let speeds = WheelSpeeds::new(&Mission::parse(text, Path::new("m.toml")).unwrap());
        let command = CommandSample { left_rad_s, right_rad_s: angle, ..CommandSample::default() };
        let wheels = WheelSample { right_counts: counts, ..WheelSample::default() };
        speeds.of(&command, share, &wheels)
    }

    #[test]
    fn a_cars_steering_is_driven_towards_its_angle() {
        // 5 degrees are 50 counts; a tick turns 0.6 of the remaining angle.
        let five = 5_f64.to_radians();
        assert_eq!(counts(0.0, five, 1.0, 0), [0, 210]);
        assert_eq!(counts(0.0, five, 1.0, 50), [0, 0]);
        assert_eq!(counts(0.0, -five, 1.0, COUNT_CYCLE - 25), [0, -105]);
    }

    #[test]
    fn a_cars_steering_is_limited_in_angle_and_rate_and_no_number_holds_it() {
        // 1200 counts a second at most; 30 degrees are 300 counts.
        assert_eq!(counts(0.0, 1.5, 1.0, 0), [0, 1200]);
        assert_eq!(counts(0.0, 1.5, 1.0, 300), [0, 0]);
        assert_eq!(counts(f64::NAN, f64::NAN, 1.0, 7), [0, 0]);
    }

    #[test]
    fn a_slowed_car_keeps_its_curve() {
        let five = 5_f64.to_radians();
        let tau = std::f64::consts::TAU;
        assert_eq!(counts(tau, five, 1.0, 0), [600, 210]);
        assert_eq!(counts(tau, five, 0.5, 0), [300, 210]);
    }
}
