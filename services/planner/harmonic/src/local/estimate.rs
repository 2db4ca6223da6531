//! Error estimate of a local update: how far off directions outside its window are.

use super::window::Window;
use crate::patch::Rim;

/// What the solution of a window tells of the field outside it.
#[derive(Clone, Debug)]
pub(super) struct ErrorEstimate {
    /// Estimated error of the directions beyond the rim, radians.
    pub angle: f64,
    /// The same for the inflow rim alone; directions inside the window are wrong by as much.
    pub upstream: f64,
    /// The smallest and the largest ratio of u after to u before on the outflow rim.
    pub outflow_ratio: (f64, f64),
    /// What is kept of the rim with the patch.
    pub rim: Rim,
}

/// The estimate for a window that was just solved.
pub(super) fn estimate(window: &Window) -> ErrorEstimate {
    let mut found = ErrorEstimate {
        angle: 0.0,
        upstream: 0.0,
        outflow_ratio: (f64::INFINITY, 0.0),
        rim: Rim::default(),
    };
    let mut largest = 0.0_f32;
    // The largest tangent of an angle; its arc is taken once, at the end.
    let (mut slope, mut upstream) = (0.0_f64, 0.0_f64);
    for &f in &window.rim {
        if window.before[f] <= 0.0 {
            // A freed cell now connects the window to cells whose u was too far from its own for them to be unknowns.
            found.outflow_ratio.1 = found.outflow_ratio.1.max(opening_ratio(window, f));
            continue;
        }
        let ratio = f64::from(window.after[f]) / f64::from(window.before[f]);
        let scale = 1.0 / (steepness(window, f) * ratio.max(f64::MIN_POSITIVE));
        for o in window.outside(f).filter(|&o| window.before[o] > 0.0) {
            if window.flows_out(f, o) {
                found.outflow_ratio = (
                    found.outflow_ratio.0.min(ratio),
                    found.outflow_ratio.1.max(ratio),
                );
                found.rim.deviation = found.rim.deviation.max((ratio - 1.0).abs());
                largest = largest.max(window.before[f]);
                for next in along_rim(window, f, o) {
                    if window.before[next] > 0.0 && window.after[next] > 0.0 {
                        let other = f64::from(window.after[next]) / f64::from(window.before[next]);
                        slope = slope.max((ratio - other).abs() * scale);
                    }
                }
                if window.after[f] < window.before[o] {
                    found.rim.entries.push(window.map_cell(o));
                }
            } else {
                upstream = upstream.max((1.0 - ratio).abs() * scale);
            }
        }
    }
    found.angle = slope.max(upstream).atan();
    found.upstream = upstream.atan();
    found.rim.upstream = found.upstream;
    found.rim.largest = window.scaled(largest);
    found
}

/// u of the freed cell `f` over the smallest u before of the cells outside it: u there came by another way.
fn opening_ratio(window: &Window, f: usize) -> f64 {
    let beyond = window.outside(f).map(|o| window.before[o]);
    let least = beyond.filter(|&u| u > 0.0).reduce(f32::min);
    least.map_or(0.0, |least| f64::from(window.after[f]) / f64::from(least))
}

/// The neighbours of `f` along the rim, across from `o` outside.
fn along_rim(window: &Window, f: usize, o: usize) -> [usize; 2] {
    if f.abs_diff(o) == 1 {
        [f - window.stride, f + window.stride]
    } else {
        [f - 1, f + 1]
    }
}

/// |gradient of ln u| before the change.
fn steepness(window: &Window, f: usize) -> f64 {
    let u = |at: usize| f64::from(window.before[at]) / f64::from(window.before[f]);
    let (x, y) = (
        0.5 * (u(f + 1) - u(f - 1)),
        0.5 * (u(f + window.stride) - u(f - window.stride)),
    );
    x.hypot(y).max(1e-6)
}
