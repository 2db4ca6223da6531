//! Surfaces in the way that the readings could have missed.
//!
//! A smooth surface answers from the foot of the sonar's perpendicular, and only near its normal
//! (Kuc and Siegel 1987). A slanted surface reflects the sound away, so a silent beam ahead leaves
//! a wall at 45 degrees possible. A surface that the body touches has its normal within a right
//! angle of the motion. Each such surface is assumed until a reading that would have detected it
//! excludes it.

use std::{cell::RefCell, f64::consts::TAU};

use common::samples::{ClearBeam, GridHeader};
use glam::DVec2;

/// Largest angle between the way and a normal; the body passes surfaces beyond it.
const WIDEST_DEG: f64 = 75.0;
/// Angle between normals; less than the width of a beam.
const STEP_DEG: f64 = 15.0;
/// Angle between a beam and the normal within which a surface answers: slightly wider than the
/// cone.
const ANSWERS_WITHIN_DEG: f64 = 17.0;
/// Same angle for distances up to [`NEAR_M`].
const NEAR_ANSWERS_WITHIN_DEG: f64 = 20.0;
const NEAR_M: f64 = 1.2;
/// Extent of an assumed surface from the point of touch, metres. The end of a shorter one is an
/// edge, which answers a beam ahead.
const EXTENDS_M: f64 = 1.0;
/// Least cosine between a ray and the normal of a surface that it detects: 70 degrees.
const LEAST_SLANT: f64 = 0.34;
/// Distance from the point of touch within which a ray excludes a surface, metres.
const MET_WITHIN_M: f64 = 0.35;
/// Bound of rounding of such distances, metres.
const ROUNDING_M: f64 = 1e-6;
/// Required free ground between body and surface, metres.
const MARGIN_M: f64 = 0.02;
/// Distance before an assumed surface within which an echo may be its own, metres.
const NEAR_ECHO_M: f64 = 0.25;
/// Echoes that weigh as much as one silence: fewer than two in three pings get lost.
const ECHOES_FOR_A_SILENCE: usize = 2;

const NORMALS: usize = 2 * (WIDEST_DEG / STEP_DEG) as usize + 1;

const SECTORS: usize = 32;
/// Sectors between a normal and a beam that its surface answers, at most.
const EITHER_SIDE: usize = (NEAR_ANSWERS_WITHIN_DEG * SECTORS as f64 / 360.0) as usize + 1;

pub(crate) struct UndetectedSurfaces {
    beams: BySector,
    rays: Vec<Beam>,
    near: RefCell<Vec<Beam>>,
    reach: f64,
    /// Distance from the body's centre within which a ray excludes a surface, metres.
    met_within: f64,
    /// Normals and their angles, with the way along x.
    normals: [(DVec2, f64); NORMALS],
    /// Least cosines between a beam and the normals of far and near surfaces that answer it.
    answers: [f64; 2],
}

/// A reading in the mission frame, metres.
#[derive(Clone, Copy)]
pub(crate) struct Beam {
    pub origin: DVec2,
    pub axis: DVec2,
    pub clear: f64,
    /// Whether an assumed surface may lie beyond the free length, with its echo before it.
    may_echo: bool,
}

impl From<&ClearBeam> for Beam {
    fn from(beam: &ClearBeam) -> Self {
        Self {
            origin: DVec2::new(beam.x_m.into(), beam.y_m.into()),
            axis: DVec2::from_angle(beam.bearing_rad.into()),
            clear: beam.clear_m.into(),
            may_echo: true,
        }
    }
}

struct BySector {
    /// Sorted by sector; within a sector, beams that may have an echo come last.
    beams: Vec<Beam>,
    /// First beam of each sector, and the end of the last.
    starts: [usize; SECTORS + 1],
}

impl BySector {
    fn new(readings: &[ClearBeam], place: DVec2, within: f64) -> Self {
        let beams = readings.iter().map(|reading| {
            let beam = Beam::from(reading);
            let may_echo = beam.clear < beam.origin.distance(place) + within + ROUNDING_M;
            (sector_of(reading.bearing_rad.into()), Beam { may_echo, ..beam })
        });
        let mut sorted: Vec<_> = beams.collect();
        sorted.sort_by_key(|(sector, beam)| (*sector, beam.may_echo));
        assert!(sorted.last().is_none_or(|(sector, _)| *sector < SECTORS));
        Self {
            starts: std::array::from_fn(|start| sorted.partition_point(|it| it.0 < start)),
            beams: sorted.into_iter().map(|(_, beam)| beam).collect(),
        }
    }

    /// Returns the beams that a surface with its normal in `sector` may answer.
    ///
    /// The sector itself comes first, because most of its beams answer.
    fn around(&self, sector: usize) -> [&[Beam]; 2 * EITHER_SIDE + 1] {
        std::array::from_fn(|step| {
            let beside = if step % 2 == 0 { step / 2 } else { SECTORS - step.div_ceil(2) };
            let sector = (sector + beside) % SECTORS;
            &self.beams[self.starts[sector]..self.starts[sector + 1]]
        })
    }
}

