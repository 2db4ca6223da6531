//! The newest readings as evidence of free ground.
//!
//! A smooth face answers only a beam along its normal. So a beam that nothing answered says nothing of faces at a slant,
//! and the evidence grid, which knows no directions, cannot hold what it does say: no face square to this beam is
//! nearer. The readings themselves can, and the planner asks them about every face that the robot could touch. The rays
//! of infrared rangers are kept beside them: those end at a face of any angle.

use common::samples::{CLEAR_BEAMS, CLEAR_RAYS, ClearBeam, GridHeader};
use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{
    reading::{Ray, Reading},
    sonar_model::SonarModel,
};

/// Readings, oldest first: of the sonar at most [`CLEAR_BEAMS`], of infrared rangers [`CLEAR_RAYS`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct ClearBeams {
    beams: Vec<Dated>,
    rays: Vec<Dated>,
}

/// A reading, and what the wheels had rolled then, metres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Dated {
    beam: ClearBeam,
    rolled_m: f64,
}

impl ClearBeams {
    /// Bytes of as many as there can be, saved.
    pub(crate) const SAVED_BYTES: usize = (CLEAR_BEAMS + CLEAR_RAYS) * size_of::<Dated>();

    /// Take a reading after the wheels have rolled `rolled_m` metres; those that are too old go.
    pub(crate) fn take(&mut self, sonar: &SonarModel, reading: &Reading, rolled_m: f64) {
        let clear_m = reading
            .echo
            .map_or(f64::INFINITY, |range| range - sonar.ahead_of_echo_m);
        let beam = clear_beam(reading.origin, reading.axis, clear_m.min(sonar.clear_m));
        let oldest_m = rolled_m - sonar.clear_for_m;
        keep(
            &mut self.beams,
            CLEAR_BEAMS,
            oldest_m,
            Dated { beam, rolled_m },
        );
    }

    /// Take a reading of an infrared ranger; otherwise as [`ClearBeams::take`].
    pub(crate) fn take_ray(&mut self, sonar: &SonarModel, ray: &Ray, rolled_m: f64) {
        let beam = clear_beam(ray.origin, ray.axis, ray.seen.clear_m);
        let oldest_m = rolled_m - sonar.clear_for_m;
        keep(
            &mut self.rays,
            CLEAR_RAYS,
            oldest_m,
            Dated { beam, rolled_m },
        );
    }

    /// Forget all.
    pub(crate) fn clear(&mut self) {
        self.beams.clear();
        self.rays.clear();
    }

    /// Put them into the header of a `grid` sample.
    pub(crate) fn fill(&self, header: &mut GridHeader) {
        header.clear_beam_count = self.beams.len() as u64;
        for (to, dated) in header.clear_beams.iter_mut().zip(&self.beams) {
            *to = dated.beam;
        }
        header.clear_ray_count = self.rays.len() as u64;
        for (to, dated) in header.clear_rays.iter_mut().zip(&self.rays) {
            *to = dated.beam;
        }
    }
}

fn clear_beam(origin: DVec2, axis: DVec2, clear_m: f64) -> ClearBeam {
    ClearBeam {
        x_m: origin.x as f32,
        y_m: origin.y as f32,
        bearing_rad: axis.to_angle() as f32,
        clear_m: clear_m as f32,
    }
}

/// Append `newest`, of readings no older than `oldest_m` and no more than `most`.
fn keep(readings: &mut Vec<Dated>, most: usize, oldest_m: f64, newest: Dated) {
    readings.retain(|dated| dated.rolled_m > oldest_m);
    if readings.len() >= most {
        readings.remove(0);
    }
    readings.push(newest);
}
