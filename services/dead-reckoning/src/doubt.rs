//! Doubts of the pose that no fix settles: wheels that count unequal shares of what they are told, and fixes that contradicted the pose
//! until it became theirs. They widen the covariance that is given, and not the filter's, whose gates would take anything then.

use common::samples::WheelSample;
use glam::DVec2;
use serde::{Deserialize, Serialize};

/// The wheels' ratio is off if it is so many of its deviations, and so much, from 1. In 240 missions of X80s and Kobukis with even wheels,
/// half of them on a busy machine, it came to at most 0.89 of the greater of both, and in 320 of Jackals, Kobukis and X80s, most of them among
/// what moves, to at most 0.64; an encoder that counts 4 % too little in half of a mission comes to 1.05.
const DEVIATIONS: f64 = 2.5;
const LEAST_OFF: f64 = 0.018;
/// A doubt of the place is told from here on, metres.
const TOLD_M: f64 = 0.1;
const WIDEST_M: f64 = 10.0;

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Doubt {
    /// The way at the rims since the newest fix by a source that does not drive with these wheels, metres.
    rolled_m: f64,
    /// How far the ratio was off at most.
    uneven: f64,
    is_told: bool,
    /// Squares of the ways and turns by which fixes relocated the robot, m^2 and rad^2.
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

    /// Returns a warning once.
    pub(crate) fn roll(
        &mut self,
        wheels: &WheelSample,
        rim_m: f64,
        track_m: f64,
    ) -> Option<String> {
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
            "the right wheel counts {told_ratio:.2} times the share of its commanded way that the left one counts: either may be wrong, so the pose is unsure by {:.1} m and more: check encoders and wheels",
            place.sqrt()
        ))
    }

    /// If the counts, and not the commands, are wrong all the way: variances, m^2 and rad^2.
    fn of_wheels(&self, track_m: f64) -> [f64; 2] {
        let turn = (self.uneven * self.rolled_m / track_m).min(std::f64::consts::PI);
        let aside = (turn * self.rolled_m / 2.0).min(WIDEST_M);
        [aside * aside, turn * turn]
    }

    /// Variances of the place and the heading, m^2 and rad^2.
    pub(crate) fn variances(&self, track_m: f64) -> [f64; 2] {
        let [place, heading] = self.of_wheels(track_m);
        [place + self.relocated[0], heading + self.relocated[1]]
    }
}
