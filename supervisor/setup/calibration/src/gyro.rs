//! Ratio and track from distances and turns between two rests, by a gyro. Pure.
//!
//! The equation is that of [`crate::loops`] with the gyro's turn, less its bias, in place of whole
//! turns. The first rest gives bias (mean) and noise (scatter).
//!
//! A scale error of the gyro is common to all motions. The ratio follows from drives with hardly
//! any turn, so it is unaffected. Turns cannot separate the scale error from a track error, so the
//! track's deviation includes it.

use nalgebra::DMatrix;

use crate::loops::{Estimate, Refusal, Rows};

/// Motion between two rests.
#[derive(Clone, Copy, Debug, Default)]
pub struct Motion {
    /// Nominal distances, forward less backward.
    pub left_m: f64,
    pub right_m: f64,
    /// Sum of both wheels' distances.
    pub rolled_m: f64,
    /// Turn by the gyro, counter-clockwise, including its bias.
    pub turned_rad: f64,
    pub seconds: f64,
}

/// Minimum total distance, metres, and turn, radians, to determine ratio and track.
const LEAST_M: f64 = 1.5;
const LEAST_RAD: f64 = 3.0;
const LEAST_REST_S: f64 = 2.0;

/// Returns the seconds of a rest, the gyro's bias in it, rad/s, and the variance of a turn, rad^2/s.
fn rest(increments: &[(f64, f64)]) -> Result<[f64; 3], Refusal> {
    let seconds = increments.iter().map(|it| it.0).sum::<f64>();
    if increments.len() < 3 || seconds < LEAST_REST_S {
        return Err(Refusal::NoRest { seconds });
    }
    let bias_rad_s = increments.iter().map(|it| it.1).sum::<f64>() / seconds;
    let square = |(seconds, turn): &(f64, f64)| (turn - bias_rad_s * seconds).powi(2);
    let freedom = (increments.len() - 1) as f64;
    let mean_s = seconds / increments.len() as f64;
    let noise = increments.iter().map(square).sum::<f64>() / freedom / mean_s;
    Ok([seconds, bias_rad_s, noise])
}

/// Estimates ratio and track.
///
/// `at_rest` has the seconds and turns of the gyro's increments before the first motion. `scale_sd`
/// is the gyro's scale deviation, a share. `track_m` is nominal.
///
/// # Errors
/// Returns why nothing may be written.
pub fn checked(
    at_rest: &[(f64, f64)],
    motions: &[Motion],
    scale_sd: f64,
    track_m: f64,
) -> Result<Estimate, Refusal> {
    let [seconds, bias_rad_s, noise] = rest(at_rest)?;
    let turned = |it: &Motion| it.turned_rad - bias_rad_s * it.seconds;
    let driven_m = motions.iter().map(|it| f64::midpoint(it.left_m, it.right_m).abs()).sum();
    let turned_rad = motions.iter().map(|it| turned(it).abs()).sum();
    if driven_m < LEAST_M || turned_rad < LEAST_RAD {
        return Err(Refusal::Short { driven_m, turned_deg: f64::to_degrees(turned_rad) });
    }
    let row = |it: &Motion| {
        let factors = [(it.right_m + it.left_m) / track_m, -turned(it)];
        (factors, -(it.right_m - it.left_m) / track_m, it.rolled_m / (track_m * track_m))
    };
    let rows: Vec<_> = motions.iter().map(row).collect();
    let by_gyro = DMatrix::from_fn(rows.len(), rows.len(), |one, other| {
        let (it, also) = (&motions[one], &motions[other]);
        let of_noise = if one == other { noise * it.seconds } else { 0.0 };
        let of_bias = noise / seconds * it.seconds * also.seconds;
        of_noise + of_bias + scale_sd * scale_sd * turned(it) * turned(also)
    });
    Estimate::of(&Rows::new(&rows, by_gyro))?.unless_scattered()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRACK_M: f64 = 0.3;

    /// Returns the estimate for wheels of this ratio and track, with gyro bias and scale error.
    fn estimate(
        ratio: f64,
        track: f64,
        scale: f64,
        motions: &[[f64; 2]],
    ) -> Result<Estimate, Refusal> {
        let bias = 0.001;
        let rest: Vec<_> =
            (0..40).map(|it| (0.1, 1e-4 + 3e-5 * (f64::from(it) * 2.1).sin())).collect();
        let motions = motions.iter().map(|[way, turn]| {
            let rims = [-0.5, 0.5].map(|side| way + side * turn * TRACK_M * track);
            let mean = (1.0 + ratio) / 2.0;
            let [left_m, right_m] = [rims[0] * mean, rims[1] * mean / ratio];
            let rolled_m = left_m.abs() + right_m.abs();
            let turned_rad = turn * (1.0 + scale) + bias * 8.0;
            Motion { left_m, right_m, rolled_m, turned_rad, seconds: 8.0 }
        });
        checked(&rest, &motions.collect::<Vec<_>>(), 0.01, TRACK_M)
    }

    const PROCEDURE: [[f64; 2]; 4] = [[2.0, 0.02], [0.0, 3.2], [2.0, -0.03], [0.0, -3.2]];

    #[test]
    fn ratio_and_track_are_found_and_the_gyros_scale_is_in_the_deviation_of_the_track_alone() {
        for (ratio, track, scale) in [(1.0, 1.0, 0.0), (1.008, 0.975, 0.005), (0.99, 1.02, -0.01)] {
            let found = estimate(ratio, track, scale, &PROCEDURE).unwrap();
            let off = (found.ratio() - ratio).abs();
            assert!(off < 5e-4 && found.ratio_sd() < 3e-3, "{off} +- {}", found.ratio_sd());
            let off = (found.track() - track).abs();
            let sd = found.track_sd();
            assert!(off < 2.0 * sd && (0.008..0.012).contains(&sd), "{off} +- {sd}");
        }
    }

    #[test]
    fn a_robot_that_hardly_drove_or_never_turned_or_never_stood_is_told_so() {
        for motions in [&[[0.2, 0.0], [0.0, 3.2], [0.2, 0.0]][..], &[[2.0, 0.0], [2.0, 0.0]], &[]] {
            assert!(matches!(estimate(1.0, 1.0, 0.0, motions), Err(Refusal::Short { .. })));
        }
        assert!(matches!(checked(&[], &[], 0.01, TRACK_M), Err(Refusal::NoRest { .. })));
    }
}
