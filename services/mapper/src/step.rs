//! The belief: which cells are hazard.
//!
//! The paper's map only grows, (10). The cells of the target and under the robot never become hazard, and the perimeter never changes,
//! (18). The evidential map follows the evidence both ways ([`Sensed::Evidence`]).

use common::{
    clock::MissionTime,
    geometry::Shapes,
    grid::{Cell, CellState, GridFrame, Part, Window},
    kinematics::Pose2,
    mission::{Method, Mission},
    samples::{
        ContactSample, FaultKind, FixSample, GridHeader, PoseSample, RangeReading, Sweep, name,
    },
    stage::ForeignState,
};
use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{
    deskew::Poses,
    evidential::{EvidenceMap, Evidential},
    fault,
    reading::{Rows, Touch},
    scan_match::{Reference, ScanMatcher},
};

/// The belief follows from its inputs alone, so the journal holds them.
#[allow(clippy::large_enum_variant, reason = "one is held at a time")]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Input {
    Tick {
        pose: PoseSample,
        /// None if none came.
        ranges: Vec<RangeReading>,
        /// Metres; none if none came.
        scan: Vec<f32>,
        /// Something holds the wheels at this tick.
        contact: Option<ContactSample>,
        /// It holds from this tick on, metres; none if unchanged.
        target: Option<DVec2>,
    },
    Reset {
        /// A belief that has begun already is not reset.
        epoch: u64,
    },
    /// An operator's; it acts from the next tick on.
    Fault(FaultKind),
    /// The beams of this tick's scan, which follows, were measured at these times; otherwise at the tick.
    Sweep(u64, Sweep),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// Nothing changed, and no stage waits for an answer.
    None,
    /// It may have changed; an empty window answers the tick.
    Window(Window),
    Whole,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
enum Sensed {
    /// Method `paper`: hits are marked in the cells and stay.
    Hits,
    Evidence(EvidenceMap),
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Belief {
    /// A [`CellState`] byte a cell, row-major.
    #[serde(with = "serde_bytes")]
    cells: Vec<u8>,
    version: u64,
    /// Ticks whose readings put a hazard on the map.
    safety_events: u64,
    epoch: u64,
    /// The last mapped tick, and the robot there: metres, radians.
    tick: Option<u64>,
    robot: DVec2,
    heading: f64,
    /// Mean way of the wheels by then, turns on the spot included, metres.
    rolled: f64,
    sensed: Sensed,
    fault: FaultKind,
    target: DVec2,
    /// Later scans are matched with it; none before the first.
    reference: Option<Reference>,
}

impl Belief {
    pub fn cells(&self) -> &[u8] {
        &self.cells
    }

    /// 1 for a mission's first map.
    pub const fn version(&self) -> u64 {
        self.version
    }

    pub const fn safety_events(&self) -> u64 {
        self.safety_events
    }
}

/// Cells this near to a surface are hazard, metres.
pub fn hazard_reach_m(mission: &Mission) -> f64 {
    match mission.method {
        // A known surface blocks like a hit on it: its cell and the margin around.
        Method::Paper => {
            (f64::from(mission.margin_cells()) + 0.5) * mission.grid_frame().resolution_m
        }
        Method::Evidential => Evidential::new(mission).reach(),
    }
}

/// (19), or the evidential method.
#[derive(Clone, Debug)]
pub struct Mapper {
    frame: GridFrame,
    target: Option<Cell>,
    /// Shapes known from the mission, and the reach of their hazard, metres.
    known: (Shapes, f64),
    /// Im of (19).
    margin: u32,
    evidential: Evidential,
    sensing: bool,
    rows: Rows,
    map_within: f64,
    footprint: f64,
    half_track: f64,
    matcher: ScanMatcher,
    poses: Poses,
    /// The newest scan's that were not measured at their tick.
    sweep: Option<(u64, Sweep)>,
    fix: Option<FixSample>,
    /// Of the laser; 0 without one.
    beams: usize,
    belief: Belief,
}

impl Mapper {
    /// A map with the perimeter, (18), and the shapes that the mission knows beforehand.
    pub fn new(mission: &Mission) -> Self {
        let frame = mission.grid_frame();
        let margin = mission.margin_cells();
        let evidential = Evidential::new(mission);
        let sensed = match mission.method {
            Method::Paper => Sensed::Hits,
            Method::Evidential => Sensed::Evidence(evidential.empty()),
        };
        let mut mapper = Self {
            frame,
            target: frame.cell_at(mission.target),
            known: (mission.known.clone(), hazard_reach_m(mission)),
            margin,
            evidential,
            sensing: mission.sensing,
            rows: Rows::new(mission),
            map_within: mission.map_within_m(),
            footprint: mission.body().radius_m,
            half_track: mission.body().track_m / 2.0,
            matcher: ScanMatcher::new(mission),
            poses: Poses::default(),
            sweep: None,
            fix: None,
            beams: mission.laser().map_or(0, |(_, laser)| laser.beams),
            belief: Belief {
                cells: vec![CellState::Free as u8; frame.area()],
                version: 1,
                safety_events: 0,
                epoch: 0,
                tick: None,
                robot: DVec2::ZERO,
                heading: mission.start_pose().heading,
                rolled: 0.0,
                sensed,
                fault: FaultKind::Nothing,
                target: mission.target,
                reference: None,
            },
        };
        mapper.mark_known();
        mapper
    }

