//! Doubts that no fix settles: unequal wheels, and fixes that contradicted the pose until it moved
//! to them. They widen the published covariance only, because a wider filter's gates would accept
//! anything.

use common::samples::WheelSample;
use glam::DVec2;
use serde::{Deserialize, Serialize};

/// Least difference from 1 of a ratio that is off: in its deviations, and absolute.
///
/// Even wheels reached at most 0.89 of the greater limit in 240 missions of X80s and Kobukis, half
/// on a busy machine. An encoder that counts 4 % too little for half a mission reaches 1.05.
const DEVIATIONS: f64 = 2.5;
const LEAST_OFF: f64 = 0.018;
/// Reported position doubt, metres.
const TOLD_M: f64 = 0.1;
const WIDEST_M: f64 = 10.0;

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Doubt {
    /// Rim travel since a fix independent of these wheels, metres.
    rolled_m: f64,
    /// Largest difference of the ratio from 1.
    uneven: f64,
    is_told: bool,
    /// Squared moves and turns by relocations, m^2 and rad^2.
    relocated: [f64; 2],
}

impl Doubt {
    pub(crate) fn relocate(&mut self, way: DVec2, turn: f64) {
        let [place, heading] = &mut self.relocated;
        *place += way.length_squared();
        *heading += turn * turn;
    }

    pub(crate) const fn place_by_others(&mut self) {
        self.rolled_m = 0.0;
    }

    pub(crate) const fn place(&mut self) {
        (self.rolled_m, self.relocated) = (0.0, [0.0; 2]);
    }

    /// Takes rim travel. Returns a warning once.
    pub(crate) fn roll(
        &mut self,
        wheels: &WheelSample,
        rim_m: f64,
        track_m: f64,
    ) -> Option<String> {
        assert!(rim_m >= 0.0 || rim_m.is_nan());
        self.rolled_m += rim_m;
        let WheelSample { told_ratio, told_ratio_sd, .. } = *wheels;
        let off = (told_ratio - 1.0).abs();
        if off > LEAST_OFF.max(DEVIATIONS * told_ratio_sd) {
            self.uneven = self.uneven.max(off);
        }
        let [place, _] = self.of_wheels(track_m);
        if self.is_told || place < TOLD_M * TOLD_M {
            return None;
        }
        self.is_told = true;
        Some(format!(
            "relative to the commands, the right wheel counts {told_ratio:.2} times as much as the left, so the pose is uncertain by {:.1} m or more; check encoders and wheels",
            place.sqrt()
        ))
    }

    fn of_wheels(&self, track_m: f64) -> [f64; 2] {
        let turn = (self.uneven * self.rolled_m / track_m).min(std::f64::consts::PI);
        let aside = (turn * self.rolled_m / 2.0).min(WIDEST_M);
        [aside * aside, turn * turn]
    }

    /// Of position and heading, m^2 and rad^2.
    pub(crate) fn variances(&self, track_m: f64) -> [f64; 2] {
        let [place, heading] = self.of_wheels(track_m);
        [place + self.relocated[0], heading + self.relocated[1]]
    }
}
