//! Echoes right ahead of the body.
//!
//! The belief weighs echoes against silences, so an intermittent echo, or one without room in the
//! map, may leave the way open. Right before the body, the nearest echo decides.

use common::{kinematics::Pose2, samples::GridHeader};

use crate::undetected_surfaces::Beam;

/// Newest readings per sonar that count, about a second, which limits the stop by a false echo.
const NEWEST: usize = 8;
/// Angle between a reading and the robot's axis within which it looked ahead: slightly wider than
/// the cone.
const AHEAD_DEG: f64 = 20.0;
/// Least free ground ahead for forward motion, metres.
///
/// A reading is free up to 0.05 m before its echo, so the echo is then 0.13 m away.
pub(crate) const STANDS_BEFORE_M: f64 = 0.08;

/// Returns the free ground ahead of a body of `radius` metres: the least of the newest readings,
/// infinite if none looked ahead.
pub(crate) fn clear_ahead_m(belief: &GridHeader, pose: &Pose2, radius: f64, sonars: usize) -> f64 {
    let (axis, within) = (pose.axis(), AHEAD_DEG.to_radians().cos());
    let newest = belief.clear_beams().iter().rev().take(NEWEST * sonars);
    newest
        .map(Beam::from)
        .filter(|beam| beam.axis.dot(axis) >= within)
        .map(|beam| (beam.origin - pose.position).dot(axis) + beam.clear - radius)
        .fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::testing::{beam, belief};

    /// Returns what is clear after readings of a sonar 0.19 m ahead of a robot at the origin:
    /// bearings in degrees, free lengths in metres.
    fn clear(readings: &[(f64, f64)], radius: f64, x: f64) -> f64 {
        let pose = Pose2 { position: DVec2::new(x, 0.0), heading: 0.0 };
        let beam = |&(deg, clear_m): &(f64, f64)| {
            beam(0.19 * DVec2::from_angle(deg.to_radians()), deg, clear_m)
        };
        let beams = Vec::from_iter(readings.iter().map(beam));
        clear_ahead_m(&belief(&beams, &[]), &pose, radius, 1)
    }

    #[test]
    fn an_echo_that_comes_and_goes_is_there_and_one_beside_or_long_past_is_not_ahead() {
        let (echo, silence) = ((0.0, 0.03), (0.0, 2.0));
        let long_past = [&[echo][..], &[silence; NEWEST]].concat();
        for (what, readings, radius, x, want) in [
            ("every second reading", &[echo, silence, echo, silence][..], 0.19, 0.0, 0.03),
            ("a sensor within the body's edge", &[(0.0, 0.07)], 0.22, 0.0, 0.04),
            ("the robot went on since", &[(0.0, 0.5)], 0.19, 0.4, 0.1),
            ("beside", &[(30.0, 0.03)], 0.19, 0.0, f64::INFINITY),
            ("long past", &long_past[..], 0.19, 0.0, 2.0),
        ] {
            let clear_m = clear(readings, radius, x);
            assert!(clear_m == want || (clear_m - want).abs() < 1e-6, "{what}: {clear_m}");
        }
    }
}
