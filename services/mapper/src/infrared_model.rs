//! Infrared model: a ranger's voltage as evidence along its ray.
//!
//! A ranger triangulates a small spot 10 to 80 cm ahead, at any angle of the surface. Its voltage
//! grows with 1 / range, so range noise grows with the square. Below 10 cm the voltage falls again:
//! the obstacle is near at an unknown distance.

use common::{
    samples::{RangeReading, RangeStatus},
    wire::infrared_ad,
};

/// Reading below which the obstacle may be nearer.
const UNAMBIGUOUS_M: f64 = 0.10;
/// Maximum range of a hit: a ranger that sees nothing can read more.
const HIT_WITHIN_M: f64 = 0.70;
/// Standard deviation, AD counts. Nominal: three times that of the AD converter.
const NOISE_AD: f64 = 15.0;
/// Deviations before the reading at which the free ray ends.
const SURE_DEVIATIONS: f64 = 2.0;
/// Formula error of a single ranger; it shortens the free ray.
const FORMULA_M: f64 = 0.02;

/// Half the width that a ray scans. The spot is some centimetres wide, and a moving robot's next
/// ray meets an obstacle beside it. Nominal.
pub(crate) const SCANNED_ASIDE_M: f64 = 0.04;

#[derive(Debug, PartialEq)]
pub(crate) struct Seen {
    /// Free length; at most 0.72.
    pub clear_m: f64,
    pub hit_m: Option<f64>,
}

/// Interprets a reading up to `reach_m`; none if the ranger may be dead or saturated.
pub(crate) fn seen(reading: &RangeReading, reach_m: f64) -> Option<Seen> {
    let range_m = match reading.status() {
        RangeStatus::Measured if reading.range_m > 0.0 => reading.range_m,
        RangeStatus::Nothing => reach_m,
        _ => return None,
    };
    let is_hit = range_m <= HIT_WITHIN_M && range_m < reach_m;
    let range_m = range_m.min(reach_m);
    let ambiguous = range_m < UNAMBIGUOUS_M;
    let clear_m = range_m - SURE_DEVIATIONS * deviation_m(range_m) - FORMULA_M;
    Some(Seen {
        clear_m: if ambiguous { 0.0 } else { clear_m.max(0.0) },
        hit_m: is_hit.then_some(range_m),
    })
}

fn deviation_m(range_m: f64) -> f64 {
    // Counts are a / range + b; the formula at two ranges gives `a`.
    let near = f64::from(infrared_ad(0.2));
    let far = f64::from(infrared_ad(0.4));
    let counts_metres = (near - far) / (1.0 / 0.2 - 1.0 / 0.4);
    assert!(counts_metres > 0.0, "nearer reads more");
    NOISE_AD * range_m * range_m / counts_metres
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reads(status: RangeStatus, range_m: f64, reach_m: f64) -> Option<Seen> {
        let status = status.into();
        seen(&RangeReading { range_m, status, ..RangeReading::default() }, reach_m)
    }

    #[test]
    fn a_ray_is_free_to_less_than_the_reading_the_less_the_farther_and_nearer_than_10_cm_to_nothing()
     {
        for (range, clear, hit) in [
            (0.095, 0.0, true),
            (0.2, 0.176, true),
            (0.5, 0.454, true),
            (0.7, 0.629, true),
            (0.81, 0.722, false),
        ] {
            let seen = reads(RangeStatus::Measured, range, 0.81).unwrap();
            assert!((seen.clear_m - clear).abs() < 0.003, "{range} m: {seen:?}");
            assert_eq!(seen.clear_m == 0.0, clear == 0.0, "{range} m: {seen:?}");
            let near = seen.hit_m.is_some_and(|hit| (hit - range).abs() < 0.002);
            assert_eq!(near, hit, "{range} m: {seen:?}");
        }
    }

    #[test]
    fn a_ray_counts_no_further_than_the_reach_of_its_row() {
        let seen = reads(RangeStatus::Measured, 0.6, 0.5).unwrap();
        assert!(seen.hit_m.is_none() && seen.clear_m < 0.5, "{seen:?}");
        assert_eq!(reads(RangeStatus::Absent, 0.6, 0.81), None);
    }
}
