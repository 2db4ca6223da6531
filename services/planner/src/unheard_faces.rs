//! Faces that could stand in the way unheard.
//!
//! A smooth face answers from the foot of the sonar's perpendicular on it, and only a sonar whose axis is near its normal
//! (Kuc and Siegel 1987: what is hit at a slant throws the sound away). So that a beam ahead was silent says nothing of
//! a wall at 45 degrees to the way. What would the robot touch? Whatever the body touches at a point has its normal
//! there, within a right angle of the motion. So for each point of the way and each normal, a face tangent to the body
//! there is supposed, and the readings are asked whether one of them would have heard it.

use common::samples::ClearBeam;
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
/// Free ground that is asked for between body and face, metres.
const MARGIN_M: f64 = 0.02;
/// An echo from so little before the supposed face may be the face's own, metres.
const NEAR_ECHO_M: f64 = 0.25;
/// So many such echoes weigh as much as one silence: pings are lost, but not twice as often as they are answered.
const ECHOES_FOR_A_SILENCE: usize = 2;

/// The readings, and the body they are asked for.
#[derive(Clone, Debug)]
pub(crate) struct UnheardFaces {
    beams: Vec<Beam>,
    reach: f64,
}

/// A reading of the sonar.
#[derive(Clone, Copy, Debug)]
struct Beam {
    origin: DVec2,
    axis: DVec2,
    clear: f64,
}

impl UnheardFaces {
    /// From readings, for a body of `radius` metres.
    pub(crate) fn new(beams: &[ClearBeam], radius: f64) -> Self {
        let beams = beams.iter().map(|beam| Beam {
            origin: DVec2::new(beam.x_m.into(), beam.y_m.into()),
            axis: DVec2::from_angle(beam.bearing_rad.into()),
            clear: beam.clear_m.into(),
        });
        Self {
            beams: beams.collect(),
            reach: radius + MARGIN_M,
        }
    }

    /// Unit vectors towards the faces that a body at `at` could touch on its way along the unit vector `along`, and that no
    /// reading speaks against.
    pub(crate) fn normals(&self, at: DVec2, along: DVec2) -> impl Iterator<Item = DVec2> {
        let steps = (WIDEST_DEG / STEP_DEG) as i32;
        (-steps..=steps)
            .map(move |step| {
                DVec2::from_angle((f64::from(step) * STEP_DEG).to_radians()).rotate(along)
            })
            .filter(move |&normal| !self.is_refuted(at, normal))
    }

    /// Whether the readings speak against a face that touches a body at `at` on the side of `normal`.
    fn is_refuted(&self, at: DVec2, normal: DVec2) -> bool {
        let [far, near] =
            [ANSWERS_WITHIN_DEG, NEAR_ANSWERS_WITHIN_DEG].map(|deg| deg.to_radians().cos());
        let (mut silences, mut echoes) = (0, 0);
        for beam in &self.beams {
            let offset = at - beam.origin;
            let distance = offset.dot(normal) + self.reach;
            let answers = if distance <= NEAR_M { near } else { far };
            if beam.axis.dot(normal) < answers || offset.perp_dot(normal).abs() > REACHES_M {
                continue;
            }
            if distance <= beam.clear {
                silences += 1;
            } else if distance <= beam.clear + NEAR_ECHO_M {
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

    /// Angles of the normals nothing speaks against, degrees, for a body at the origin on its way along x.
    fn unheard(beams: &[ClearBeam]) -> Vec<i32> {
        let faces = UnheardFaces::new(beams, BODY_M);
        let normals = faces.normals(DVec2::ZERO, DVec2::X);
        normals
            .map(|normal| normal.to_angle().to_degrees().round() as i32)
            .collect()
    }

    #[test]
    fn a_silent_beam_speaks_only_against_faces_square_to_it() {
        assert_eq!(unheard(&[]).len(), 11);
        assert_eq!(
            unheard(&[beam(0.0, 0.0, 2.0)]),
            [-75, -60, -45, -30, 30, 45, 60, 75]
        );
        assert_eq!(
            unheard(&[beam(0.0, 45.0, 2.0)]),
            [-75, -60, -45, -30, -15, 0, 15, 75]
        );
    }

    #[test]
    fn a_scan_to_both_sides_speaks_against_all() {
        let scan: Vec<_> = (-4..=4)
            .map(|step| beam(-0.3, f64::from(step) * 16.0, 2.0))
            .collect();
        assert_eq!(unheard(&scan), [0; 0]);
    }

    #[test]
    fn a_beam_speaks_against_nothing_beyond_its_echo() {
        // At 0.5 m before the body, which reaches 0.21 m ahead.
        assert!(!unheard(&[beam(-0.5, 0.0, 0.72)]).contains(&0));
        assert!(unheard(&[beam(-0.5, 0.0, 0.70)]).contains(&0));
    }

    #[test]
    fn a_face_is_not_supposed_to_reach_farther_than_a_metre_along_itself() {
        assert!(!unheard(&[beam(-0.9, 75.0, 2.0)]).contains(&75));
        assert!(unheard(&[beam(-1.1, 75.0, 2.0)]).contains(&75));
    }

    #[test]
    fn a_lost_ping_does_not_outweigh_the_echoes_beside_it() {
        let echo = beam(0.0, 0.0, 0.15);
        let silence = beam(0.0, 0.0, 2.0);
        assert!(!unheard(&[echo, silence]).contains(&0));
        assert!(unheard(&[echo, silence, echo]).contains(&0));
    }
}
