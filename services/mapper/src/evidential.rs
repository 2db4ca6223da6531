//! The evidential map: evidence turned into hazard and scanned ground.

use common::{
    grid::{Cell, CellState, Window},
    mission::Mission,
    step::ForeignState,
};
use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{
    clear_beams::ClearBeams,
    evidence_grid::{EvidenceGrid, Flip, lattice, step_m},
    inflation::{Geometry, Inflation},
    reading::{Fan, Ray, Reading, Rows, Touch},
    sonar_model::SonarModel,
};

/// The evidence, and the cells that it forbids to the body's centre.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct EvidenceMap {
    evidence: EvidenceGrid,
    /// Evidence of sonars and infrared rangers beside a laser, which looks over or through things; none without both.
    unseen: Option<Box<EvidenceGrid>>,
    pub(crate) beams: ClearBeams,
    /// Recomputed from the evidence, so not saved.
    #[serde(skip)]
    inflation: Inflation,
}

#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Observed {
    pub(crate) window: Window,
    pub(crate) safety_event: bool,
}

#[derive(Clone, Debug)]
pub(crate) struct Evidential {
    sonar: SonarModel,
    geometry: Geometry,
    /// The lattice's column under the middle of each of the grid's; rows are the same, as both are square with one centre.
    under: Vec<Option<u32>>,
    radius: f64,
    map_within: f64,
    sonars: usize,
    beside_laser: bool,
}

impl Evidential {
    pub(crate) fn new(mission: &Mission) -> Self {
        let sonar = SonarModel::default();
        let grid = mission.grid_frame();
        let radius = mission.body().radius_m;
        // A position is up to half a cell off the centre that stands for it.
        let reach = radius + mission.mapper.clearance_m + grid.resolution_m / 2.0;
        let rows = Rows::new(mission);
        let lattice = lattice(&sonar, mission, reach);
        let under = |along| lattice.cell_at(grid.centre_of(Cell { col: along, row: along }));
        Self {
            sonar,
            under: (0..grid.cells).map(|along| under(along).map(|cell| cell.col)).collect(),
            geometry: Geometry { lattice, grid, reach },
            radius,
            map_within: mission.map_within_m(),
            sonars: rows.cones(),
            beside_laser: rows.are_beside_laser(),
        }
    }

    /// A surface blocks cells within this, metres.
    pub(crate) const fn reach(&self) -> f64 {
        self.geometry.reach
    }

    pub(crate) fn empty(&self) -> EvidenceMap {
        let evidence = EvidenceGrid::none(&self.geometry.lattice);
        EvidenceMap {
            unseen: self.beside_laser.then(|| Box::new(evidence.clone())),
            evidence,
            beams: ClearBeams::default(),
            inflation: Inflation::new(&self.geometry),
        }
    }

    pub(crate) const fn saved_bytes(&self) -> usize {
        let grids = if self.beside_laser { 2 } else { 1 };
        4 * grids * self.geometry.lattice.area() + ClearBeams::SAVED_BYTES + 128
    }

    /// Fails for the map of another mission.
    pub(crate) fn complete(&self, map: &mut EvidenceMap) -> Result<(), ForeignState> {
        let lattice = self.geometry.lattice;
        if map.unseen.is_some() != self.beside_laser {
            return Err(ForeignState);
        }
        map.inflation = Inflation::new(&self.geometry);
        for grid in std::iter::once(&map.evidence).chain(map.unseen.as_deref()) {
            if !grid.fits(&lattice) {
                return Err(ForeignState);
            }
            for row in 0..lattice.cells {
                for col in 0..lattice.cells {
                    let cell = Cell { col, row };
                    if grid.is_occupied(lattice.index(cell)) {
                        let occupied = true;
                        map.inflation.follow(&self.geometry, Flip { cell, occupied });
                    }
                }
            }
        }
        Ok(())
    }

    /// Take readings of a robot at `robot` whose wheels have rolled `rolled_m` metres.
    pub(crate) fn take(
        &self,
        map: &mut EvidenceMap,
        robot: DVec2,
        beams: impl Iterator<Item = Reading>,
        rays: impl Iterator<Item = Ray>,
        rolled_m: f64,
    ) -> Observed {
        let mut flips = Vec::new();
        let lattice = &self.geometry.lattice;
        let body = (robot, self.radius);
        let mut touched = Window::default();
        let (grid, by_laser) = match &mut map.unseen {
            Some(unseen) => (unseen.as_mut(), Some(&map.evidence)),
            None => (&mut map.evidence, None),
        };
        // Rays first: what they show explains echoes.
        for ray in rays {
            map.beams.take_ray(&self.sonar, &ray, rolled_m);
            let seen = grid.take_ray(&self.sonar, lattice, &ray, body, &mut flips);
            touched = touched.union(seen);
        }
        for reading in beams {
            map.beams.take(self.sonars, &reading, rolled_m);
            let seen = by_laser.filter(|seen| seen.explains(lattice, &reading));
            let beam = (&reading, self.map_within);
            let heard = grid.take(&reading.sonar, lattice, beam, seen, body, &mut flips);
            touched = touched.union(heard);
        }
        let window = self.follow(map, touched, &flips);
        Observed { window, safety_event: flips.iter().any(|flip| flip.occupied) }
    }

