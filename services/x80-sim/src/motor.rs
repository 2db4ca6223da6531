//! Motor-board channel and its wheel's speed loop, in encoder counts and counts/s, positive in the
//! channel's direction.

use std::collections::VecDeque;

use common::{
    mission::WheelPhysics,
    wire::{COUNT_CYCLE, Mode, Parameter, Quantity},
};

use crate::noise::Noise;

/// Pulse width at which a wheel stands.
const PWM_STOP: f64 = 16_383.5;
/// Dead band around [`PWM_STOP`], which clients that drive by PWM compensate.
const PWM_DEAD_BAND: f64 = 8000.0;
/// Gain in 1/s: a position is reached in about a second.
const POSITION_GAIN: f64 = 4.0;
/// Position tolerance, counts.
const POSITION_REACHED: f64 = 0.5;
/// Speed below which friction stops a wheel with target 0, m/s, unless the starting dead band is
/// wider. A robot seen at rest thus stands: what follows does not depend on how long it is watched.
const STANDSTILL_M_S: f64 = 0.002;
/// Share of the stall torque at which a tyre slips: half the weight of 34 N times friction 0.6,
/// over 26 N of a stalled motor at the rim.
const SLIPS_AT: f64 = 0.4;
/// Maximum delayed target changes: more than the longest delay needs at one per 5 ms. Faster hosts
/// overwrite the newest.
const MOST_PENDING: usize = 1024;

pub struct Motor {
    physics: WheelPhysics,
    top_speed: f64,
    acceleration: f64,
    standstill: f64,
    pub enabled: bool,
    order: Option<Order>,
    /// With their times, before the delay.
    pending: VecDeque<(f64, f64)>,
    target: f64,
    pub speed: f64,
    pub turned: f64,
    /// Share of stall torque exerted against resistance to wheel or body.
    pub load: f64,
}

#[derive(Clone, Copy)]
struct Order {
    quantity: Quantity,
    value: i16,
    until: Option<f64>,
}

impl Motor {
    /// Starts suspended.
    ///
    /// `top_speed` is in counts per second.
    pub fn new(physics: WheelPhysics, top_speed: f64, counts_per_m: f64) -> Self {
        assert!(top_speed >= 0.0 && counts_per_m > 0.0);
        Self {
            physics,
            top_speed,
            acceleration: physics.acceleration_m_s2 * counts_per_m,
            standstill: STANDSTILL_M_S * counts_per_m,
            enabled: false,
            order: None,
            pending: VecDeque::new(),
            target: 0.0,
            speed: 0.0,
            turned: 0.0,
            load: 0.0,
        }
    }

    /// Sets the mode and runs until mission time `until`.
    pub fn order(&mut self, quantity: Quantity, value: i16, until: Option<f64>) {
        self.enabled = true;
        self.order = Some(Order { quantity, value, until });
    }

    /// Suspending discards the order.
    pub fn enable(&mut self, on: bool) {
        self.enabled = on;
        if !on {
            self.order = None;
        }
    }

    pub fn halt(&mut self) {
        self.order = None;
    }

    /// A mode other than the order's discards the order. Gains and feedback have no effect: the
    /// loop follows measurements.
    pub fn configure(&mut self, parameter: Parameter) {
        if let Parameter::Mode(mode) = parameter {
            self.order.take_if(|order| {
                let its = match order.quantity {
                    Quantity::Position => Mode::Position,
                    Quantity::Pwm => Mode::Pwm,
                    Quantity::Velocity => Mode::Velocity,
                };
                its != mode
            });
        }
    }

    /// Returns the mission time that no step may cross.
    pub fn ends_at(&self) -> Option<f64> {
        self.order.and_then(|order| order.until)
    }

