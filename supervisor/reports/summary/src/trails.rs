//! Tracks of movers in a run. Movers are anonymous, so each is joined to the track that leads to
//! it.

use common::samples::{GridHeader, Mover};
use glam::DVec2;

/// Greatest distance between a mover and its track's extrapolation, metres, and longest gap,
/// seconds.
const NEAR_M: f64 = 0.6;
const LOST_S: f64 = 2.0;
/// Maximum uncertainty of a recorded place, metres; a less certain mover is out of sight.
const SURE_M: f64 = 0.2;
/// First interval of places, seconds. Too long tracks drop every second place; too many tracks, the
/// oldest.
const APART_S: f64 = 0.2;
const MOST_PLACES: usize = 600;
const MOST_WAYS: usize = 256;

#[derive(Debug)]
pub struct Trail {
    /// Mission times, seconds, and places, metres; never empty.
    pub places: Vec<(f64, DVec2)>,
    pub radius_m: f64,
    newest: (f64, DVec2, DVec2),
    apart_s: f64,
}

impl Trail {
    fn begin(at_s: f64, mover: &Mover) -> Self {
        let newest = (at_s, mover.place(), mover.velocity());
        let places = vec![(at_s, mover.place())];
        Self { places, radius_m: mover.radius_m.into(), newest, apart_s: APART_S }
    }

    /// Returns the distance of `mover` from the track's extrapolation to `at_s`; `None` if the
    /// track ended or is too far off.
    fn off_m(&self, at_s: f64, mover: &Mover) -> Option<f64> {
        let (then_s, at, velocity) = self.newest;
        let is_open = at_s > then_s && at_s <= then_s + LOST_S;
        let off_m = (at + (at_s - then_s) * velocity).distance(mover.place());
        (is_open && off_m <= NEAR_M).then_some(off_m)
    }

    fn go_on(&mut self, at_s: f64, mover: &Mover) {
        self.newest = (at_s, mover.place(), mover.velocity());
        self.radius_m = mover.radius_m.into();
        if self.places.last().is_some_and(|(then_s, _)| at_s < then_s + self.apart_s) {
            return;
        }
        if self.places.len() == MOST_PLACES {
            robot_state::drop_every_second(&mut self.places);
            self.apart_s *= 2.0;
        }
        self.places.push((at_s, mover.place()));
        assert!(self.places.len() <= MOST_PLACES);
    }
}

#[derive(Default)]
pub(crate) struct Trails(pub(crate) Vec<Trail>);

impl Trails {
    pub(crate) fn hear(&mut self, grid: &GridHeader) {
        let at_s = grid.stamp.seconds();
        for mover in grid.drawn_movers().filter(|it| f64::from(it.doubt_m) <= SURE_M) {
            let near = self.0.iter_mut().filter_map(|it| Some((it.off_m(at_s, mover)?, it)));
            match near.min_by(|one, other| one.0.total_cmp(&other.0)) {
                Some((_, trail)) => trail.go_on(at_s, mover),
                None => {
                    if self.0.len() == MOST_WAYS {
                        self.0.remove(0);
                    }
                    self.0.push(Trail::begin(at_s, mover));
                    assert!(self.0.len() <= MOST_WAYS);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use common::samples::Stamp;

    fn sample(at_s: f64, places: &[[f32; 2]], velocity: f32) -> GridHeader {
        let stamp = Stamp { stamp_ns: (at_s * 1e9) as u64, ..Stamp::default() };
        let mut header =
            GridHeader { stamp, mover_count: places.len() as u64, ..Default::default() };
        for (mover, &[x_m, y_m]) in header.movers.iter_mut().zip(places) {
            *mover = Mover { x_m, y_m, vx_m_s: velocity, radius_m: 0.25, ..Mover::default() };
        }
        header
    }

    #[test]
    fn what_passes_something_else_keeps_its_way_whatever_their_order_in_the_samples() {
        let mut trails = Trails::default();
        for tick in 0..100 {
            let way = tick as f32 * 0.1;
            let both = [[way, 0.0], [way, 1.0]];
            let order = if tick % 2 == 0 { both } else { [both[1], both[0]] };
            trails.hear(&sample(f64::from(tick) * 0.1, &order, 1.0));
        }
        let rows = trails.0.iter().map(|it| {
            assert!(it.places.iter().all(|(_, at)| at.y == it.places[0].1.y), "{it:?}");
            it.places.last().unwrap().1.x > 9.0
        });
        assert_eq!(rows.collect::<Vec<_>>(), [true, true]);
        trails.hear(&sample(30.0, &[[9.9, 0.0]], 1.0));
        assert_eq!(trails.0.len(), 3);
    }

    #[test]
    fn ways_and_their_places_are_bounded_in_a_run_without_end() {
        let mut trails = Trails::default();
        for tick in 0..20_000 {
            let crowd = [[0.0, 0.0], [10.0 + 3.0 * tick as f32, 0.0]];
            trails.hear(&sample(f64::from(tick) * 0.2, &crowd, 0.0));
            assert!(trails.0.len() <= MOST_WAYS);
            assert!(trails.0.iter().all(|it| it.places.len() <= MOST_PLACES));
        }
    }
}
