//! Faces that could stand in the way undetected.
//!
//! A smooth face answers from the foot of the sonar's perpendicular on it, and only a sonar whose axis is near its normal
//! (Kuc and Siegel 1987: what is hit at a slant throws the sound away). So that a beam ahead was silent says nothing of
//! a wall at 45 degrees to the way. What would the robot touch? Whatever the body touches at a point has its normal
//! there, within a right angle of the motion. So for each point of the way and each normal, a face tangent to the body
//! there is supposed, and the readings are asked whether one of them would have heard it. An infrared ranger sees a face at
//! any angle, but only where its ray meets it.

use common::samples::{ClearBeam, GridHeader};
use glam::DVec2;

/// Half the angle between the way and the normals that are asked about. A face at more than this is passed, not met.
const WIDEST_DEG: f64 = 75.0;
/// From normal to normal: less than a beam is wide.
const STEP_DEG: f64 = 15.0;
/// A face answers a beam within this of its normal: the cone, and a little more.
const ANSWERS_WITHIN_DEG: f64 = 17.0;
/// A face that is near answers beams farther off its normal: ...
const NEAR_ANSWERS_WITHIN_DEG: f64 = 20.0;
/// ... up to here, metres.
const NEAR_M: f64 = 1.2;
/// How far from where the body would touch it a face is supposed to reach along itself, metres. One that ends before
/// could only be heard from nearer; its end is an edge, which answers a beam ahead.
const REACHES_M: f64 = 1.0;
/// Least cosine of the angle between a ray and the normal of a face that it meets, which is 70 degrees: nearer to the face's
/// own direction it is passed.
const LEAST_SLANT: f64 = 0.34;
/// The same for a face that a ray of an infrared ranger would have met, metres: what is met is near.
const MET_WITHIN_M: f64 = 0.35;
/// Free ground that is asked for between body and face, metres.
const MARGIN_M: f64 = 0.02;
/// An echo from so little before the supposed face may be the face's own, metres.
const NEAR_ECHO_M: f64 = 0.25;
/// So many such echoes weigh as much as one silence: pings are lost, but not twice as often as they are answered.
const ECHOES_FOR_A_SILENCE: usize = 2;

/// Normals to either side of the way, and the way itself.
const NORMALS: usize = 2 * (WIDEST_DEG / STEP_DEG) as usize + 1;

/// The readings, and the body they are asked for.
#[derive(Clone, Debug)]
pub(crate) struct UndetectedSurfaces {
    beams: Vec<Beam>,
    rays: Vec<Beam>,
    reach: f64,
    /// The normals that are asked about, of a way along x.
    normals: [DVec2; NORMALS],
    /// Least cosine of the angle between a beam and the normal of a face that answers it: of one that is far, and near.
    answers: [f64; 2],
}

/// A reading.
#[derive(Clone, Copy, Debug)]
struct Beam {
    origin: DVec2,
    axis: DVec2,
    clear: f64,
}

impl UndetectedSurfaces {
    /// From the readings in `belief`, for a body of `radius` metres.
    pub(crate) fn new(belief: &GridHeader, radius: f64) -> Self {
        let beam = |beam: &ClearBeam| Beam {
            origin: DVec2::new(beam.x_m.into(), beam.y_m.into()),
            axis: DVec2::from_angle(beam.bearing_rad.into()),
            clear: beam.clear_m.into(),
        };
        Self {
            beams: belief.clear_beams().iter().map(beam).collect(),
            rays: belief.clear_rays().iter().map(beam).collect(),
            reach: radius + MARGIN_M,
            normals: std::array::from_fn(|index| {
                let step = index as i32 - (NORMALS / 2) as i32;
                DVec2::from_angle((f64::from(step) * STEP_DEG).to_radians())
            }),
            answers: [ANSWERS_WITHIN_DEG, NEAR_ANSWERS_WITHIN_DEG]
                .map(|deg| deg.to_radians().cos()),
        }
    }

    /// Unit vectors towards the faces that a body at `at` could touch on its way along the unit vector `along`, and that no
    /// reading speaks against.
    pub(crate) fn normals(&self, at: DVec2, along: DVec2) -> impl Iterator<Item = DVec2> {
        let normals = self.normals.iter();
        normals
            .map(move |normal| normal.rotate(along))
            .filter(move |&normal| !self.is_refuted(at, normal))
    }