#[derive(Clone, Copy)]
struct Tally {
    silences: usize,
    echoes: usize,
    /// Readings left that may have an echo.
    left: usize,
}

impl Tally {
    /// Weighs a `reading` that the surface answers from `distance`.
    ///
    /// Returns whether echoes can no longer outweigh the silences.
    fn is_decided_by(&mut self, reading: &Beam, distance: Option<f64>) -> bool {
        assert!(self.left > 0 || !reading.may_echo, "each possible echo is counted");
        self.left -= usize::from(reading.may_echo);
        match distance {
            Some(distance) if distance <= reading.clear => self.silences += 1,
            Some(distance) if distance <= reading.clear + NEAR_ECHO_M => self.echoes += 1,
            _ => {}
        }
        self.silences * ECHOES_FOR_A_SILENCE > self.echoes + self.left
    }
}

fn sector_of(angle: f64) -> usize {
    ((angle / TAU * SECTORS as f64).floor() as i64).rem_euclid(SECTORS as i64) as usize
}

impl UndetectedSurfaces {
    /// Prepares the surfaces that the body could touch within `ahead_m` metres of `place`.
    pub(crate) fn new(belief: &GridHeader, radius: f64, place: DVec2, ahead_m: f64) -> Self {
        let reach = radius + MARGIN_M;
        assert!(radius > 0.0 && ahead_m >= 0.0);
        Self {
            beams: BySector::new(belief.clear_beams(), place, ahead_m + reach),
            rays: belief.clear_rays().iter().map(Beam::from).collect(),
            near: RefCell::default(),
            reach,
            met_within: reach.hypot(MET_WITHIN_M) + ROUNDING_M,
            normals: std::array::from_fn(|index| {
                let step = index as i32 - (NORMALS / 2) as i32;
                let angle = (f64::from(step) * STEP_DEG).to_radians();
                (DVec2::from_angle(angle), angle)
            }),
            answers: [ANSWERS_WITHIN_DEG, NEAR_ANSWERS_WITHIN_DEG]
                .map(|deg| deg.to_radians().cos()),
        }
    }

    /// Returns unit vectors towards surfaces that no reading excludes, for a body at `at` moving
    /// `along`.
    pub(crate) fn normals(&self, at: DVec2, along: DVec2) -> impl Iterator<Item = DVec2> + use<> {
        let heading = along.to_angle();
        let mut rays = self.near.borrow_mut();
        rays.clear();
        rays.extend(self.rays.iter().filter_map(|ray| self.near(ray, at)));
        rays.sort_unstable_by_key(|ray| ray.may_echo);
        let undetected = self.normals.map(|(normal, angle)| {
            let normal = normal.rotate(along);
            let beams = self.beams.around(sector_of(heading + angle));
            (!self.is_excluded(at, normal, &beams, &rays)).then_some(normal)
        });
        undetected.into_iter().flatten()
    }

    fn near(&self, ray: &Beam, at: DVec2) -> Option<Beam> {
        let offset = at - ray.origin;
        let (along, near) = (ray.axis.dot(offset), self.met_within);
        let meets = ray.axis.perp_dot(offset).abs() <= near
            && (-near..=ray.clear + NEAR_ECHO_M + near).contains(&along);
        meets.then_some(Beam { may_echo: ray.clear < along + near, ..*ray })
    }

    fn is_excluded(&self, at: DVec2, normal: DVec2, beams: &[&[Beam]], rays: &[Beam]) -> bool {
        let may_echo =
            |beams: &&[Beam]| beams.iter().rev().take_while(|beam| beam.may_echo).count();
        let left = beams.iter().chain(&[rays]).map(may_echo).sum();
        debug_assert!(rays.is_sorted_by_key(|ray| ray.may_echo));
        let mut tally = Tally { silences: 0, echoes: 0, left };
        let mut beams = beams.iter().copied().flatten();
        beams.any(|beam| tally.is_decided_by(beam, self.answers_from(beam, at, normal)))
            || rays.iter().any(|ray| tally.is_decided_by(ray, self.met_after(ray, at, normal)))
    }

    fn answers_from(&self, beam: &Beam, at: DVec2, normal: DVec2) -> Option<f64> {
        let [far, near] = self.answers;
        let square = beam.axis.dot(normal);
        // At this angle, a surface at any distance stays silent.
        if square < near {
            return None;
        }
        let offset = at - beam.origin;
        let distance = offset.dot(normal) + self.reach;
        let answers = if distance <= NEAR_M { near } else { far };
        (square >= answers && offset.perp_dot(normal).abs() <= EXTENDS_M).then_some(distance)
    }

