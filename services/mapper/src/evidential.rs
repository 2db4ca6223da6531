//! Evidential map: evidence converted to hazard and scanned ground.
//!
//! Cells within reach of an occupied cell are forbidden to the body's centre.

use common::{
    grid::{Cell, CellState, GridFrame, Window},
    mission::{Mission, SensorKind},
    stage::ForeignState,
};
use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{
    clear_beams::ClearBeams,
    evidence_grid::{EvidenceGrid, Flip, Ground, STEP_M, lattice},
    reading::{Fan, Ray, Reading, Touch},
    sonar_model::NEAR_M,
};

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct EvidenceMap {
    /// Grid of the first laser; without lasers, of all sensors.
    evidence: EvidenceGrid,
    /// Grids of further lasers, then of sonars and infrared rangers beside lasers: a laser looks
    /// over or through what they see.
    others: Vec<EvidenceGrid>,
    pub beams: ClearBeams,
    /// Number of occupied lattice cells within reach of each grid cell, row-major; recomputed and
    /// so unsaved.
    #[serde(skip)]
    within_reach: Vec<u16>,
}

impl EvidenceMap {
    fn grids(&mut self) -> impl Iterator<Item = &mut EvidenceGrid> {
        std::iter::once(&mut self.evidence).chain(&mut self.others)
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Evidential {
    grid: GridFrame,
    /// Maximum centre distance that an occupied cell blocks, metres.
    pub reach: f64,
    ground: Ground,
    /// Lattice column under each grid column's middle; rows are equal, as both are square with one
    /// centre.
    under: Vec<Option<u32>>,
    map_within: f64,
    sonars: usize,
    lasers: Vec<usize>,
    beside_laser: bool,
}

impl Evidential {
    pub(crate) fn new(mission: &Mission) -> Self {
        let grid = mission.grid_frame();
        let disc = mission.body().radius_m;
        let [body, radius] = mission
            .outline()
            .map_or([disc; 2], |outline| [outline.half_widths_m()[0], outline.inscribed_m()]);
        // A position is up to half a cell off the cell's centre.
        let reach = body + mission.mapper.clearance_m + grid.resolution_m / 2.0;
        let lasers = mission.lasers().into_iter().filter(|(_, laser)| laser.used);
        let lasers: Vec<_> = lasers.map(|(row, _)| row).collect();
        let [sonars, rays] = [SensorKind::Cone, SensorKind::Ray].map(|kind| mission.used(kind));
        assert!(radius > 0.0 && reach > 0.0);
        let lattice = lattice(mission, reach);
        let under = |along| lattice.cell_at(grid.centre_of(Cell { col: along, row: along }));
        Self {
            under: (0..grid.cells).map(|along| under(along).map(|cell| cell.col)).collect(),
            grid,
            reach,
            ground: Ground { lattice, radius },
            map_within: mission.map_within_m(),
            sonars,
            beside_laser: !lasers.is_empty() && sonars + rays > 0,
            lasers,
        }
    }

    pub(crate) fn empty(&self) -> EvidenceMap {
        let evidence = EvidenceGrid::new(self.ground);
        EvidenceMap {
            others: vec![evidence.clone(); self.others()],
            evidence,
            beams: ClearBeams::default(),
            within_reach: vec![0; self.grid.area()],
        }
    }

    fn further_lasers(&self) -> usize {
        self.lasers.len().saturating_sub(1)
    }

    fn others(&self) -> usize {
        self.further_lasers() + usize::from(self.beside_laser)
    }

    pub(crate) fn saved_bytes(&self) -> usize {
        4 * (1 + self.others()) * self.ground.lattice.area() + ClearBeams::SAVED_BYTES + 128
    }

    /// Completes a restored map; fails for another mission's.
    pub(crate) fn complete(&self, map: &mut EvidenceMap) -> Result<(), ForeignState> {
        let lattice = self.ground.lattice;
        if map.others.len() != self.others() || !map.grids().all(|grid| grid.fits(&lattice)) {
            return Err(ForeignState);
        }
        map.within_reach = vec![0; self.grid.area()];
        for grid in map.grids() {
            grid.ground = self.ground;
            let occupied =
                lattice.whole().cells().filter(|it| grid.is_occupied(lattice.index(*it)));
            grid.news.flips = occupied.map(|cell| Flip { cell, occupied: true }).collect();
        }
        self.follow(map);
        Ok(())
    }

    /// Applies scans by laser row, and readings of a robot with wheel travel before and now.
    /// Returns the window that may have changed, and whether there is a new obstacle.
    pub(crate) fn take<'a>(
        &self,
        map: &mut EvidenceMap,
        robot: DVec2,
        [before_m, rolled_m]: [f64; 2],
        (scans, rays, beams): (
            impl Iterator<Item = (usize, Fan<'a>)>,
            impl Iterator<Item = Ray>,
            impl Iterator<Item = Reading>,
        ),
    ) -> (Window, bool) {
        assert!(rolled_m >= before_m || rolled_m.is_nan());
        assert_eq!(map.others.len(), self.others());
        assert_eq!(map.within_reach.len(), self.grid.area());
        let steps = (rolled_m / STEP_M).floor() - (before_m / STEP_M).floor();
        if steps >= 1.0 {
            let by_lasers = map.grids().take(1 + self.further_lasers());
            by_lasers.for_each(|grid| grid.grow_stale(steps as u8));
        }
        // Scans and rays come first, because they explain echoes.
        for (row, fan) in scans {
            match self.lasers.iter().position(|laser| *laser == row) {
                Some(0) => map.evidence.take_scan(&fan, robot, None),
                Some(further) => {
                    map.others[further - 1].take_scan(&fan, robot, Some(&map.evidence));
                }
                None => {}
            }
        }
        let (grid, by_lasers): (_, Vec<&EvidenceGrid>) = match map.others.split_last_mut() {
            Some((own, further)) if self.beside_laser => {
                (own, std::iter::once(&map.evidence).chain(&*further).collect())
            }
            _ => (&mut map.evidence, Vec::new()),
        };
        for ray in rays {
            map.beams.take_ray(&ray, rolled_m);
            grid.take_ray(&ray, robot);
        }
        for reading in beams {
            map.beams.take(self.sonars, &reading, rolled_m);
            let seen = by_lasers.iter().copied().find(|seen| seen.explains(&reading));
            grid.take(&reading, self.map_within, seen, robot);
        }
        self.follow(map)
    }

    pub(crate) fn touch(&self, map: &mut EvidenceMap, touch: &Touch) -> Window {
        map.evidence.touch(touch);
        self.follow(map).0
    }

    pub(crate) fn forget(&self, map: &mut EvidenceMap, steps: i8) -> Window {
        map.grids().for_each(|grid| grid.forget(steps));
        self.follow(map).0
    }

    /// Returns the same as [`Evidential::take`].
    fn follow(&self, map: &mut EvidenceMap) -> (Window, bool) {
        let mut window = Window::default();
        let mut is_new = false;
        let news: Vec<_> = map.grids().map(|grid| std::mem::take(&mut grid.news)).collect();
        for news in news {
            window = window.union(self.on_grid(news.window));
            for flip in news.flips {
                is_new |= flip.occupied;
                window = window.union(self.inflate(&mut map.within_reach, flip));
            }
        }
        (window, is_new)
    }

    fn inflate(&self, within_reach: &mut [u16], flip: Flip) -> Window {
        let Self { grid, reach, .. } = *self;
        let centre = self.ground.lattice.centre_of(flip.cell);
        let may_saturate = reach > 50.0 * self.ground.lattice.resolution_m;
        let mut window = Window::default();
        for cell in grid.around(centre, reach).cells() {
            if grid.centre_of(cell).distance(centre) <= reach {
                let count = &mut within_reach[grid.index(cell)];
                assert!(flip.occupied || *count > 0 || may_saturate);
                let change = if flip.occupied { 1 } else { -1 };
                *count = count.saturating_add_signed(change);
                window = window.including(cell);
            }
        }
        window
    }

    /// Drops evidence away from the robot, and every second time all of it, since it may be wrong.
    pub(crate) fn reset(&self, map: &mut EvidenceMap, robot: DVec2, epoch: u64) {
        let keep = if epoch % 2 == 1 { NEAR_M } else { 0.0 };
        map.beams = ClearBeams::default();
        map.grids().for_each(|grid| grid.reset(robot, keep));
        self.follow(map);
    }

    pub(crate) fn state(&self, map: &EvidenceMap, cell: Cell, is_target: bool) -> CellState {
        let lattice = self.ground.lattice;
        debug_assert!(cell.col < self.grid.cells && cell.row < self.grid.cells);
        let hazard = map.within_reach[self.grid.index(cell)] > 0 && !is_target;
        let under = |along: u32| self.under[along as usize];
        let under = under(cell.col).zip(under(cell.row)).map(|(col, row)| Cell { col, row });
        let further = map.others.iter().take(self.further_lasers());
        let mut by_lasers = std::iter::once(&map.evidence).chain(further);
        let is_scanned = |under| by_lasers.any(|grid| grid.is_scanned(lattice.index(under)));
        match (hazard, under.is_some_and(is_scanned)) {
            (true, true) => CellState::Margin,
            (true, false) => CellState::Sensed,
            (false, true) => CellState::Scanned,
            (false, false) => CellState::Free,
        }
    }

    fn on_grid(&self, window: Window) -> Window {
        if window.area() == 0 {
            return window;
        }
        assert!(self.ground.lattice.contains(window));
        let grid = self.grid;
        let lattice = self.ground.lattice;
        let last = Cell { col: window.col + window.width - 1, row: window.row + window.height - 1 };
        // A lattice cell acts up to half a cell of both grids beyond its centre.
        let more = 0.5 * (lattice.resolution_m + grid.resolution_m);
        let first = Cell { col: window.col, row: window.row };
        grid.between(lattice.centre_of(first) - more, lattice.centre_of(last) + more)
    }
}