    /// Whether the readings speak against a face that touches a body at `at` on the side of `normal`.
    fn is_refuted(&self, at: DVec2, normal: DVec2) -> bool {
        let [far, near] = self.answers;
        let (mut silences, mut echoes) = (0, 0);
        for beam in &self.beams {
            let square = beam.axis.dot(normal);
            // Most beams: however near the face is, it does not answer them.
            if square < near {
                continue;
            }
            let offset = at - beam.origin;
            let distance = offset.dot(normal) + self.reach;
            let answers = if distance <= NEAR_M { near } else { far };
            if square < answers || offset.perp_dot(normal).abs() > REACHES_M {
                continue;
            }
            if distance <= beam.clear {
                silences += 1;
            } else if distance <= beam.clear + NEAR_ECHO_M {
                echoes += 1;
            }
        }
        for ray in &self.rays {
            let offset = at - ray.origin;
            let slant = ray.axis.dot(normal);
            let meets = (offset.dot(normal) + self.reach) / slant;
            let along_face = (meets * ray.axis - offset).perp_dot(normal).abs();
            if slant < LEAST_SLANT || meets < 0.0 || along_face > MET_WITHIN_M {
                continue;
            }
            if meets <= ray.clear {
                silences += 1;
            } else if meets <= ray.clear + NEAR_ECHO_M {
                echoes += 1;
            }
        }
        silences * ECHOES_FOR_A_SILENCE > echoes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BODY_M: f64 = 0.19;

    fn beam(x: f64, bearing_deg: f64, clear_m: f64) -> ClearBeam {
        ClearBeam {
            x_m: x as f32,
            y_m: 0.0,
            bearing_rad: bearing_deg.to_radians() as f32,
            clear_m: clear_m as f32,
        }
    }

    /// What a mapper says that has these readings of the sonar and of infrared rangers.
    fn belief(beams: &[ClearBeam], rays: &[ClearBeam]) -> GridHeader {
        let mut header = GridHeader {
            clear_beam_count: beams.len() as u64,
            clear_ray_count: rays.len() as u64,
            ..GridHeader::default()
        };
        header.clear_beams[..beams.len()].copy_from_slice(beams);
        header.clear_rays[..rays.len()].copy_from_slice(rays);
        header
    }

    /// Angles of the normals nothing speaks against, degrees, for a body at the origin on its way along x.
    fn undetected(beams: &[ClearBeam]) -> Vec<i32> {
        undetected_by(beams, &[])
    }

    fn undetected_by(beams: &[ClearBeam], rays: &[ClearBeam]) -> Vec<i32> {
        let faces = UndetectedSurfaces::new(&belief(beams, rays), BODY_M);
        let normals = faces.normals(DVec2::ZERO, DVec2::X);
        normals
            .map(|normal| normal.to_angle().to_degrees().round() as i32)
            .collect()
    }

    #[test]
    fn a_silent_beam_speaks_only_against_faces_square_to_it() {
        assert_eq!(undetected(&[]).len(), 11);
        assert_eq!(
            undetected(&[beam(0.0, 0.0, 2.0)]),
            [-75, -60, -45, -30, 30, 45, 60, 75]
        );
        assert_eq!(
            undetected(&[beam(0.0, 45.0, 2.0)]),
            [-75, -60, -45, -30, -15, 0, 15, 75]
        );
    }

    #[test]
    fn a_scan_to_both_sides_speaks_against_all() {
        let scan: Vec<_> = (-4..=4)
            .map(|step| beam(-0.3, f64::from(step) * 16.0, 2.0))
            .collect();
        assert_eq!(undetected(&scan), [0; 0]);
    }

    #[test]
    fn a_beam_speaks_against_nothing_beyond_its_echo() {
        // At 0.5 m before the body, which reaches 0.21 m ahead.
        assert!(!undetected(&[beam(-0.5, 0.0, 0.72)]).contains(&0));
        assert!(undetected(&[beam(-0.5, 0.0, 0.70)]).contains(&0));
    }

    #[test]
    fn a_face_is_not_supposed_to_reach_farther_than_a_metre_along_itself() {
        assert!(!undetected(&[beam(-0.9, 75.0, 2.0)]).contains(&75));
        assert!(undetected(&[beam(-1.1, 75.0, 2.0)]).contains(&75));
    }

    /// The front four of the ring, free so far, on a robot `behind` the origin.
    fn ring(behind: f64, clear_m: f64) -> [ClearBeam; 4] {
        [33.75, 11.25, -11.25, -33.75].map(|bearing_deg: f64| {
            let (sin, cos) = bearing_deg.to_radians().sin_cos();
            ClearBeam {
                y_m: (BODY_M * sin) as f32,
                ..beam(BODY_M * cos - behind, bearing_deg, clear_m)
            }
        })
    }

    #[test]
    fn infrared_rays_speak_against_faces_at_any_angle_as_far_as_they_are_free() {
        assert_eq!(undetected_by(&[], &ring(0.25, 0.7)), [0; 0]);
        // Square ahead the ray at 11.25 degrees meets a face after 0.28 m.
        let unseen = undetected_by(&[], &ring(0.25, 0.25));
        assert!(unseen.contains(&0), "{unseen:?}");
    }

    #[test]
    fn a_ray_says_nothing_of_a_face_that_it_meets_far_from_the_body() {
        // Along the way, 0.5 m beside it: the face would be met 0.5 m from where the body touches it.
        let ray = ClearBeam {
            y_m: 0.5,
            ..beam(0.0, 0.0, 0.7)
        };
        assert!(undetected_by(&[], &[ray]).contains(&0));
    }

    #[test]
    fn a_lost_ping_does_not_outweigh_the_echoes_beside_it() {
        let echo = beam(0.0, 0.0, 0.15);
        let silence = beam(0.0, 0.0, 2.0);
        assert!(!undetected(&[echo, silence]).contains(&0));
        assert!(undetected(&[echo, silence, echo]).contains(&0));
    }
}
