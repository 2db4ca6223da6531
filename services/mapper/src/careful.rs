//! The careful method's map: evidence turned into hazard and swept ground.

use common::{
    grid::{Cell, CellState, GridFrame, Window},
    mission::Mission,
};
use glam::DVec2;

use crate::{
    dilation::Dilation,
    evidence::{Beam, Evidence, Flip, STALER_M, lattice},
};

/// What a robot that forgets keeps nevertheless: what stands so near that it may touch it, metres.
const KEPT_M: f64 = 0.6;

/// A reading of the sonar, where it was taken.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reading {
    /// The sensor, metres.
    pub(crate) origin: DVec2,
    /// Which way it looked: a unit vector.
    pub(crate) axis: DVec2,
    /// The echo's range, metres; none for silence.
    pub(crate) echo: Option<f64>,
}

/// What a reading brought.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct News {
    /// The cells of the grid that may look different now.
    pub(crate) window: Window,
    /// Whether something was heard where nothing was believed to stand.
    pub(crate) safety_event: bool,
}

/// How evidence becomes states of the grid's cells.
#[derive(Clone, Debug)]
pub(crate) struct Memory {
    grid: GridFrame,
    lattice: GridFrame,
    dilation: Dilation,
    radius: f64,
    reach: f64,
    map_within: f64,
    flips: Vec<Flip>,
}

impl Memory {
    /// For a mission's robot and grid.
    pub(crate) fn new(mission: &Mission) -> Self {
        let (grid, lattice) = (mission.grid_frame(), lattice(mission));
        let radius = mission.body().radius_m;
        // A position is up to half a cell off the centre that stands for it.
        let reach = radius + mission.mapper.clearance_m + grid.resolution_m / 2.0;
        Self {
            grid,
            lattice,
            dilation: Dilation::new(lattice, grid, reach),
            radius,
            reach,
            map_within: mission.mapper.map_within_m,
            flips: Vec::new(),
        }
    }

    /// How far a surface blocks the cells around it, metres.
    pub(crate) const fn reach(&self) -> f64 {
        self.reach
    }

    /// The evidence a mission starts with.
    pub(crate) fn unheard(&self) -> Evidence {
        Evidence::none(&self.lattice)
    }

    /// Bytes of the evidence when kept.
    pub(crate) const fn kept_bytes(&self) -> usize {
        4 * self.lattice.area() + 64
    }

    /// Go on from evidence that was kept; says whether it is of this map.
    pub(crate) fn restore(&mut self, evidence: &Evidence) -> bool {
        if !evidence.fits(&self.lattice) {
            return false;
        }
        self.dilation = Dilation::new(self.lattice, self.grid, self.reach);
        for row in 0..self.lattice.cells {
            for col in 0..self.lattice.cells {
                let cell = Cell { col, row };
                if evidence.is_occupied(self.lattice.index(cell)) {
                    self.dilation.follow(Flip {
                        cell,
                        occupied: true,
                    });
                }
            }
        }
        true
    }

    /// Take what was heard, if anything was said at all, by a robot at `robot`.
    pub(crate) fn take(
        &mut self,
        evidence: &mut Evidence,
        robot: DVec2,
        reading: Option<Reading>,
    ) -> News {
        let Some(reading) = reading else {
            return News::default();
        };
        let beam = Beam {
            origin: reading.origin,
            axis: reading.axis,
            echo: reading.echo,
            reach: self.map_within,
        };
        self.flips.clear();
        let touched = evidence.take(&self.lattice, &beam, (robot, self.radius), &mut self.flips);
        let mut window = self.on_grid(touched);
        for flip in &self.flips {
            window = united(window, self.dilation.follow(*flip));
        }
        News {
            window,
            safety_event: self.flips.iter().any(|flip| flip.occupied),
        }
    }

    /// The wheels have rolled from `before` to `now`, metres each since the start: the window of the grid that may look
    /// different now.
    pub(crate) fn roll(&self, evidence: &mut Evidence, before: f64, now: f64) -> Window {
        let steps = (now / STALER_M).floor() - (before / STALER_M).floor();
        if steps < 1.0 {
            return Window::default();
        }
        self.on_grid(evidence.grow_stale(&self.lattice, steps as u8))
    }

    /// Forget all but what is near the robot; every other time that as well, for it may be what is wrong.
    pub(crate) fn forget(&mut self, evidence: &mut Evidence, robot: DVec2, epoch: u64) {
        self.flips.clear();
        let keep = if epoch % 2 == 1 { KEPT_M } else { 0.0 };
        evidence.forget(&self.lattice, (robot, keep), &mut self.flips);
        for flip in &self.flips {
            self.dilation.follow(*flip);
        }
    }

