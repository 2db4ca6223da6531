//! A car between the channels of the motor board and the ground: one channel drives it, another steers.

use common::{
    kinematics::{Ackermann, SteeredWheel, Twist},
    mission::{Channel, Mission, Steering, WheelPhysics},
};

use crate::{
    body::Body,
    drivetrain::{grip, slipped},
    motor::Motor,
    noise::Noise,
    wheel_errors::WheelErrors,
    world::World,
};

/// How a car hangs on its motors.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Car {
    /// With the true diameter and the true wheelbase.
    drive: Ackermann,
    steering: Steering,
    driven: OnChannel,
    steered: OnChannel,
    /// Of the true wheel.
    wheel_radius_m: f64,
    counts_per_radian: f64,
}

/// The motor that does something, and which way.
#[derive(Clone, Copy, Debug)]
struct OnChannel {
    channel: usize,
    sign: f64,
}

impl From<Channel> for OnChannel {
    fn from(channel: Channel) -> Self {
        Self {
            // A mission is checked: channels are 0 and 1.
            channel: usize::from(channel.channel.min(1)),
            sign: if channel.reversed { -1.0 } else { 1.0 },
        }
    }
}

impl Car {
    /// That of `mission`'s robot, with the driven wheel and the wheelbase as far off as `errors` says of a left wheel and of
    /// a track; none if the robot is no car.
    pub(crate) fn new(mission: &Mission, errors: &WheelErrors) -> Option<Self> {
        let body = mission.body();
        let steering = body.steering?;
        let wheel_radius_m = body.wheel_radius_m * errors.diameter.left;
        Some(Self {
            drive: Ackermann::new(
                wheel_radius_m,
                steering.wheelbase_m * errors.track,
                steering.limit_rad,
                f64::INFINITY,
                0.0,
            ),
            steering,
            driven: mission.robot.left.into(),
            steered: mission.robot.right.into(),
            wheel_radius_m,
            counts_per_radian: body.counts_per_turn / std::f64::consts::TAU,
        })
    }

    /// Whether the motor of `channel` steers.
    pub(crate) const fn steers_by(&self, channel: usize) -> bool {
        self.steered.channel == channel
    }

    /// The most that motor can do, counts per second.
    pub(crate) fn top_steering_counts(&self) -> f64 {
        self.steering.counts(self.steering.rate_rad_s)
    }

    /// Where the steering stands, radians.
    fn angle(&self, motors: &[Motor; 6]) -> f64 {
        let OnChannel { channel, sign } = self.steered;
        self.steering.angle(sign * motors[channel].turned())
    }

    /// How it moves by what its motors do.
    pub(crate) fn twist(&self, motors: &[Motor; 6]) -> Twist {
        let OnChannel { channel, sign } = self.driven;
        self.drive.twist(SteeredWheel {
            wheel: sign * motors[channel].speed() / self.counts_per_radian,
            steering: self.angle(motors),
        })
    }

    /// Move `body` as its motors ask from mission time `now` for `dt` seconds, and no farther than `world` lets it.
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
        let step = self.drive.twist(SteeredWheel {
            wheel: ground / self.wheel_radius_m,
            steering: self.angle(motors),
        });
        let held_at = body.go(step, world);
        let grip = grip(held_at.is_some(), physics);
        let went = held_at.unwrap_or(ground) / self.wheel_radius_m * self.counts_per_radian * sign;
        let motor = &mut motors[channel];
        motor.turn(went * grip + asked * (1.0 - grip));
        if grip > 0.0 {
            motor.hold(went / dt, grip);
        }
    }

    /// Turn the steering as its motor asks, up to the stop.
    fn steer(&self, motor: &mut Motor, now: f64, dt: f64, noise: &mut Noise) {
        let limit = self.steering.counts(self.steering.limit_rad);
        let asked = motor.step(now, dt, noise);
        let stopped = (motor.turned() + asked).clamp(-limit, limit);
        motor.turn(stopped - motor.turned());
    }
}
