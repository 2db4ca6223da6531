//! Model of wheels that follow their commands.
//!
//! Acceleration is limited per wheel, or in the wheels' mean and difference. Bases that take speed
//! and turn rate limit the latter, and their wheels differ in turns.

use common::mission::{Body, ModelledSpeed, Response};

/// Relative difference within which a turn is limited by the wheels alone.
const AS_WHEELS: f64 = 0.01;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Axle {
    pub counts_per_m: f64,
    /// None for a car, whose second channel steers.
    pub track_m: Option<f64>,
}

impl From<&Body> for Axle {
    fn from(body: &Body) -> Self {
        let track_m = body.steering.is_none().then_some(body.track_m);
        Self { counts_per_m: 1.0 / body.metres_per_count(), track_m }
    }
}

impl Axle {
    pub(super) fn limits(self, response: &Response) -> Limits {
        let most = response.acceleration_m_s2;
        let turn = self.track_m.map(|track| response.turn_acceleration_rad_s2 * track / 2.0);
        // inf / inf is NaN.
        let apart = turn.filter(|turn| (turn / most - 1.0).abs() > AS_WHEELS);
        assert!(most > 0.0 && self.counts_per_m > 0.0);
        let both = [most, apart.unwrap_or(most)];
        Limits { are_apart: apart.is_some(), most: both.map(|most| most * self.counts_per_m) }
    }

    pub(super) fn response(self, dead_time_s: f64, limits: Limits) -> Response {
        let [acceleration_m_s2, turn] = limits.most.map(|most| most / self.counts_per_m);
        let turn_acceleration_rad_s2 =
            self.track_m.map_or(f64::INFINITY, |track| 2.0 * turn / track);
        Response { delay_s: dead_time_s, lag_s: 0.0, acceleration_m_s2, turn_acceleration_rad_s2 }
    }
}

/// Acceleration limits of the left and right wheel, or of half their sum and half their difference,
/// counts/s^2.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    pub are_apart: bool,
    pub most: [f64; 2],
}

impl Limits {
    pub(super) fn axes(self, [left, right]: [f64; 2]) -> [f64; 2] {
        if self.are_apart { [(left + right) / 2.0, (right - left) / 2.0] } else { [left, right] }
    }

    pub(super) fn wheels(self, [one, other]: [f64; 2]) -> [f64; 2] {
        if self.are_apart { [one - other, one + other] } else { [one, other] }
    }
}

/// Modelled speeds and distances of both wheels, in counts.
#[derive(Clone, Debug)]
pub(crate) struct ModelledWheels {
    limits: Limits,
    axes: [ModelledSpeed; 2],
}

impl ModelledWheels {
    pub(crate) fn new(axle: Axle, delay_s: f64, response: &Response) -> Self {
        let limits = axle.limits(response);
        Self { limits, axes: limits.most.map(|most| ModelledSpeed::new(delay_s, most)) }
    }

    pub(crate) fn command(&mut self, at_s: f64, counts: [f64; 2]) {
        let [one, other] = self.limits.axes(counts);
        self.axes[0].command(at_s, one);
        self.axes[1].command(at_s, other);
    }

    pub(crate) fn go_on(&mut self, until_s: f64) -> [f64; 2] {
        self.limits.wheels(self.axes.each_mut().map(|axis| axis.go_on(until_s)))
    }

    pub(crate) fn each(&self, of: impl Fn(&ModelledSpeed) -> f64) -> [f64; 2] {
        self.limits.wheels(self.axes.each_ref().map(of))
    }

    pub(crate) fn pending(&self) -> impl Iterator<Item = (f64, [f64; 2])> {
        let both = self.axes[0].pending().zip(self.axes[1].pending());
        debug_assert_eq!(self.axes[0].pending().count(), self.axes[1].pending().count());
        both.map(|((at_s, one), (_, other))| (at_s, self.limits.wheels([one, other])))
    }
}