    /// What is believed of a cell of the grid that is not fixed.
    pub(crate) fn state(&self, evidence: &Evidence, cell: Cell, is_target: bool) -> CellState {
        let hazard = self.dilation.is_hazard(self.grid.index(cell)) && !is_target;
        let under = self.lattice.cell_at(self.grid.centre_of(cell));
        let swept = under.is_some_and(|under| evidence.is_swept(self.lattice.index(under)));
        match (hazard, swept) {
            (true, true) => CellState::Margin,
            (true, false) => CellState::Sensed,
            (false, true) => CellState::Swept,
            (false, false) => CellState::Free,
        }
    }

    /// The window of the grid that shows a window of the lattice.
    fn on_grid(&self, window: Window) -> Window {
        if window.area() == 0 {
            return window;
        }
        let corner = |col: u32, row: u32| {
            let point = self.lattice.centre_of(Cell { col, row });
            let last = DVec2::splat(f64::from(self.grid.cells) - 1.0);
            self.grid.to_cells(point).clamp(DVec2::ZERO, last)
        };
        // A cell of the lattice shows as far as half of it, and half a cell of the grid, beyond its centre.
        let more = 0.5 * self.lattice.resolution_m / self.grid.resolution_m + 0.5;
        let last = DVec2::splat(f64::from(self.grid.cells) - 1.0);
        let from = (corner(window.col, window.row) - more)
            .floor()
            .max(DVec2::ZERO);
        let to = corner(
            window.col + window.width - 1,
            window.row + window.height - 1,
        ) + more;
        let to = to.ceil().min(last);
        Window::default()
            .including(Cell {
                col: from.x as u32,
                row: from.y as u32,
            })
            .including(Cell {
                col: to.x as u32,
                row: to.y as u32,
            })
    }
}

