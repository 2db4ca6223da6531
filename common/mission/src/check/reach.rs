//! Checks that known shapes and zones leave the body a path to a target.

use std::{
    cmp::Reverse,
    collections::{BinaryHeap, HashSet},
};

use glam::DVec2;

use crate::Mission;

const MOST_DISTANCES: usize = 10_000_000;

/// Returns whether the start and `target` are disconnected; false if the search exceeds its limit.
///
/// Best-first search from the target over cells of half a radius, blocked only if the body fits
/// nowhere in them.
pub(super) fn is_cut_off(mission: &Mission, target: DVec2) -> bool {
    let corners: usize = mission.zones.iter().map(|zone| zone.points.len()).sum();
    let shapes = mission.known.pieces().count() + corners;
    if shapes == 0 {
        return false;
    }
    let radius = mission.body().radius_m;
    let step = radius / 2.0;
    let place = |(column, row): (i32, i32)| target + step * DVec2::new(column.into(), row.into());
    let is_free = |cell| {
        let at = place(cell);
        let zones = mission.zones.iter().map(|zone| zone.clearance(at));
        let clearance = zones.fold(mission.known.clearance(at), f64::min);
        // Within the cell, clearance grows by at most the distance to its corner.
        mission.contains(at) && clearance + step * std::f64::consts::FRAC_1_SQRT_2 > radius
    };
    let steps_off = |cell| (mission.start.at.distance(place(cell)) / step) as u64;
    let mut seen = HashSet::from([(0, 0)]);
    let mut next = BinaryHeap::from([Reverse((steps_off((0, 0)), (0, 0)))]);
    while let Some(Reverse((steps, (column, row)))) = next.pop() {
        if steps <= 1 || seen.len() > MOST_DISTANCES / shapes {
            return false;
        }
        for (right, up) in (-1..=1).flat_map(|right| (-1..=1).map(move |up| (right, up))) {
            let cell = (column + right, row + up);
            if seen.insert(cell) && is_free(cell) {
                next.push(Reverse((steps_off(cell), cell)));
            }
        }
    }
    true
}
