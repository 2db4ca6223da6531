//! Shares, differences of shares and their confidence intervals; medians and means.

use serde::Serialize;

/// Quantile of the normal distribution for 95 %.
const Z: f64 = 1.959_963_984_540_054;

/// Returns the share, and the ends of Wilson's interval (Wilson 1927).
pub fn share(hits: usize, n: usize) -> [f64; 3] {
    if n == 0 {
        return [f64::NAN, 0.0, 1.0];
    }
    let (hits, n) = (hits as f64, n as f64);
    let value = hits / n;
    let z2 = Z * Z;
    let middle = (value + z2 / (2.0 * n)) / (1.0 + z2 / n);
    let half = Z / (1.0 + z2 / n) * (value * (1.0 - value) / n + z2 / (4.0 * n * n)).sqrt();
    [value, (middle - half).max(0.0), (middle + half).min(1.0)]
}

/// Returns the difference of two shares on the same `n` worlds, and the ends of its interval.
/// `gained` worlds count only in the second setting, `lost` only in the first. Uses Wald's interval
/// with half a pair added to each cell (Agresti and Min 2005).
pub fn paired_difference(gained: usize, lost: usize, n: usize) -> [f64; 3] {
    let (gained, lost, n) = (gained as f64, lost as f64, n as f64);
    let value = if n > 0.0 { (gained - lost) / n } else { f64::NAN };
    let (gained, lost, n) = (gained + 0.5, lost + 0.5, n + 2.0);
    let middle = (gained - lost) / n;
    let half = Z * (gained + lost - (gained - lost).powi(2) / n).sqrt() / n;
    [value, (middle - half).max(-1.0), (middle + half).min(1.0)]
}

pub fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    Some(Spread::of(values)?.median)
}

#[derive(Debug, PartialEq, Serialize)]
pub struct Spread {
    pub low: f64,
    pub median: f64,
    pub high: f64,
}

impl Spread {
    pub fn of(values: impl Iterator<Item = f64>) -> Option<Self> {
        let mut values: Vec<f64> = values.collect();
        values.sort_by(f64::total_cmp);
        let last = values.len().checked_sub(1)?;
        let at = |share: f64| {
            let place = share * last as f64;
            let (below, above) = (values[place.floor() as usize], values[place.ceil() as usize]);
            below + (above - below) * place.fract()
        };
        Some(Self { low: at(0.25), median: at(0.5), high: at(0.75) })
    }
}

pub fn rounded(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}

pub fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, n) = values.fold((0.0, 0.0), |(sum, n), value| (sum + value, n + 1.0));
    (n > 0.0).then_some(sum / n)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(found: [f64; 3], low: f64, high: f64) {
        assert!((found[1] - low).abs() < 5e-4, "{found:?}");
        assert!((found[2] - high).abs() < 5e-4, "{found:?}");
    }

    #[test]
    fn wilsons_interval_is_that_of_its_tables() {
        close(share(0, 10), 0.0, 0.2775);
        close(share(81, 263), 0.2553, 0.3662);
    }

    #[test]
    fn a_paired_difference_depends_on_the_worlds_that_differ_alone() {
        let [value, low, high] = paired_difference(12, 4, 100);
        assert_eq!(value, 0.08);
        assert!(low > 0.0 && high < 0.17, "{low} to {high}");
        let [_, low, high] = paired_difference(0, 0, 100);
        assert!(low < 0.0 && high > 0.0, "{low} to {high}");
    }

    #[test]
    fn a_spread_holds_the_middle_half() {
        let spread = Spread::of([5.0, 1.0, 2.0, 4.0, 3.0].into_iter());
        assert_eq!(spread, Some(Spread { low: 2.0, median: 3.0, high: 4.0 }));
        assert_eq!(Spread::of(std::iter::empty()), None);
    }

    #[test]
    fn medians_and_means_of_nothing_are_none() {
        assert_eq!(median([4.0, 1.0].into_iter()), Some(2.5));
        assert_eq!(median(std::iter::empty()), None);
        assert_eq!(mean(std::iter::empty()), None);
    }
}