/// The smallest window that covers both.
pub(crate) fn united(a: Window, b: Window) -> Window {
    if b.area() == 0 {
        return a;
    }
    a.including(Cell {
        col: b.col,
        row: b.row,
    })
    .including(Cell {
        col: b.col + b.width - 1,
        row: b.row + b.height - 1,
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use common::samples::{PoseSample, RangeSample, RangeStatus, Stamp};

    use super::*;
    use crate::step::Mapper;

    /// Delta = 0.1 m, the origin in cell (25, 25). The sensor is 0.2 m ahead, the body's radius 0.19 m.
    fn mapper(extra: &str) -> Mapper {
        let text = format!(
            "target = [2, 0]\nperimeter = {{ width_m = 5, cells = 50 }}\nsonar = {{ forward_m = 0.2 }}\n{extra}"
        );
        Mapper::new(&Mission::parse(&text, Path::new("test.toml")).unwrap())
    }

    /// A robot at (x, 0) facing `heading` hears an echo, or nothing.
    fn hear(mapper: &mut Mapper, tick: u64, x: f64, heading: f64, echo: Option<f64>) -> Window {
        let stamp = Stamp {
            tick,
            ..Stamp::default()
        };
        let pose = PoseSample {
            stamp,
            x_m: x,
            heading_rad: heading,
            ..PoseSample::default()
        };
        let status = echo.map_or(RangeStatus::Nothing, |_| RangeStatus::Measured);
        let range = RangeSample {
            stamp,
            range_m: echo.unwrap_or_default(),
            status: status.into(),
            ..RangeSample::default()
        };
        mapper.step(&pose, Some(&range))
    }

    fn state(mapper: &Mapper, x: f64, y: f64) -> CellState {
        let cell = mapper.frame().cell_at(DVec2::new(x, y)).unwrap();
        CellState::from_byte(mapper.belief().cells()[mapper.frame().index(cell)])
    }

    #[test]
    fn a_hit_is_hazard_as_far_as_the_body_reaches_and_the_ground_before_it_is_swept() {
        let mut mapper = mapper("");
        hear(&mut mapper, 0, 0.0, 0.0, Some(0.7));
        // The hit is at 0.9; the body and its spare reach 0.22 m and half a cell around.
        assert!(state(&mapper, 0.9, 0.0).is_hazard());
        assert_eq!(state(&mapper, 0.7, 0.0), CellState::Margin);
        assert_eq!(state(&mapper, 0.5, 0.0), CellState::Swept);
        assert_eq!(state(&mapper, 0.5, 0.5), CellState::Free);
        assert_eq!(mapper.belief().safety_events(), 1);
    }

    #[test]
    fn a_false_echo_is_gone_after_a_silent_look_at_it() {
        let mut mapper = mapper("");
        hear(&mut mapper, 0, 0.0, 0.0, Some(0.4));
        assert!(state(&mapper, 0.6, 0.0).is_hazard());
        for tick in 1..=9 {
            let heading = 0.1 * (tick as f64 - 5.0);
            hear(&mut mapper, tick, 0.0, heading, None);
        }
        assert_eq!(state(&mapper, 0.6, 0.0), CellState::Swept);
    }

    #[test]
    fn silence_at_a_slant_does_not_take_back_what_was_heard_squarely() {
        let mut mapper = mapper("");
        for tick in 0..3 {
            hear(&mut mapper, tick, 0.0, 0.0, Some(0.7));
        }
        // From the other side of it: a smooth wall would say nothing there.
        for tick in 3..30 {
            hear(&mut mapper, tick, 1.9, std::f64::consts::PI, None);
        }
        assert!(state(&mapper, 0.9, 0.0).is_hazard());
    }

    #[test]
    fn a_well_known_thing_explains_the_echo_and_grows_no_wings() {
        let mut mapper = mapper("");
        for tick in 0..4 {
            hear(&mut mapper, tick, 0.0, 0.0, Some(0.7));
        }
        let hazards = |mapper: &Mapper| {
            let cells = mapper.belief().cells().iter();
            cells
                .filter(|&&cell| CellState::from_byte(cell).is_hazard())
                .count()
        };
        let before = hazards(&mapper);
        // Turned by the arc's half: its edge meets the thing, its middle meets nothing new.
        hear(&mut mapper, 4, 0.0, 0.25, Some(0.7));
        assert_eq!(hazards(&mapper), before);
    }

    #[test]
    fn an_echo_beyond_reach_is_not_mapped() {
        let mut mapper = mapper("");
        hear(&mut mapper, 0, 0.0, 0.0, Some(1.4));
        assert_eq!(mapper.belief().safety_events(), 0);
        assert_eq!(state(&mapper, 1.0, 0.0), CellState::Swept);
    }

    #[test]
    fn swept_ground_grows_stale_as_the_wheels_roll() {
        let mut mapper = mapper("");
        hear(&mut mapper, 0, 0.0, 0.0, None);
        assert_eq!(state(&mapper, 0.9, 0.0), CellState::Swept);
        // Six turns on the spot: 4.9 m of each wheel; the beam looks the other way at the end.
        let heading = 13.0 * std::f64::consts::PI;
        hear(&mut mapper, 1, 0.0, heading, None);
        assert_eq!(state(&mapper, 0.9, 0.0), CellState::Free);
        assert_eq!(state(&mapper, -0.9, 0.0), CellState::Swept);
    }

    #[test]
    fn a_mapper_that_was_killed_goes_on_to_the_bit() {
        let mut lived = mapper("");
        for tick in 0..5 {
            hear(&mut lived, tick, 0.0, 0.1 * tick as f64, Some(0.6));
        }
        let mut successor = mapper("");
        assert!(successor.restore(lived.belief().clone()));
        for tick in 5..9 {
            let echo = (tick % 2 == 0).then_some(0.5);
            for mapper in [&mut lived, &mut successor] {
                hear(mapper, tick, 0.02, -0.1 * tick as f64, echo);
            }
        }
        assert_eq!(lived.belief(), successor.belief());
    }

    #[test]
    fn a_belief_of_the_other_method_is_refused() {
        let kept = mapper("method = 'paper'").belief().clone();
        assert!(!mapper("").restore(kept));
    }

    #[test]
    fn what_is_forgotten_first_is_what_is_not_near_and_then_all_of_it() {
        let mut mapper = mapper("");
        hear(&mut mapper, 0, 0.0, 0.0, Some(0.9));
        hear(&mut mapper, 1, 0.0, 2.0, Some(0.3));
        assert!(mapper.forget(1) && !mapper.forget(1));
        assert!(!state(&mapper, 1.1, 0.0).is_hazard());
        let near = DVec2::from_angle(2.0) * 0.5;
        assert!(state(&mapper, near.x, near.y).is_hazard());
        assert!(mapper.forget(2));
        assert!(!state(&mapper, near.x, near.y).is_hazard());
    }

    #[test]
    fn the_targets_cell_is_never_hazard() {
        let mut mapper = mapper("");
        hear(&mut mapper, 0, 1.3, 0.0, Some(0.5));
        assert!(state(&mapper, 1.9, 0.0).is_hazard());
        assert!(!state(&mapper, 2.0, 0.0).is_hazard());
    }
}
