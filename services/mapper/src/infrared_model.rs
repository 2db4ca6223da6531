//! The infrared model: what the voltage of an infrared ranger means for the cells along its ray.
//!
//! A ranger triangulates: it sees a small spot straight ahead of itself, 10 to 80 cm away, whatever the angle of the
//! face. Its voltage grows with 1 / range, so that noise of the AD converter becomes noise of the range which
//! grows with its square. Nearer than 10 cm the voltage falls again: such a reading says that something is near,
//! and not how near. Glass and what throws no infrared back are not seen; the sonar hears those.

use std::ops::RangeInclusive;

use common::wire::{infrared_ad, infrared_m};

/// Counts that a ranger gives which is powered and connected, 0.2 V to 3.0 V: no less where it sees nothing, no more at
/// the peak of its curve. Others are of one that is dead or saturated.
const LIVE_AD: RangeInclusive<u16> = 268..=4_060;
/// Nearer than this a reading may be of something nearer still, metres.
const UNAMBIGUOUS_M: f64 = 0.10;
/// Farther than this a reading is no hit, metres: it could be of a ranger that sees nothing.
const HIT_WITHIN_M: f64 = 0.70;
/// Standard deviation of a reading, AD counts. Nominal: three times that of the AD converter alone.
const NOISE_AD: f64 = 15.0;
/// A ray is free up to so many standard deviations before the reading, ...
const SURE_DEVIATIONS: f64 = 2.0;
/// ... less this, metres: the formula's error on any one ranger.
const FORMULA_M: f64 = 0.02;

/// Half the width of the ground that a ray sweeps, metres: the spot of a ranger is some centimetres wide, and what stands
/// beside it is met by the next ray of a robot that moves. Nominal.
pub(crate) const SWEPT_ASIDE_M: f64 = 0.04;

/// What a reading says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Seen {
    /// Nothing stands on the ray nearer than this, metres from the ranger; at most 0.72.
    pub(crate) clear_m: f64,
    /// Something stands here, metres from the ranger.
    pub(crate) hit_m: Option<f64>,
}

/// What a ranger of `ad` counts sees; none of one that is not known to be live.
pub(crate) fn seen(ad: u16) -> Option<Seen> {
    if !LIVE_AD.contains(&ad) {
        return None;
    }
    let range_m = infrared_m(ad);
    let ambiguous = range_m < UNAMBIGUOUS_M;
    let clear_m = range_m - SURE_DEVIATIONS * deviation_m(range_m) - FORMULA_M;
    Some(Seen {
        clear_m: if ambiguous { 0.0 } else { clear_m.max(0.0) },
        hit_m: Some(range_m).filter(|range| *range <= HIT_WITHIN_M),
    })
}

/// Standard deviation of a range, metres.
fn deviation_m(range_m: f64) -> f64 {
    // Counts are a / range + b: a from the formula at two ranges.
    let (near, far) = (f64::from(infrared_ad(0.2)), f64::from(infrared_ad(0.4)));
    let counts_metres = (near - far) / (1.0 / 0.2 - 1.0 / 0.4);
    NOISE_AD * range_m * range_m / counts_metres
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_is_free_to_less_than_the_reading_and_the_less_the_farther() {
        for (range, clear, hit) in [
            (0.2, 0.176, true),
            (0.5, 0.454, true),
            (0.7, 0.629, true),
            (0.81, 0.722, false),
        ] {
            let seen = seen(infrared_ad(range)).unwrap();
            assert!((seen.clear_m - clear).abs() < 0.003, "{range} m: {seen:?}");
            let near = seen.hit_m.is_some_and(|hit| (hit - range).abs() < 0.002);
            assert_eq!(near, hit, "{range} m: {seen:?}");
        }
    }

    #[test]
    fn a_dead_or_saturated_ranger_says_nothing() {
        for ad in [0, 100, 4_080, 4_095, u16::MAX] {
            assert_eq!(seen(ad), None, "{ad}");
        }
    }

    #[test]
    fn a_reading_nearer_than_10_cm_frees_nothing() {
        let seen = seen(infrared_ad(0.095)).unwrap();
        assert_eq!(seen.clear_m, 0.0);
        assert!(seen.hit_m.is_some());
    }
}
