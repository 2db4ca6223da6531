//! Channel, direction and real diameter of each wheel.

use common::{
    mission::{Mission, WheelPhysics},
    wire::{COUNT_CYCLE, Encoder},
};

use crate::{body::Wheels, motor::Motor, noise::Noise};

/// Metres over the ground for a rim that rolls `metres` and slips.
pub(crate) fn slipped(metres: f64, physics: &WheelPhysics, noise: &mut Noise) -> f64 {
    let lost = noise.normal(physics.slip_noise * metres.abs().sqrt());
    metres * (1.0 - physics.slip_share) + lost
}

/// The share that a `held` body's wheels go with the ground: the rest slips at the contact. A wheel that nothing
/// holds turns as asked, even if it slips.
pub(crate) fn grip(held: bool, physics: &WheelPhysics) -> Option<f64> {
    held.then_some(1.0 - physics.contact_slip)
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Drivetrain {
    channel: Wheels<usize>,
    sign: Wheels<f64>,
    /// The wheel has the nominal diameter.
    metres_per_count: f64,
    diameter: Wheels<f64>,
}

impl Drivetrain {
    /// The wheels are `diameter` times the nominal one.
    pub(crate) fn new(mission: &Mission, diameter: Wheels<f64>) -> Self {
        let wheels = Wheels { left: mission.robot.left, right: mission.robot.right };
        Self {
            // The mission was checked, so channels are 0 and 1.
            channel: wheels.map(|wheel| usize::from(wheel.channel.min(1))),
            sign: wheels.map(|wheel| if wheel.reversed { -1.0 } else { 1.0 }),
            metres_per_count: mission.body().metres_per_count(),
            diameter,
        }
    }

    /// Metres of nominal wheels that the speed loops ask for from mission time `now` for `dt` seconds.
    pub(crate) fn step(
        &self,
        motors: &mut [Motor; 6],
        now: f64,
        dt: f64,
        noise: &mut Noise,
    ) -> Wheels<f64> {
        let mut asked = |channel: usize, sign: f64| {
            let counts = motors.get_mut(channel).map_or(0.0, |motor| motor.step(now, dt, noise));
            sign * counts * self.metres_per_count
        };
        Wheels {
            left: asked(self.channel.left, self.sign.left),
            right: asked(self.channel.right, self.sign.right),
        }
    }

    /// The way of the real rims when nominal wheels would roll `metres`.
    pub(crate) fn rims(&self, metres: Wheels<f64>) -> Wheels<f64> {
        Wheels { left: metres.left * self.diameter.left, right: metres.right * self.diameter.right }
    }

    /// In `dt` seconds a wheel that is held by the share `grip` with the ground, which went by `went` metres, and by
    /// the rest as it was `asked`.
    pub(crate) fn turn(
        &self,
        motors: &mut [Motor; 6],
        asked: Wheels<f64>,
        went: Wheels<f64>,
        grip: Wheels<Option<f64>>,
        dt: f64,
    ) {
        let mut turn = |channel: usize, sign: f64, asked: f64, went: f64, grip: Option<f64>| {
            let Some(motor) = motors.get_mut(channel) else {
                return;
            };
            let counts = |metres: f64| sign * metres / self.metres_per_count;
            let share = grip.unwrap_or(0.0);
            motor.turn(counts(went * share + asked * (1.0 - share)));
            if let Some(grip) = grip {
                motor.hold(counts(went) / dt, grip);
            }
        };
        let Wheels { left, right } = self.diameter;
        turn(self.channel.left, self.sign.left, asked.left, went.left / left, grip.left);
        turn(self.channel.right, self.sign.right, asked.right, went.right / right, grip.right);
    }

    /// m/s, forward positive.
    pub(crate) fn rim_speeds(&self, motors: &[Motor; 6]) -> Wheels<f64> {
        let speed =
            |channel: usize, sign: f64| sign * motors[channel].speed() * self.metres_per_count;
        self.rims(Wheels {
            left: speed(self.channel.left, self.sign.left),
            right: speed(self.channel.right, self.sign.right),
        })
    }

    /// Counts grow forward.
    pub(crate) fn counts(&self, encoders: &[Encoder; 2]) -> Wheels<u16> {
        let counts = |channel: usize, sign: f64| {
            let position = encoders[channel].position;
            if sign < 0.0 { (COUNT_CYCLE - position) % COUNT_CYCLE } else { position }
        };
        Wheels {
            left: counts(self.channel.left, self.sign.left),
            right: counts(self.channel.right, self.sign.right),
        }
    }
}
