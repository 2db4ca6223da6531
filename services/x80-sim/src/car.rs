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

pub struct Car {
    drive: Ackermann,
    steering: Steering,
    driven: OnChannel,
    steered: OnChannel,
    counts_per_radian: f64,
}

impl Car {
    /// Applies the `errors` of a left wheel and a track to driven wheel and wheelbase; none for
    /// other robots.
    pub fn new(mission: &Mission, errors: &WheelErrors) -> Option<Self> {
        let body = mission.body();
        let steering = body.steering?;
        let [driven, steered] = OnChannel::left_and_right(&mission.robot);
        Some(Self {
            drive: Ackermann {
                wheel_radius: body.wheel_radius_m * errors.diameter[0],
                wheelbase: steering.wheelbase_m * errors.track,
                ..body.ackermann()?
            },
            steering,
            driven,
            steered,
            counts_per_radian: body.counts_per_turn / std::f64::consts::TAU,
        })
    }

    pub const fn steers_by(&self, channel: usize) -> bool {
        self.steered.channel == channel
    }

    /// In counts per second.
    pub fn top_steering_counts(&self) -> f64 {
        self.steering.counts(self.steering.rate_rad_s)
    }

    fn angle(&self, motors: &[Motor; 6]) -> f64 {
        self.steering.angle(self.steered.turned(motors))
    }

    pub fn twist(&self, motors: &[Motor; 6]) -> Twist {
        let OnChannel { channel, sign } = self.driven;
        let wheel = sign * motors[channel].speed / self.counts_per_radian;
        self.drive.twist([wheel, self.angle(motors)])
    }

    pub fn step(
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
        let rim = sign * asked / self.counts_per_radian * self.drive.wheel_radius;
        let ground = slipped(rim, physics, noise);
        // (3) is linear in the wheel: its angle gives arc and turn as its speed gives v and omega.
        let step = self.drive.twist([ground / self.drive.wheel_radius, self.angle(motors)]);
        let held_at = body.go(step, world);
        let grip = grip(held_at.is_some(), physics);
        let went =
            held_at.unwrap_or(ground) / self.drive.wheel_radius * self.counts_per_radian * sign;
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
