//! Set-ups of the tests.

use common::{
    mission::Mission,
    samples::{ClearBeam, GridHeader},
};
use glam::DVec2;

pub(crate) fn mission(text: &str) -> Mission {
    Mission::parse(text, "test.toml").unwrap()
}

pub(crate) fn beam(from: DVec2, bearing_deg: f64, clear_m: f64) -> ClearBeam {
    let [x_m, y_m, bearing_rad, clear_m] =
        [from.x, from.y, bearing_deg.to_radians(), clear_m].map(|it| it as f32);
    ClearBeam { x_m, y_m, bearing_rad, clear_m }
}

pub(crate) fn belief(beams: &[ClearBeam], rays: &[ClearBeam]) -> GridHeader {
    let mut header = GridHeader {
        clear_beam_count: beams.len() as u64,
        clear_ray_count: rays.len() as u64,
        ..GridHeader::default()
    };
    header.clear_beams[..beams.len()].copy_from_slice(beams);
    header.clear_rays[..rays.len()].copy_from_slice(rays);
    header
}
