//! Commands in encoder counts. Speeds grow within the body's limits, and fall at once, so that the
//! robot stops as fast as it can.

use common::{
    mission::{Body, Mission, Protocol},
    samples::{CommandSample, WheelSample},
    wire::counts_between,
};

/// Share of the remaining steering angle per tick. It is below 1, because the speed loop's delay
/// would cause oscillation.
const STEERING_GAIN: f64 = 0.6;

#[derive(Clone, Debug)]
pub(crate) struct WheelSpeeds {
    body: Body,
    rate_hz: f64,
    keeps_curve: bool,
    /// Newest command, counts/s.
    told: [i16; 2],
}

impl WheelSpeeds {
    pub(crate) fn new(mission: &Mission) -> Self {
        Self {
            body: mission.body(),
            rate_hz: mission.robot.rate_hz,
            // An X80 answers so soon that it compensates for lost turn. Its results are those of
            // wheels limited one by one.
            keeps_curve: mission.robot.protocol() != Protocol::X80,
            told: [0; 2],
        }
    }

    pub(crate) const fn told(&mut self, counts: [i16; 2]) {
        self.told = counts;
    }

    /// Returns speeds of both wheels, or of a car's wheel and steering, for `share` of a command,
    /// counts/s.
    ///
    /// Too fast wheels slow down together, to keep the curve. Steering has a speed loop like a
    /// wheel's, so a timed command ends its motion too.
    pub(crate) fn of(&self, command: &CommandSample, share: f64, wheels: &WheelSample) -> [i16; 2] {
        let Some(steering) = self.body.steering else {
            let wanted = [command.left_rad_s, command.right_rad_s].map(|speed| share * speed);
            let fastest = wanted.map(f64::abs).into_iter().fold(self.body.top_rad_s(), f64::max);
            assert!(fastest > 0.0);
            let slower = if self.keeps_curve { self.body.top_rad_s() / fastest } else { 1.0 };
            let wanted = wanted.map(|speed| slower * speed);
            let told = self.told.map(|it| f64::from(it) / self.counts_per_radian());
            let reached = self.body.reached(told, wanted, self.rate_hz);
            return reached.map(|speed| self.counts_per_second(speed));
        };
        let driven = self.counts_per_second(share * command.left_rad_s);
        let angle = command.right_rad_s.clamp(-steering.limit_rad, steering.limit_rad);
        let left = steering.counts(angle) - f64::from(counts_between(0, wheels.right_counts));
        let top = steering.counts(steering.rate_rad_s);
        let rate = (left * STEERING_GAIN * self.rate_hz).clamp(-top, top);
        [driven, whole(rate)]
    }

    fn counts_per_radian(&self) -> f64 {
        self.body.counts_per_turn / std::f64::consts::TAU
    }

    /// Converts rad/s, limited to the top speed; NaN gives 0.
    fn counts_per_second(&self, speed: f64) -> i16 {
        let top = self.body.top_speed_m_s / self.body.metres_per_count();
        whole((speed * self.counts_per_radian()).clamp(-top, top))
    }
}

/// Rounds to counts; NaN gives 0.
fn whole(counts: f64) -> i16 {
    counts.round() as i16
}

#[cfg(test)]
mod tests {
    use common::{kinematics::Twist, wire::COUNT_CYCLE};

    use super::*;
    use crate::testing::*;

    #[test]
    fn a_cars_steering_is_driven_towards_its_angle_within_its_limits_and_a_slowed_car_keeps_its_curve()
     {
        // At 7 Hz with 3600 counts per turn, 5 degrees are 50 counts; a tick turns 0.6 of the
        // remaining angle. The rate limit is 1200 counts/s; 30 degrees are 300 counts.
        let speeds = WheelSpeeds::new(&mission("robot.model = 'car'"));
        let five = 5_f64.to_radians();
        let tau = std::f64::consts::TAU;
        for (left_rad_s, angle, share, right_counts, expected) in [
            (0.0, five, 1.0, 50, [0, 0]),
            (0.0, -five, 1.0, COUNT_CYCLE - 25, [0, -105]),
            (0.0, 1.5, 1.0, 0, [0, 1200]),
            (0.0, 1.5, 1.0, 300, [0, 0]),
            (f64::NAN, f64::NAN, 1.0, 7, [0, 0]),
            (tau, five, 1.0, 0, [600, 210]),
            (tau, five, 0.5, 0, [300, 210]),
        ] {
            let wheels = WheelSample { right_counts, ..WheelSample::default() };
            let told = speeds.of(&turning(left_rad_s, angle), share, &wheels);
            assert_eq!(told, expected, "{angle} {right_counts}");
        }
    }

    #[test]
    fn wheels_that_would_be_too_fast_keep_the_curve_of_a_robot_of_another_protocol() {
        for (protocol, ratio) in [("json", 0.8), ("x80", 1.0)] {
            let speeds = WheelSpeeds::new(&mission(&format!("robot.protocol = '{protocol}'")));
            let top = speeds.body.top_rad_s();
            let told = speeds.of(&turning(0.8 * top, top), 1.25, &WheelSample::default());
            let [left, right] = told.map(f64::from);
            near(left / right, ratio, 0.01);
            let no_number = speeds.of(&turning(f64::NAN, 0.0), 1.0, &WheelSample::default());
            assert_eq!(no_number, [0; 2], "{protocol}");
        }
    }

    #[test]
    fn a_kobuki_gains_no_more_speed_in_a_tick_than_it_can_on_the_curve_that_is_wanted_and_loses_it_at_once()
     {
        let mut speeds = WheelSpeeds::new(&mission("robot.model = 'kobuki'\nrobot.rate_hz = 10"));
        let drive = speeds.body.drive();
        let (r, w) = (speeds.body.wheel_radius_m, speeds.body.track_m);
        // 1 m/s^2 and 2 rad/s^2 are 0.1 m/s and 0.2 rad/s per tick.
        for (v, omega, reached_v, reached_omega) in [
            (0.5, 0.0, 0.1, 0.0),
            (0.5, 0.1, 0.2, 0.1),
            // The curve of 0.5 m/s and 1 rad/s, at the turn rate reached.
            (0.5, 1.0, 0.15, 0.3),
            (0.5, -1.0, 0.1, -0.2),
            (0.1, 0.0, 0.1, 0.0),
            (0.0, 1.0, 0.0, 0.2),
            (0.0, 0.0, 0.0, 0.0),
            (f64::NAN, 0.0, 0.0, 0.0),
        ] {
            let [left, right] = drive.inputs(Twist { v, omega });
            let counts = speeds.of(&turning(left, right), 1.0, &WheelSample::default());
            speeds.told(counts);
            let [left, right] = counts.map(|count| f64::from(count) / speeds.counts_per_radian());
            let is = [(right + left) * r / 2.0, (right - left) * r / w];
            near(is[0], reached_v, 1e-3);
            near(is[1], reached_omega, 5e-3);
            let stands = [reached_v, reached_omega] == [0.0; 2];
            assert!(!stands || counts == [0, 0], "{v} {omega}: {counts:?}");
        }
    }
}
