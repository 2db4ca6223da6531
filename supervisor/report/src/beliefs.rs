//! The map at a few moments of a run, and the field of each. Fields are computed, because recordings contain none by default.

use common::{
    clock::MissionTime,
    grid::{GridFrame, Part, Replica},
    mission::Mission,
    samples::{FieldCell, GridHeader},
    step::Step as _,
};
use planner::step::{Input, Planner};

use recording::downsampled::drop_every_second;

/// Most maps. When there are more, every second one is dropped, and from then on half as many are taken.
const MOST: usize = 8;
/// First period of maps, seconds of mission time.
const FIRST_APART_S: f64 = 2.0;
/// Cells of a map beyond which it is drawn only at the end, without its field.
const LARGEST: usize = 1024 * 1024;

#[derive(Clone, Debug)]
pub(crate) struct Belief {
    pub(crate) time_s: f64,
    header: GridHeader,
    pub(crate) frame: GridFrame,
    /// One [`common::grid::CellState`] byte a cell, row-major.
    pub(crate) cells: Vec<u8>,
}

impl Belief {
    /// The map of `grid` with its newest `header`; none before the first keyframe.
    pub(crate) fn of(header: &GridHeader, grid: &Replica<u8>) -> Option<Self> {
        let frame = grid.frame()?;
        let part = Part::whole(frame, grid.version());
        Some(Self {
            time_s: header.stamp.time().seconds(),
            header: GridHeader { part, ..*header },
            frame,
            cells: grid.cells().to_vec(),
        })
    }

    /// Its field, row-major, as the planner computes it; none if there is none, or if the map is too large.
    pub(crate) fn field(&self, mission: &Mission) -> Option<Vec<FieldCell>> {
        if self.cells.len() > LARGEST {
            return None;
        }
        let mut planner = Planner::new(mission);
        let input = Input::Grid { header: &self.header, cells: &self.cells };
        planner.step(input, MissionTime::default()).ok()?;
        planner.snapshot().map(|snapshot| snapshot.cells())
    }
}

/// Maps at about equal intervals.
#[derive(Clone, Debug)]
pub(crate) struct Beliefs {
    kept: Vec<Belief>,
    apart_s: f64,
}

impl Default for Beliefs {
    fn default() -> Self {
        Self { kept: Vec::new(), apart_s: FIRST_APART_S }
    }
}

impl Beliefs {
    /// The map is now `grid`.
    pub(crate) fn push(&mut self, header: &GridHeader, grid: &Replica<u8>) {
        let time_s = header.stamp.time().seconds();
        let is_due = self.kept.last().is_none_or(|last| time_s >= last.time_s + self.apart_s);
        if !is_due || grid.cells().len() > LARGEST {
            return;
        }
        if self.kept.len() == MOST {
            drop_every_second(&mut self.kept);
            self.apart_s *= 2.0;
        }
        self.kept.extend(Belief::of(header, grid));
    }

    /// The maps nearest to a quarter, half and three quarters of a run that ended at `end_s`.
    pub(crate) fn on_the_way(&self, end_s: f64) -> Vec<&Belief> {
        let mut chosen: Vec<&Belief> = Vec::new();
        for share in [0.25, 0.5, 0.75] {
            let off = |belief: &&Belief| (belief.time_s - share * end_s).abs();
            let nearest = self.kept.iter().min_by(|one, other| off(one).total_cmp(&off(other)));
            // In a short run one map may be nearest twice.
            chosen.extend(
                nearest.filter(|nearest| {
                    chosen.last().is_none_or(|last| last.time_s < nearest.time_s)
                }),
            );
        }
        chosen
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use common::bus::Stamp;

    #[test]
    fn of_a_long_run_a_bounded_number_of_maps_is_kept_and_those_shown_are_spread_over_it() {
        let mission = Mission::parse("target = [4.0, 0.0]", "test.toml".as_ref()).unwrap();
        let frame = mission.grid_frame();
        let mut grid = Replica::default();
        let part = Part::whole(frame, 1);
        grid.apply(&part, &vec![0; frame.area()]);
        let mut beliefs = Beliefs::default();
        for second in 0..1000_u64 {
            let header = GridHeader {
                stamp: Stamp { stamp_ns: second * 1_000_000_000, ..Stamp::default() },
                ..GridHeader::default()
            };
            beliefs.push(&header, &grid);
            assert!(beliefs.kept.len() <= MOST);
        }
        let times: Vec<f64> =
            beliefs.on_the_way(1000.0).iter().map(|belief| belief.time_s).collect();
        assert_eq!(times.len(), 3, "{times:?}");
        for (time, wanted) in times.iter().zip([250.0, 500.0, 750.0]) {
            assert!((time - wanted).abs() <= 130.0, "{times:?}");
        }
        assert!(beliefs.kept[0].field(&mission).is_some());
    }
}
