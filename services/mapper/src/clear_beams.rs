//! The newest readings as evidence of free ground.
//!
//! A smooth face answers only a beam along its normal. So a beam that nothing answered says nothing of faces at a slant,
//! and the evidence grid, which knows no directions, cannot hold what it does say: no face square to this beam is
//! nearer. The readings themselves can, and the planner asks them about every face that the robot could touch.

use common::samples::{CLEAR_BEAMS, ClearBeam, GridHeader};
use serde::{Deserialize, Serialize};

use crate::{reading::Reading, sonar_model::SonarModel};

/// Readings, oldest first, at most [`CLEAR_BEAMS`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct ClearBeams {
    beams: Vec<Dated>,
}

/// A reading, and what the wheels had rolled then, metres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Dated {
    beam: ClearBeam,
    rolled_m: f64,
}

impl ClearBeams {
    /// Bytes of as many as there can be, saved.
    pub(crate) const SAVED_BYTES: usize = CLEAR_BEAMS * size_of::<Dated>();

    /// Take a reading after the wheels have rolled `rolled_m` metres; those that are too old go.
    pub(crate) fn take(&mut self, sonar: &SonarModel, reading: &Reading, rolled_m: f64) {
        let oldest_m = rolled_m - sonar.clear_for_m;
        self.beams.retain(|dated| dated.rolled_m > oldest_m);
        if self.beams.len() >= CLEAR_BEAMS {
            self.beams.remove(0);
        }
        let clear_m = reading
            .echo
            .map_or(f64::INFINITY, |range| range - sonar.ahead_of_echo_m);
        let beam = ClearBeam {
            x_m: reading.origin.x as f32,
            y_m: reading.origin.y as f32,
            bearing_rad: reading.axis.to_angle() as f32,
            clear_m: clear_m.min(sonar.clear_m) as f32,
        };
        self.beams.push(Dated { beam, rolled_m });
    }

    /// Forget all.
    pub(crate) fn clear(&mut self) {
        self.beams.clear();
    }

    /// Put them into the header of a `grid` sample.
    pub(crate) fn fill(&self, header: &mut GridHeader) {
        header.clear_beam_count = self.beams.len() as u64;
        for (to, dated) in header.clear_beams.iter_mut().zip(&self.beams) {
            *to = dated.beam;
        }
    }
}