    /// Steps `dt` seconds. Returns the counts that the loop asks of the wheel.
    pub fn step(&mut self, now: f64, dt: f64, noise: &mut Noise) -> f64 {
        self.load = 0.0;
        if self.ends_at().is_some_and(|end| now >= end) {
            // A position's time limit is its duration; the wheel continues to its last count.
            self.order = self
                .order
                .filter(|order| order.quantity == Quantity::Position)
                .map(|order| Order { until: None, ..order });
        }
        let wanted = self.wanted(now);
        if self.pending.back().map_or(self.target, |last| last.1) != wanted {
            if self.pending.len() >= MOST_PENDING {
                self.pending.pop_back();
            }
            self.pending.push_back((now, wanted));
            assert!(self.pending.len() <= MOST_PENDING);
        }
        while let Some(&(since, target)) = self.pending.front() {
            if since + self.physics.delay_s > now + dt / 2.0 {
                break;
            }
            self.target = target;
            self.pending.pop_front();
        }
        let decay = if self.physics.lag_s > 0.0 { (-dt / self.physics.lag_s).exp() } else { 0.0 };
        assert!((0.0..=1.0).contains(&decay));
        // An exponential approach covers its integral, not its final speed times dt.
        let behind = self.speed - self.target;
        let (before, most) = (self.speed, self.acceleration * dt);
        let mut counts = self.target * dt + behind * self.physics.lag_s * (1.0 - decay);
        self.speed = self.target + behind * decay;
        if (self.speed - before).abs() > most {
            self.speed = before + most.copysign(self.speed - before);
            counts = (before + self.speed) / 2.0 * dt;
        }
        let mut jitter = 0.0;
        if self.target != 0.0 {
            let sd = self.physics.noise_counts * (1.0 - decay * decay).sqrt();
            jitter = noise.normal(sd);
            self.speed += jitter;
        } else if self.speed.abs() < self.standstill.max(self.physics.dead_band_counts) {
            self.speed = 0.0;
        }
        counts + jitter * dt
    }

    /// Limits the wheel to the ground's `speed`, counts per second.
    ///
    /// The wheel loses the share `grip` of its own speed, 0 for free slip. A push adds no speed.
    /// The loop raises the torque until the wheel stalls or slips.
    pub fn hold(&mut self, speed: f64, grip: f64) {
        assert!((0.0..=1.0).contains(&grip));
        let held = speed.clamp(self.speed.min(0.0), self.speed.max(0.0));
        if self.target != 0.0 {
            let lost = (1.0 - held / self.target).clamp(0.0, 1.0);
            self.load = lost * (grip + (1.0 - grip) * SLIPS_AT);
        }
        self.speed = held * grip + self.speed * (1.0 - grip);
    }

    fn wanted(&self, now: f64) -> f64 {
        let Some(order) = self.order.filter(|_| self.enabled) else {
            return 0.0;
        };
        let value = f64::from(order.value);
        let asked = match order.quantity {
            Quantity::Velocity => value * self.physics.gain,
            Quantity::Pwm => {
                const { assert!(PWM_DEAD_BAND < PWM_STOP) };
                let duty = value - PWM_STOP;
                let beyond = (duty.abs() - PWM_DEAD_BAND).max(0.0);
                (beyond / (PWM_STOP - PWM_DEAD_BAND) * self.top_speed).copysign(duty)
            }
            Quantity::Position => {
                let cycle = f64::from(COUNT_CYCLE);
                let way = (value - self.turned).rem_euclid(cycle);
                let way = if way > cycle / 2.0 { way - cycle } else { way };
                let left = order.until.map_or(0.0, |end| end - now);
                let asked = way / left.max(1.0 / POSITION_GAIN);
                // The loop pushes until the wheel arrives, so no dead band applies.
                let least = self.physics.dead_band_counts;
                let there = way.abs() < POSITION_REACHED;
                if there { 0.0 } else { asked.abs().max(least).copysign(way) }
            }
        };
        if asked.abs() < self.physics.dead_band_counts {
            return 0.0;
        }
        asked.clamp(-self.top_speed, self.top_speed)
    }
}

#[cfg(test)]
mod tests;