    /// What the next process must know.
    pub const fn state(&self) -> &Belief {
        &self.belief
    }

    /// Go on from the belief of an earlier process.
    ///
    /// # Errors
    /// When the belief is of another mission. Then the map stays as it is.
    pub fn restore(&mut self, mut belief: Belief) -> Result<(), ForeignState> {
        match (&self.belief.sensed, &mut belief.sensed) {
            (Sensed::Hits, Sensed::Hits) => {}
            (Sensed::Evidence(_), Sensed::Evidence(map)) => self.evidential.complete(map)?,
            _ => return Err(ForeignState),
        }
        if belief.cells.len() != self.frame.area() {
            return Err(ForeignState);
        }
        self.target = self.frame.cell_at(belief.target);
        self.belief = belief;
        Ok(())
    }

    /// Take `input` at mission time `now`.
    pub fn step(&mut self, input: Input, now: MissionTime) -> Change {
        self.fix = None;
        match input {
            Input::Tick { pose, ranges, scan, contact, target } => {
                let moved = target.map_or(Window::default(), |target| self.move_target(target));
                let (scanned_at, capture_ns, scan) = self.place(&pose, now, scan);
                if self.belief.tick != Some(pose.stamp.tick) {
                    let reference = &mut self.belief.reference;
                    let fix = self.matcher.step(&self.rows, reference, &scanned_at, &scan);
                    let fix = fix.filter(|_| self.matcher.publishes(pose.stamp.tick));
                    let source = name("scan");
                    self.fix = fix.map(|fix| FixSample { capture_ns, source, ..fix });
                }
                let scan = (scanned_at.pose(), &scan[..]);
                Change::Window(self.map(&pose, (&ranges, scan), contact.as_ref(), moved))
            }
            Input::Reset { epoch } if self.reset_belief(epoch) => Change::Whole,
            Input::Reset { .. } => Change::None,
            Input::Fault(fault) => {
                self.belief.fault = fault;
                Change::None
            }
            Input::Sweep(tick, sweep) => {
                self.sweep = Some((tick, sweep));
                Change::None
            }
        }
    }

    /// The robot where it took the scan, that time, and the scan from there; no scan if that place is not known.
    fn place(
        &mut self,
        pose: &PoseSample,
        now: MissionTime,
        scan: Vec<f32>,
    ) -> (PoseSample, u64, Vec<f32>) {
        if self.rows.has_laser() {
            self.poses.add(pose);
        }
        match self.sweep.take().filter(|(tick, _)| *tick == pose.stamp.tick) {
            Some((_, sweep)) => self.poses.scan_at_once(&self.rows, pose, scan, sweep).unwrap_or((
                *pose,
                now.0,
                Vec::new(),
            )),
            None => (*pose, now.0, scan),
        }
    }

    /// Whether the mission uses the sensor of this row.
    pub fn uses_row(&self, row: u64) -> bool {
        self.rows.uses_row(row)
    }

    pub fn uses(&self, reading: &RangeReading) -> bool {
        self.rows.uses(reading)
    }

    /// The newest scan and those before may give none.
    pub const fn take_fix(&mut self) -> Option<FixSample> {
        self.fix.take()
    }

    pub const fn frame(&self) -> GridFrame {
        self.frame
    }

    pub const fn target(&self) -> DVec2 {
        self.belief.target
    }

    pub const fn saved_bytes(&self) -> usize {
        let evidence = match self.belief.sensed {
            Sensed::Hits => 0,
            Sensed::Evidence(_) => self.evidential.saved_bytes(),
        };
        self.frame.area() + evidence + 5 * self.beams + 240
    }

    /// Room for an entry of the journal: it takes 250 bytes, and the beams of a scan four each.
    pub const fn entry_bytes(&self) -> usize {
        512 + 4 * self.beams
    }

    pub fn header(&self, part: Part) -> GridHeader {
        let mut header = GridHeader {
            part,
            safety_events: self.belief.safety_events,
            epoch: self.belief.epoch,
            ..GridHeader::default()
        };
        if let Sensed::Evidence(map) = &self.belief.sensed {
            map.beams.fill(&mut header);
        }
        header
    }

