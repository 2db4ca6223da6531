//! The newest readings as evidence of free ground.
//!
//! A smooth surface answers only a beam along its normal. A beam without an echo therefore excludes only surfaces square to it, and the
//! evidence grid, which stores no directions, cannot hold that. So the newest readings are kept: the planner compares each surface that
//! the body could touch with them. The rays of infrared rangers are kept separately, because a ray ends at a surface of any angle.

use common::samples::{CLEAR_BEAMS, CLEAR_RAYS, ClearBeam, GridHeader};
use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{
    reading::{Ray, Reading},
    sonar_model::SonarModel,
};

/// Readings for each sonar.
const OF_ONE_SONAR: usize = CLEAR_BEAMS / 3;

/// Readings, oldest first: at most [`OF_ONE_SONAR`] for each sonar and [`CLEAR_RAYS`] of infrared rangers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct ClearBeams {
    beams: Vec<Dated>,
    rays: Vec<Dated>,
}

/// A reading with the distance that the wheels had rolled when it was taken.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Dated {
    beam: ClearBeam,
    rolled_m: f64,
}

impl ClearBeams {
    /// Size of the largest saved state, bytes.
    pub(crate) const SAVED_BYTES: usize = (CLEAR_BEAMS + CLEAR_RAYS) * size_of::<Dated>();

    /// Take a reading of one of `sonars` sonars after the wheels have rolled `rolled_m` metres, and drop the readings that are too old.
    pub(crate) fn take(&mut self, sonars: usize, reading: &Reading, rolled_m: f64) {
        let sonar = &reading.sonar;
        let clear_m = reading.echo.map_or(f64::INFINITY, |range| range - sonar.ahead_of_echo_m);
        let beam = clear_beam(reading.origin, reading.axis, clear_m.min(sonar.clear_m));
        let newest = Dated { beam, rolled_m };
        append(&mut self.beams, (OF_ONE_SONAR * sonars).min(CLEAR_BEAMS), sonar, newest);
    }

    /// Take a reading of an infrared ranger, as [`ClearBeams::take`] does of the sonar.
    pub(crate) fn take_ray(&mut self, sonar: &SonarModel, ray: &Ray, rolled_m: f64) {
        let beam = clear_beam(ray.origin, ray.axis, ray.seen.clear_m);
        let newest = Dated { beam, rolled_m };
        append(&mut self.rays, CLEAR_RAYS, sonar, newest);
    }

    pub(crate) fn clear(&mut self) {
        self.beams.clear();
        self.rays.clear();
    }

    /// Put the readings into the header of a `grid` sample.
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

/// Append `newest`, and drop readings that are too old and those beyond the newest `most`.
fn append(readings: &mut Vec<Dated>, most: usize, sonar: &SonarModel, newest: Dated) {
    let oldest_m = newest.rolled_m - sonar.clear_for_m;
    readings.retain(|dated| dated.rolled_m > oldest_m);
    if readings.len() >= most {
        readings.remove(0);
    }
    readings.push(newest);
}