    pub(crate) fn take_scan(&self, map: &mut EvidenceMap, robot: DVec2, fan: &Fan<'_>) -> Observed {
        let mut flips = Vec::new();
        let lattice = &self.geometry.lattice;
        let body = (robot, self.radius);
        let touched = map.evidence.take_scan(&self.sonar, lattice, fan, body, &mut flips);
        let window = self.follow(map, touched, &flips);
        Observed { window, safety_event: flips.iter().any(|flip| flip.occupied) }
    }

    /// Returns the window that may look different now.
    pub(crate) fn touch(&self, map: &mut EvidenceMap, touch: &Touch) -> Window {
        let mut flips = Vec::new();
        let lattice = &self.geometry.lattice;
        let touched = map.evidence.touch(&self.sonar, lattice, touch, self.radius, &mut flips);
        self.follow(map, touched, &flips)
    }

    /// Inflate the flipped cells. Returns the grid's window that may look different, `touched` on the lattice included.
    fn follow(&self, map: &mut EvidenceMap, touched: Window, flips: &[Flip]) -> Window {
        let mut window = self.on_grid(touched);
        for flip in flips {
            window = window.union(map.inflation.follow(&self.geometry, *flip));
        }
        window
    }

    /// Age scanned ground as the wheels roll between these ways, metres. Returns the window that may have changed.
    pub(crate) fn roll(&self, map: &mut EvidenceMap, before: f64, now: f64) -> Window {
        let step_m = step_m(&self.sonar);
        let steps = (now / step_m).floor() - (before / step_m).floor();
        if steps < 1.0 {
            return Window::default();
        }
        let lattice = &self.geometry.lattice;
        self.on_grid(map.evidence.grow_stale(&self.sonar, lattice, steps as u8))
    }

    /// Drop all evidence that is not near the robot; every second reset drops that too, since it may be wrong.
    pub(crate) fn reset(&self, map: &mut EvidenceMap, robot: DVec2, epoch: u64) {
        let keep = if epoch % 2 == 1 { self.sonar.near_m } else { 0.0 };
        let mut flips = Vec::new();
        map.beams.clear();
        let lattice = &self.geometry.lattice;
        for grid in std::iter::once(&mut map.evidence).chain(map.unseen.as_deref_mut()) {
            grid.reset(&self.sonar, lattice, (robot, keep), &mut flips);
        }
        for flip in &flips {
            map.inflation.follow(&self.geometry, *flip);
        }
    }

    /// The evidence decides, of a cell neither known nor perimeter.
    pub(crate) fn state(&self, map: &EvidenceMap, cell: Cell, is_target: bool) -> CellState {
        let Geometry { lattice, grid, .. } = self.geometry;
        let hazard = map.inflation.is_hazard(grid.index(cell)) && !is_target;
        let under = |along: u32| self.under[along as usize];
        let under = under(cell.col).zip(under(cell.row)).map(|(col, row)| Cell { col, row });
        let is_scanned = |under| map.evidence.is_scanned(&self.sonar, lattice.index(under));
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
        let Geometry { lattice, grid, .. } = self.geometry;
        let last = DVec2::splat(f64::from(grid.cells) - 1.0);
        let corner = |col: u32, row: u32| {
            let point = lattice.centre_of(Cell { col, row });
            grid.to_cells(point).clamp(DVec2::ZERO, last)
        };
        // A lattice cell acts up to half of it, and half a grid cell, beyond its centre.
        let more = 0.5 * lattice.resolution_m / grid.resolution_m + 0.5;
        let from = (corner(window.col, window.row) - more).floor().max(DVec2::ZERO);
        let to = corner(window.col + window.width - 1, window.row + window.height - 1) + more;
        let to = to.ceil().min(last);
        Window::default()
            .including(Cell { col: from.x as u32, row: from.y as u32 })
            .including(Cell { col: to.x as u32, row: to.y as u32 })
    }
}