    fn mark_known(&mut self) {
        let (frame, (known, reach)) = (self.frame, &self.known);
        let reach = *reach;
        let last = f64::from(frame.cells) - 1.0;
        for piece in known.pieces() {
            let (least, greatest) = piece.bounds();
            let inside = |corner: DVec2| corner.clamp(DVec2::ZERO, DVec2::splat(last));
            let from = inside(frame.to_cells(least - reach).floor());
            let to = inside(frame.to_cells(greatest + reach).ceil());
            for row in from.y as u32..=to.y as u32 {
                for col in from.x as u32..=to.x as u32 {
                    let cell = Cell { col, row };
                    let covered = piece.clearance(frame.centre_of(cell)) <= reach;
                    if covered && Some(cell) != self.target {
                        self.belief.cells[frame.index(cell)] = CellState::Known as u8;
                    }
                }
            }
        }
        let last = frame.cells - 1;
        for along in 0..frame.cells {
            for (col, row) in [(along, 0), (along, last), (0, along), (last, along)] {
                self.belief.cells[frame.index(Cell { col, row })] = CellState::Perimeter as u8;
            }
        }
    }

    /// The cell of the new target is no hazard, and that of the old one may be again. Returns the changed window.
    fn move_target(&mut self, target: DVec2) -> Window {
        self.belief.target = target;
        let cell = self.frame.cell_at(target).filter(|cell| !self.frame.is_rim(*cell));
        let before = std::mem::replace(&mut self.target, cell);
        let mut changed = Window::default();
        for cell in [before, cell].into_iter().flatten() {
            let state = self.state_for_target(cell) as u8;
            let held = &mut self.belief.cells[self.frame.index(cell)];
            if *held != state {
                *held = state;
                changed = changed.including(cell);
            }
        }
        changed
    }

    /// The target, the known shapes and the evidence decide. The paper's hits are in its map alone.
    fn state_for_target(&self, cell: Cell) -> CellState {
        let (known, reach) = &self.known;
        let is_target = Some(cell) == self.target;
        if !is_target && known.clearance(self.frame.centre_of(cell)) <= *reach {
            return CellState::Known;
        }
        match &self.belief.sensed {
            Sensed::Hits if is_target => CellState::Free,
            Sensed::Hits => CellState::from_byte(self.belief.cells[self.frame.index(cell)]),
            Sensed::Evidence(map) => self.evidential.state(map, cell, is_target),
        }
    }

    /// Map readings and contact of `pose`. Returns the changed window, with `changed`. A tick given twice is mapped once.
    fn map(
        &mut self,
        pose: &PoseSample,
        (ranges, (scanned_at, scan)): (&[RangeReading], (Pose2, &[f32])),
        contact: Option<&ContactSample>,
        changed: Window,
    ) -> Window {
        if self.belief.tick == Some(pose.stamp.tick) {
            self.belief.version += u64::from(changed.area() > 0);
            return changed;
        }
        self.belief.tick = Some(pose.stamp.tick);
        let (last, now) = (self.belief.robot, pose.pose());
        let rolled = self.belief.rolled;
        self.belief.rolled += last.distance(now.position)
            + self.half_track * (now.heading - self.belief.heading).abs();
        (self.belief.robot, self.belief.heading) = (now.position, now.heading);
        let (ranges, scan) = if self.sensing { (ranges, scan) } else { (&[][..], &[][..]) };
        let seen = match &self.belief.sensed {
            Sensed::Hits => self.mark_hit(now, ranges),
            Sensed::Evidence(_) => self.weigh(now, (ranges, (scanned_at, scan)), rolled),
        };
        let contact = contact.and_then(|contact| Touch::of(now, contact));
        let felt = contact.map_or_else(Window::default, |touch| self.mark_touch(&touch));
        let changed = changed.union(seen).union(felt).union(self.falsify());
        self.belief.version += u64::from(changed.area() > 0);
        changed
    }

    /// Method `paper`: hazard where the front sonar hears an obstacle.
    fn mark_hit(&mut self, robot: Pose2, ranges: &[RangeReading]) -> Window {
        let Some((distance, hit)) = self.rows.front_hit(robot, ranges) else {
            return Window::default();
        };
        if distance > self.map_within {
            return Window::default();
        }
        let changed = self.mark(hit, robot.position);
        self.belief.safety_events += u64::from(changed.area() > 0);
        changed
    }

