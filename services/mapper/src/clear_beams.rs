//! Newest readings as evidence of free ground.
//!
//! A smooth surface echoes only a beam along its normal, so silence excludes only surfaces square
//! to the beam. The evidence grid stores no directions. The planner therefore compares surfaces
//! within the body's reach with the newest readings. Infrared rays, kept apart, end at a surface of
//! any angle.

use common::samples::{CLEAR_BEAMS, CLEAR_RAYS, ClearBeam, GridHeader};
use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{
    reading::{Ray, Reading},
    sonar_model::{AHEAD_OF_ECHO_M, CLEAR_FOR_M},
};

const OF_ONE_SONAR: usize = CLEAR_BEAMS / 3;

/// Newest readings, oldest first: at most [`OF_ONE_SONAR`] per sonar, and [`CLEAR_RAYS`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct ClearBeams {
    beams: Vec<Dated>,
    rays: Vec<Dated>,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Dated {
    beam: ClearBeam,
    rolled_m: f64,
}

impl ClearBeams {
    pub(crate) const SAVED_BYTES: usize = (CLEAR_BEAMS + CLEAR_RAYS) * size_of::<Dated>();

    pub(crate) fn take(&mut self, sonars: usize, reading: &Reading, rolled_m: f64) {
        assert!(sonars > 0, "a reading comes from a used sonar");
        assert!(reading.echo.is_none_or(|range| range >= 0.0));
        let clear_m = reading.echo.map_or(f64::INFINITY, |range| range - AHEAD_OF_ECHO_M);
        let beam = clear_beam(reading.origin, reading.axis, clear_m.min(reading.sonar.clear_m));
        append(&mut self.beams, (OF_ONE_SONAR * sonars).min(CLEAR_BEAMS), Dated { beam, rolled_m });
    }

    pub(crate) fn take_ray(&mut self, ray: &Ray, rolled_m: f64) {
        assert!(ray.seen.clear_m >= 0.0);
        let beam = clear_beam(ray.origin, ray.axis, ray.seen.clear_m);
        append(&mut self.rays, CLEAR_RAYS, Dated { beam, rolled_m });
    }

    pub(crate) fn fill(&self, header: &mut GridHeader) {
        let GridHeader { clear_beams, clear_beam_count, clear_rays, clear_ray_count, .. } = header;
        *clear_beam_count = fill(clear_beams, &self.beams);
        *clear_ray_count = fill(clear_rays, &self.rays);
    }
}

fn fill(to: &mut [ClearBeam], readings: &[Dated]) -> u64 {
    to.iter_mut().zip(readings).for_each(|(to, dated)| *to = dated.beam);
    readings.len() as u64
}

fn clear_beam(origin: DVec2, axis: DVec2, clear_m: f64) -> ClearBeam {
    ClearBeam {
        x_m: origin.x as f32,
        y_m: origin.y as f32,
        bearing_rad: axis.to_angle() as f32,
        clear_m: clear_m as f32,
    }
}

fn append(readings: &mut Vec<Dated>, most: usize, newest: Dated) {
    assert!(most > 0);
    readings.retain(|dated| dated.rolled_m > newest.rolled_m - CLEAR_FOR_M);
    if readings.len() >= most {
        readings.remove(0);
    }
    readings.push(newest);
}