    fn met_after(&self, ray: &Beam, at: DVec2, normal: DVec2) -> Option<f64> {
        let slant = ray.axis.dot(normal);
        if slant < LEAST_SLANT {
            return None;
        }
        let offset = at - ray.origin;
        let meets = (offset.dot(normal) + self.reach) / slant;
        let along_surface = (meets * ray.axis - offset).perp_dot(normal).abs();
        (meets >= 0.0 && along_surface <= MET_WITHIN_M).then_some(meets)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{beam, belief};

    const BODY_M: f64 = 0.19;

    fn ahead(x: f64, bearing_deg: f64, clear_m: f64) -> ClearBeam {
        beam(DVec2::new(x, 0.0), bearing_deg, clear_m)
    }

    fn undetected(beams: &[ClearBeam], rays: &[ClearBeam]) -> Vec<i32> {
        let surfaces = UndetectedSurfaces::new(&belief(beams, rays), BODY_M, DVec2::ZERO, 0.0);
        let normals = surfaces.normals(DVec2::ZERO, DVec2::X);
        normals.map(|normal| normal.to_angle().to_degrees().round() as i32).collect()
    }

    #[test]
    fn a_silent_beam_excludes_only_surfaces_square_to_it_and_a_scan_or_a_ring_of_rays_all() {
        assert_eq!(undetected(&[], &[]).len(), 11);
        assert_eq!(undetected(&[ahead(0.0, 0.0, 2.0)], &[]), [-75, -60, -45, -30, 30, 45, 60, 75]);
        assert_eq!(undetected(&[ahead(0.0, 45.0, 2.0)], &[]), [-75, -60, -45, -30, -15, 0, 15, 75]);
        let scan = Vec::from_iter((-4..=4).map(|step| ahead(-0.3, f64::from(step) * 16.0, 2.0)));
        assert_eq!(undetected(&scan, &[]), [0; 0]);
        assert_eq!(undetected(&[], &ring(0.25, 0.7)), [0; 0]);
    }

    #[test]
    fn a_reading_excludes_no_surface_beyond_its_echo_or_too_far_aside() {
        let (echo, silence) = (ahead(0.0, 0.0, 0.15), ahead(0.0, 0.0, 2.0));
        for (what, beams, rays, degrees, detected) in [
            // The body with its margin extends 0.21 m ahead.
            ("a surface before the echo", &[ahead(-0.5, 0.0, 0.72)][..], &[][..], 0, true),
            ("a surface at the echo", &[ahead(-0.5, 0.0, 0.70)], &[], 0, false),
            ("a surface that extends for a metre", &[ahead(-0.9, 75.0, 2.0)], &[], 75, true),
            ("a surface that would extend farther", &[ahead(-1.1, 75.0, 2.0)], &[], 75, false),
            ("a silence beside an echo", &[echo, silence], &[], 0, true),
            ("a lost ping among echoes", &[echo, silence, echo], &[], 0, false),
            // The ray at 11.25 degrees meets a surface square ahead after 0.28 m.
            ("a surface beyond the rays", &[], &ring(0.25, 0.25), 0, false),
            ("a ray 0.5 m aside", &[], &[ClearBeam { y_m: 0.5, ..ahead(0.0, 0.0, 0.7) }], 0, false),
        ] {
            assert_eq!(!undetected(beams, rays).contains(&degrees), detected, "{what}");
        }
    }

    /// Front four rays of the ring, free for `clear_m`, on a robot `behind` metres behind the
    /// origin.
    fn ring(behind: f64, clear_m: f64) -> [ClearBeam; 4] {
        [33.75, 11.25, -11.25, -33.75].map(|bearing_deg: f64| {
            let from = BODY_M * DVec2::from_angle(bearing_deg.to_radians());
            beam(from - behind * DVec2::X, bearing_deg, clear_m)
        })
    }

    #[test]
    fn a_surface_is_decided_early_only_where_the_rest_of_the_readings_could_not_change_it() {
        // Readings all around, about as long as the distances of the surfaces.
        let beam = |n: i16| {
            let n = f64::from(n);
            ahead(0.3 * (n * 0.7).sin(), n * 137.5 % 360.0, 0.15 + 0.2 * (n * 1.3).sin())
        };
        let belief = belief(&Vec::from_iter((0..120).map(beam)), &[]);
        // With surfaces at any distance, every reading may have an echo and takes part.
        let [near, far] = [0.6, f64::INFINITY]
            .map(|ahead_m| UndetectedSurfaces::new(&belief, BODY_M, DVec2::ZERO, ahead_m));
        let mut excluded = 0;
        for n in 0..60 {
            let along = DVec2::from_angle(f64::from(n));
            let at = 0.01 * f64::from(n) * along;
            let found = Vec::from_iter(near.normals(at, along));
            assert_eq!(found, Vec::from_iter(far.normals(at, along)), "{at}");
            excluded += NORMALS - found.len();
        }
        assert!((60..60 * NORMALS - 60).contains(&excluded), "{excluded}");
    }
}