    /// Method `evidential`: evidence for and against hazard, and scanned ground.
    fn weigh(
        &mut self,
        robot: Pose2,
        (ranges, (scanned_at, scan)): (&[RangeReading], (Pose2, &[f32])),
        rolled: f64,
    ) -> Window {
        let Sensed::Evidence(map) = &mut self.belief.sensed else {
            return Window::default();
        };
        let stale = self.evidential.roll(map, rolled, self.belief.rolled);
        // The scan first: what it shows explains echoes.
        let fan = self.rows.scan(scanned_at, scan);
        let seen = fan.map(|fan| self.evidential.take_scan(map, robot.position, &fan));
        let seen = seen.unwrap_or_default();
        let (beams, rays) = (self.rows.beams(robot, ranges), self.rows.rays(robot, ranges));
        let news = self.evidential.take(map, robot.position, beams, rays, self.belief.rolled);
        let changed = self.redraw(stale.union(news.window).union(seen.window));
        self.belief.safety_events += u64::from(news.safety_event || seen.safety_event);
        changed
    }

    fn mark_touch(&mut self, touch: &Touch) -> Window {
        let changed = match &mut self.belief.sensed {
            Sensed::Hits => self.mark(touch.robot + self.footprint * touch.axis, touch.robot),
            Sensed::Evidence(map) => {
                let touched = self.evidential.touch(map, touch);
                self.redraw(touched)
            }
        };
        self.belief.safety_events += u64::from(changed.area() > 0);
        changed
    }

    /// Returns the changed window.
    fn redraw(&mut self, window: Window) -> Window {
        let mut changed = Window::default();
        let Sensed::Evidence(map) = &self.belief.sensed else {
            return changed;
        };
        for row in window.row..window.row + window.height {
            for col in window.col..window.col + window.width {
                let cell = Cell { col, row };
                let index = self.frame.index(cell);
                let state = match CellState::from_byte(self.belief.cells[index]) {
                    fixed @ (CellState::Known | CellState::Perimeter) => fixed,
                    _ => self.evidential.state(map, cell, Some(cell) == self.target),
                } as u8;
                if self.belief.cells[index] != state {
                    self.belief.cells[index] = state;
                    changed = changed.including(cell);
                }
            }
        }
        changed
    }

    /// The hit's cell and the margin around it, (19), as far as they lie in the map.
    fn mark(&mut self, hit: DVec2, robot: DVec2) -> Window {
        let mut changed = Window::default();
        let margin = f64::from(self.margin);
        let middle = self.frame.to_cells(hit).round();
        let last = DVec2::splat(f64::from(self.frame.cells) - 1.0);
        let (from, to) = ((middle - margin).max(DVec2::ZERO), (middle + margin).min(last));
        if !middle.is_finite() || !from.cmple(to).all() {
            return changed;
        }
        for row in from.y as u32..=to.y as u32 {
            for col in from.x as u32..=to.x as u32 {
                let cell = Cell { col, row };
                if self.frame.is_rim(cell) || Some(cell) == self.target {
                    continue;
                }
                if self.frame.centre_of(cell).distance(robot) <= self.footprint {
                    continue;
                }
                let state = &mut self.belief.cells[self.frame.index(cell)];
                if *state == CellState::Free as u8 {
                    *state = CellState::Sensed as u8;
                    changed = changed.including(cell);
                }
            }
        }
        changed
    }

    /// Reset to the perimeter and the known shapes, if `epoch` is newer. The evidential method keeps echoes from near the robot. Returns
    /// whether it did.
    fn reset_belief(&mut self, epoch: u64) -> bool {
        if epoch <= self.belief.epoch {
            return false;
        }
        match &mut self.belief.sensed {
            Sensed::Evidence(map) => {
                self.evidential.reset(map, self.belief.robot, epoch);
                self.redraw(self.frame.whole());
            }
            Sensed::Hits => {
                for cell in &mut self.belief.cells {
                    if *cell == CellState::Sensed as u8 {
                        *cell = CellState::Free as u8;
                    }
                }
            }
        }
        self.belief.fault = fault::after_reset(self.belief.fault);
        self.belief.reference = None;
        self.falsify();
        self.belief.epoch = epoch;
        self.belief.version += 1;
        true
    }

    /// Mark an injected fault's hazard. Returns the changed window.
    fn falsify(&mut self) -> Window {
        let mut changed = Window::default();
        let Some(area) = fault::hazard(self.belief.fault, self.belief.robot, self.belief.target)
        else {
            return changed;
        };
        for row in 0..self.frame.cells {
            for col in 0..self.frame.cells {
                let cell = Cell { col, row };
                let state = &mut self.belief.cells[self.frame.index(cell)];
                let stays = Some(cell) == self.target || CellState::from_byte(*state).is_hazard();
                if !stays && area.covers(self.frame.centre_of(cell), self.frame.resolution_m) {
                    *state = CellState::Sensed as u8;
                    changed = changed.including(cell);
                }
            }
        }
        changed
    }
}

#[cfg(test)]
mod tests;
