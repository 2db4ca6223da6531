//! Shared code of drivers for robots with a gyro.

use std::f64::consts::PI;

use crate::{driver::Turn, mission::Body};

/// Least noise of a turn, rad per square root of a second. Nominal: several times that of robot
/// gyros, such as the BMI160's 0.007 degrees.
pub const NOISE: f64 = 5e-4;
/// Turn after which gyro and odometry are compared. Within [`COMPARED_NS`] no bias reaches it. Both
/// must agree within the factor [`AGREES_WITHIN`], which exceeds wheel slip in turns.
const COMPARED_RAD: f64 = 0.2;
const COMPARED_NS: i64 = 10_000_000_000;
const AGREES_WITHIN: f64 = 2.0;

/// Sequence of turns per tick. A turn after a gap only marks where the next one begins.
#[derive(Clone, Copy, Debug, Default)]
pub struct Turns<T> {
    /// End of the newest turn; `None` after a gap.
    told: Option<T>,
    sequence: u64,
}

impl<T: Copy> Turns<T> {
    pub fn interrupt(&mut self) {
        self.told = None;
    }

    /// Returns the number of the turn that ends at `now`, and its start; without `now`, `None` and
    /// a gap.
    pub fn until(&mut self, now: Option<T>) -> Option<(u64, T)> {
        let before = std::mem::replace(&mut self.told, now);
        let now = now?;
        self.sequence += if before.is_some() { 1 } else { 2 };
        Some((self.sequence, before.unwrap_or(now)))
    }
}

/// Comparison of gyro and odometry. The gyro is used only once both agreed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Compared {
    since_ns: i64,
    /// Turns since then by odometry and by the gyro, radians.
    turned: [f64; 2],
    pub agrees: bool,
}

impl Compared {
    /// Adds the turns by odometry and gyro up to `now_ns`, radians. Returns a description if a
    /// comparison fails.
    pub fn take(&mut self, now_ns: i64, turns: [f64; 2]) -> Option<String> {
        if !(0..COMPARED_NS).contains(&(now_ns - self.since_ns)) {
            self.since_ns = now_ns;
            self.turned = [0.0; 2];
        }
        self.turned = [0, 1].map(|of| self.turned[of] + turns[of]);
        let [odometry, gyro] = self.turned;
        // Dead reckoning compares both, too, and doubts its pose. It must see a contradiction before
        // the gyro is ignored.
        let least_rad = if self.agrees { 2.0 * COMPARED_RAD } else { COMPARED_RAD };
        if odometry.abs() < least_rad {
            return None;
        }
        self.since_ns = now_ns;
        self.turned = [0.0; 2];
        self.agrees = (1.0 / AGREES_WITHIN..=AGREES_WITHIN).contains(&(gyro / odometry));
        (!self.agrees).then(|| {
            format!("a turn of {gyro:.2} rad contradicts odometry's {odometry:.2} rad, so the gyro is ignored")
        })
    }
}

/// Relative scale error of a cheap gyro, such as the MPU-6050.
const SCALE: f64 = 0.01;

#[derive(Clone, Debug, Default)]
pub struct Angle {
    newest: Option<(f64, [f64; 2])>,
    turns: Turns<f64>,
    now_ns: f64,
    compared: Compared,
}

impl Angle {
    /// Takes a report of the gyro angle, if any, and of the wheel angles. Returns a new fault of
    /// the gyro.
    pub fn take(
        &mut self,
        angle: Option<f64>,
        wheels: [f64; 2],
        body: &Body,
        period_ns: f64,
    ) -> Option<String> {
        self.now_ns += period_ns;
        let newest = angle.map(|angle| (angle, wheels));
        let before = std::mem::replace(&mut self.newest, newest);
        let ((angle, [left, right]), (angle_before, [left_before, right_before])) =
            newest.zip(before)?;
        let turned = angle - angle_before;
        if turned.abs() > PI {
            // The angle was reset.
            self.turns.interrupt();
            return None;
        }
        let rolled = (right - right_before) - (left - left_before);
        let by_wheels = rolled * body.wheel_radius_m / body.track_m;
        let why = self.compared.take(self.now_ns as i64, [by_wheels, turned])?;
        Some(format!("gyro: {why}; send its angle counter-clockwise, in the unit of the protocol"))
    }

    /// After a gap it only marks where the next one begins.
    pub fn for_tick(&mut self, rate_hz: f64) -> Option<Turn> {
        let now = self.newest.filter(|_| self.compared.agrees).map(|(angle, _)| angle);
        let (sequence, before) = self.turns.until(now)?;
        let turn_rad = now? - before;
        let variance_rad2 = NOISE * NOISE / rate_hz + (SCALE * turn_rad).powi(2);
        Some(Turn { sequence, turn_rad, variance_rad2 })
    }
}
