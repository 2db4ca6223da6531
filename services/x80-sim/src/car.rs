//! Car between motor board and ground: one channel drives, another steers.

use common::{
    kinematics::{Ackermann, Twist},
    mission::{Mission, Steering, WheelPhysics},
};

use crate::{
    body::Body,
    drivetrain::{OnChannel, grip, slipped},
    motor::Motor,
    noise::Noise,
    wheel_errors::WheelErrors,
    world::World,
};

#[derive(Clone, Copy, Debug)]
pub(crate) struct Car {
    drive: Ackermann,
    steering: Steering,
    driven: OnChannel,
    steered: OnChannel,
    wheel_radius_m: f64,
    counts_per_radian: f64,
}

impl Car {
    /// Applies the `errors` of a left wheel and a track to driven wheel and wheelbase; none for
    /// other robots.
    pub(crate) fn new(mission: &Mission, errors: &WheelErrors) -> Option<Self> {
        let body = mission.body();
        let steering = body.steering?;
        let [driven, steered] = OnChannel::left_and_right(&mission.robot);
        let wheel_radius_m = body.wheel_radius_m * errors.diameter[0];
        Some(Self {
            drive: Ackermann::new(
                wheel_radius_m,
                steering.wheelbase_m * errors.track,
                steering.limit_rad,
                f64::INFINITY,
                0.0,
            ),
            steering,
            driven,
            steered,
            wheel_radius_m,
            counts_per_radian: body.counts_per_turn / std::f64::consts::TAU,
        })
    }

    pub(crate) const fn steers_by(&self, channel: usize) -> bool {
        self.steered.channel == channel
    }

    /// In counts per second.
    pub(crate) fn top_steering_counts(&self) -> f64 {
        self.steering.counts(self.steering.rate_rad_s)
    }

    fn angle(&self, motors: &[Motor; 6]) -> f64 {
        self.steering.angle(self.steered.turned(motors))
    }

    pub(crate) fn twist(&self, motors: &[Motor; 6]) -> Twist {
        let OnChannel { channel, sign } = self.driven;
        let wheel = sign * motors[channel].speed / self.counts_per_radian;
        self.drive.twist([wheel, self.angle(motors)])
    }

    pub(crate) fn step(
        &self,
        motors: &mut [Motor; 6],
        body: &mut Body,
        world: &World,
        physics: &WheelPhysics,
        (now, dt): (f64, f64),
        noise: &mut Noise,
    ) {
        let OnChannel { channel, sign } = self.driven;
        let asked = motors[channel].step(now, dt, noise);
        self.steer(&mut motors[self.steered.channel], now, dt, noise);
        let rim = sign * asked / self.counts_per_radian * self.wheel_radius_m;
        let ground = slipped(rim, physics, noise);
        // (3) is linear in the wheel: its angle gives arc and turn as its speed gives v and omega.
        let step = self.drive.twist([ground / self.wheel_radius_m, self.angle(motors)]);
        let held_at = body.go(step, world);
        let grip = grip(held_at.is_some(), physics);
        let went = held_at.unwrap_or(ground) / self.wheel_radius_m * self.counts_per_radian * sign;
        let motor = &mut motors[channel];
        let share = grip.unwrap_or(0.0);
        motor.turned += went * share + asked * (1.0 - share);
        if let Some(grip) = grip {
            motor.hold(went / dt, grip);
        }
    }

    fn steer(&self, motor: &mut Motor, now: f64, dt: f64, noise: &mut Noise) {
        let limit = self.steering.counts(self.steering.limit_rad);
        let asked = motor.step(now, dt, noise);
        let stopped = (motor.turned + asked).clamp(-limit, limit);
        motor.turned += stopped - motor.turned;
    }
}

#[cfg(test)]
mod tests {
    use common::{
        ground_truth::GroundTruthTick,
        wire::{Addressing, Command, Decoder, counts_between},
    };

    use crate::{
        robot::Robot,
        testing::{ideal, near},
    };

    fn car(extra: &str) -> Robot {
        Robot::new(&ideal(&format!("robot.model = 'car'\n{extra}")))
    }

    /// Drives `ticks` at these counts/s: the wheel forward, the steering left.
    fn drive(robot: &mut Robot, wheel: i16, steering: i16, ticks: u32) -> GroundTruthTick {
        let mut bytes = Vec::new();
        Command::velocity([Some(-wheel), Some(steering)], None)
            .encode(Addressing::default(), &mut bytes);
        let mut decoder = Decoder::default();
        decoder.push(&bytes);
        robot.on_frame(&decoder.next_frame().unwrap(), &mut Vec::new());
        for _ in 0..ticks {
            robot.advance_to_next_tick();
        }
        robot.ground_truth()
    }

    fn steering_counts(truth: &GroundTruthTick) -> i32 {
        counts_between(0, truth.right_counts)
    }

    #[test]
    fn the_steering_takes_its_time_ends_at_its_stop_and_turns_no_standing_car() {
        let mut robot = car("simulation.wheels.lag_s = 0");
        // 120 degrees/s are 1200 counts/s, the limit of any request; 30 degrees are 300 counts.
        for (steering, ticks, counts) in [(5000, 1, 171), (5000, 14, 300), (-5000, 14, -300)] {
            let truth = drive(&mut robot, 0, steering, ticks);
            assert!((steering_counts(&truth) - counts).abs() <= 1, "{truth:?}");
            assert_eq!((truth.x, truth.y, truth.heading), (0.0, 0.0, 0.0));
        }
    }

    #[test]
    fn at_the_stop_it_drives_its_tightest_circle() {
        let mut robot = car("");
        let start = drive(&mut robot, 0, 5000, 14);
        let end = drive(&mut robot, 600, 0, 14);
        let counts = f64::from(counts_between(start.left_counts, end.left_counts));
        let arc = counts * std::f64::consts::TAU * 0.04 / 600.0;
        let radius = 0.18 / 30_f64.to_radians().tan();
        near(end.heading, arc / radius, 0.01);
        near(end.omega, end.v / radius, 1e-9);
    }

    #[test]
    fn a_longer_wheelbase_turns_less_and_a_wall_holds_the_car() {
        let heading = |extra: &str| {
            let mut robot = car(extra);
            drive(&mut robot, 0, 1000, 7);
            drive(&mut robot, 300, 0, 7).heading
        };
        let ratio = heading("") / heading("simulation.wheels.track_scale = 1.1");
        near(ratio, 1.1, 1e-9);
        let mut robot = car("world.wall = [{ points = [[1, -2], [1, 2]] }]");
        let truth = drive(&mut robot, 1200, 0, 28);
        near(truth.x, 0.76, 1e-6);
        assert_eq!(truth.contacts, 1);
    }
}
