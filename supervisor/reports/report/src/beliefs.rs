//! Map and field at a few moments of a run. The field is computed; recordings omit it by default.

use common::{mission::Mission, samples::GridHeader};
use glam::DVec2;
use page::blob;
use planner::step::Planner;
use robot_state::drop_every_second;

/// Maximum maps. Beyond it, every second one is dropped, and sampling halves.
const MOST: usize = 8;
/// First period of maps, seconds of mission time.
const FIRST_APART_S: f64 = 2.0;
/// Most cells of a map whose field is computed.
const LARGEST: usize = 1024 * 1024;

#[derive(Clone)]
struct Belief {
    time_s: f64,
    header: GridHeader,
    /// Map cells, one [`common::grid::CellState`] byte each, row-major.
    cells: Vec<u8>,
    target: DVec2,
}

impl Belief {
    /// Returns the map's field as a message of the page, as the planner computes it.
    fn field(&self, mission: &Mission) -> Option<Vec<u8>> {
        let cells = Planner::field_to(self.target, mission, &self.header, &self.cells)?;
        let frame = self.header.part.frame();
        Some(blob::field(blob::Shown::Field, frame, &cells, self.target, self.time_s))
    }
}

pub(crate) struct Beliefs {
    held: Vec<Belief>,
    apart_s: f64,
}

impl Default for Beliefs {
    fn default() -> Self {
        Self { held: Vec::new(), apart_s: FIRST_APART_S }
    }
}

impl Beliefs {
    pub(crate) fn push(&mut self, time_s: f64, target: DVec2, header: &GridHeader, cells: &[u8]) {
        if self.held.last().is_some_and(|last| time_s < last.time_s + self.apart_s) {
            return;
        }
        if self.held.len() == MOST {
            drop_every_second(&mut self.held);
            self.apart_s *= 2.0;
            assert!(self.held.len() < MOST);
        }
        self.end(time_s, target, header, cells);
    }

    pub(crate) fn end(&mut self, time_s: f64, target: DVec2, header: &GridHeader, cells: &[u8]) {
        if cells.len() <= LARGEST {
            self.held.push(Belief { time_s, header: *header, cells: cells.to_vec(), target });
        }
    }

    pub(crate) fn fields(&self, mission: &Mission) -> impl Iterator<Item = Vec<u8>> {
        self.held.iter().filter_map(|belief| belief.field(mission))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use common::grid::Part;

    #[test]
    fn of_a_long_run_a_bounded_number_of_maps_is_held_and_they_are_spread_over_it() {
        let mission = Mission::parse("target = [4.0, 0.0]", "test.toml").unwrap();
        let frame = mission.grid_frame();
        let header = GridHeader { part: Part::whole(frame, 1), ..GridHeader::default() };
        let cells = vec![0; frame.area()];
        let mut beliefs = Beliefs::default();
        for second in 0..1000 {
            beliefs.push(f64::from(second), DVec2::X, &header, &cells);
            assert!(beliefs.held.len() <= MOST);
        }
        let times: Vec<_> = beliefs.held.iter().map(|belief| belief.time_s).collect();
        assert!(times.len() > 3 && times[0] < 10.0, "{times:?}");
        let apart = times.windows(2).map(|pair| pair[1] - pair[0]);
        assert!(apart.clone().fold(0.0, f64::max) <= 260.0, "{times:?}");
        assert!(beliefs.held[0].field(&mission).is_some());
    }
}
