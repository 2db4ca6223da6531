//! Channel, direction and true diameter of each wheel.

use common::{
    mission::{Mission, RobotConfig, WheelPhysics},
    wire::{COUNT_CYCLE, Command, Encoder},
};

use crate::{motor::Motor, noise::Noise};

pub fn slipped(metres: f64, physics: &WheelPhysics, noise: &mut Noise) -> f64 {
    let lost = noise.normal(physics.slip_noise * metres.abs().sqrt());
    metres * (1.0 - physics.slip_share) + lost
}

/// Returns the share by which a `held` body's wheels follow the ground; the rest slips. Free wheels
/// turn as asked.
pub fn grip(held: bool, physics: &WheelPhysics) -> Option<f64> {
    held.then_some(1.0 - physics.contact_slip)
}

/// Channel of a wheel or a car's steering, and its counts' sign for driving ahead or steering left.
#[derive(Clone, Copy)]
pub struct OnChannel {
    pub channel: usize,
    pub sign: f64,
}

impl OnChannel {
    pub fn left_and_right(robot: &RobotConfig) -> [Self; 2] {
        [robot.left, robot.right].map(|wheel| Self {
            // The mission check limits channels to 0 and 1.
            channel: usize::from(wheel.channel.min(1)),
            sign: if wheel.reversed { -1.0 } else { 1.0 },
        })
    }

    pub fn turned(self, motors: &[Motor; 6]) -> f64 {
        self.sign * motors[self.channel].turned
    }
}

/// Takes counts/s.
pub fn velocity(wheels: [OnChannel; 2], counts: [f64; 2], limit_ms: u16) -> Command {
    let mut channels = [None; 2];
    for (OnChannel { channel, sign }, counts) in wheels.into_iter().zip(counts) {
        // -32768 and -32767 leave a channel unchanged.
        channels[channel] = Some((sign * counts).round().clamp(-32_766.0, 32_766.0) as i16);
    }
    Command::velocity(channels, limit_ms)
}

/// Left first.
#[derive(Clone, Copy)]
pub struct Drivetrain {
    on: [OnChannel; 2],
    metres_per_count: f64,
    diameter: [f64; 2],
}

impl Drivetrain {
    pub fn new(mission: &Mission, diameter: [f64; 2]) -> Self {
        let on = OnChannel::left_and_right(&mission.robot);
        assert_ne!(on[0].channel, on[1].channel);
        Self { on, metres_per_count: mission.body().metres_per_count(), diameter }
    }

    pub fn step(&self, motors: &mut [Motor; 6], now: f64, dt: f64, noise: &mut Noise) -> [f64; 2] {
        self.on.map(|OnChannel { channel, sign }| {
            sign * motors[channel].step(now, dt, noise) * self.metres_per_count
        })
    }

    pub fn rims(&self, metres: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|wheel| metres[wheel] * self.diameter[wheel])
    }

    /// Turns the wheels. A held wheel follows the ground's `went` metres by the share `grip`, and
    /// `asked` by the rest.
    pub fn turn(
        &self,
        motors: &mut [Motor; 6],
        asked: [f64; 2],
        went: [f64; 2],
        grip: [Option<f64>; 2],
        dt: f64,
    ) {
        for (wheel, on) in self.on.into_iter().enumerate() {
            let counts = |metres: f64| on.sign * metres / self.metres_per_count;
            let went = went[wheel] / self.diameter[wheel];
            let share = grip[wheel].unwrap_or(0.0);
            let motor = &mut motors[on.channel];
            motor.turned += counts(went * share + asked[wheel] * (1.0 - share));
            if let Some(grip) = grip[wheel] {
                motor.hold(counts(went) / dt, grip);
            }
        }
    }

    /// In m/s, forward positive.
    pub fn rim_speeds(&self, motors: &[Motor; 6]) -> [f64; 2] {
        self.rims(self.on.map(|OnChannel { channel, sign }| {
            sign * motors[channel].speed * self.metres_per_count
        }))
    }

    /// Counts grow forward.
    pub fn counts(&self, encoders: &[Encoder; 2]) -> [u16; 2] {
        self.on.map(|OnChannel { channel, sign }| {
            let position = encoders[channel].position;
            assert!(position < COUNT_CYCLE);
            if sign < 0.0 { (COUNT_CYCLE - position) % COUNT_CYCLE } else { position }
        })
    }
}
