//! Belief: the cells that are hazard.
//!
//! The paper's map only grows (10). Cells of the target and under the robot never become hazard,
//! and the perimeter is constant (18). The evidential map follows the evidence both ways
//! ([`Sensed::Evidence`]).

use common::{
    clock::MissionTime,
    geometry::{Piece, Zone},
    grid::{Cell, CellState, GridFrame, Part, Window},
    mission::{Method, Mission},
    samples::{ContactSample, FaultKind, FixSample, GridHeader, PoseSample, RangeReading, Sweep},
    stage::ForeignState,
};
use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{
    deskew::{Placed, Poses},
    evidential::{EvidenceMap, Evidential},
    fault,
    movers::Movers,
    reading::{Rows, Touch},
    scan_match::{ScanMatcher, Surroundings},
    sonar_model::MOST,
};

#[allow(clippy::large_enum_variant, reason = "one is held at a time")]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub enum Input {
    Tick(Tick),
    Reset {
        /// Only a newer epoch resets.
        epoch: u64,
    },
    /// Operator's fault, in effect from the next tick.
    Fault(FaultKind),
    /// Replacement for all earlier zones.
    Zones(Vec<Zone>),
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Tick {
    pub pose: PoseSample,
    /// Readings; empty if none came.
    pub ranges: Vec<RangeReading>,
    /// Scans, at most one per laser.
    pub scans: Vec<Scan>,
    pub contact: Option<ContactSample>,
    /// Metres, from this tick on; none if unchanged.
    pub target: Option<DVec2>,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Scan {
    pub row: usize,
    /// Ranges in metres.
    pub beams: Vec<f32>,
    pub sweep: Sweep,
}

#[derive(Debug, PartialEq, Eq)]
pub enum Change {
    /// No change; no stage waits for an answer.
    None,
    /// Cells that may have changed; an empty window answers the tick.
    Window(Window),
    Whole,
}

#[allow(clippy::large_enum_variant, reason = "a mapper has one")]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
enum Sensed {
    /// Method `paper`: hits mark cells permanently.
    Hits,
    Evidence(EvidenceMap),
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Belief {
    /// [`CellState`] bytes, row-major.
    #[serde(with = "serde_bytes")]
    pub cells: Vec<u8>,
    /// 1 for a mission's first map.
    pub version: u64,
    /// Ticks whose readings added a hazard.
    pub safety_events: u64,
    epoch: u64,
    tick: Option<u64>,
    robot: DVec2,
    heading: f64,
    /// Mean wheel travel, including turns on the spot, metres.
    rolled: f64,
    sensed: Sensed,
    fault: FaultKind,
    pub target: DVec2,
    /// Matching reference; none before the first scan.
    surroundings: Option<Surroundings>,
}

fn paint(
    cells: &mut [u8],
    frame: &GridFrame,
    window: Window,
    state: impl Fn(Cell, CellState) -> CellState,
) -> Window {
    let mut changed = Window::default();
    assert!(frame.contains(window));
    assert_eq!(cells.len(), frame.area());
    for cell in window.cells() {
        let held = &mut cells[frame.index(cell)];
        let state = state(cell, CellState::from_byte(*held)) as u8;
        if *held != state {
            *held = state;
            changed = changed.including(cell);
        }
    }
    changed
}

pub fn hazard_reach_m(mission: &Mission) -> f64 {
    match mission.method {
        // A known surface blocks like a hit on it: its cell and the margin around.
        Method::Paper => {
            (f64::from(mission.margin_cells()) + 0.5) * mission.grid_frame().resolution_m
        }
        Method::Evidential => Evidential::new(mission).reach,
    }
}

/// Mapper by (19) or the evidential method.
#[derive(Clone, Debug)]
pub struct Mapper {
    /// Mission with the newest zones.
    mission: Mission,
    frame: GridFrame,
    target: Option<Cell>,
    /// Reach of the hazard around known shapes, metres.
    reach: f64,
    evidential: Evidential,
    rows: Rows,
    footprint: f64,
    half_track: f64,
    matcher: ScanMatcher,
    movers: Movers,
    poses: Poses,
    fix: Option<FixSample>,
    /// Total beams of all lasers.
    beams: usize,
    /// Time in which evidence weakens by one, seconds, and the newest tick's; none if it lasts.
    forgets: Option<(f64, Option<MissionTime>)>,
    belief: Belief,
}

impl Mapper {
    /// Maps the perimeter (18) and the mission's known shapes.
    pub fn new(mission: &Mission) -> Self {
        let frame = mission.grid_frame();
        let evidential = Evidential::new(mission);
        let sensed = match mission.method {
            Method::Paper => Sensed::Hits,
            Method::Evidential => Sensed::Evidence(evidential.empty()),
        };
        let mut mapper = Self {
            mission: mission.clone(),
            frame,
            target: frame.cell_at(mission.target),
            reach: hazard_reach_m(mission),
            evidential,
            rows: Rows::new(mission),
            footprint: mission.body().radius_m,
            half_track: mission.body().track_m / 2.0,
            matcher: ScanMatcher::new(mission),
            movers: Movers::default(),
            poses: Poses::default(),
            fix: None,
            beams: mission.lasers().iter().map(|(_, laser)| laser.beams).sum(),
            forgets: mission.mapper.forget_after_s.map(|all_s| (all_s / f64::from(MOST), None)),
            belief: Belief {
                cells: vec![CellState::Free as u8; frame.area()],
                version: 1,
                safety_events: 0,
                epoch: 0,
                tick: None,
                robot: mission.start_pose().position,
                heading: mission.start_pose().heading,
                rolled: 0.0,
                sensed,
                fault: FaultKind::Nothing,
                target: mission.target,
                surroundings: None,
            },
        };
        assert!(mapper.reach >= 0.0 && mapper.half_track > 0.0);
        mapper.mark_known();
        mapper
    }

    pub const fn state(&self) -> &Belief {
        &self.belief
    }

    /// Restores the belief of an earlier process.
    ///
    /// # Errors
    /// Returns an error and keeps the map if the belief is of another mission.
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

    pub fn step(&mut self, input: Input, now: MissionTime) -> Change {
        self.fix = None;
        match input {
            Input::Tick(tick) => Change::Window(self.tick(tick, now)),
            Input::Reset { epoch } if self.reset_belief(epoch) => Change::Whole,
            Input::Reset { .. } => Change::None,
            Input::Fault(fault) => {
                self.belief.fault = fault;
                Change::None
            }
            Input::Zones(zones) => {
                self.set_zones(zones);
                Change::Whole
            }
        }
    }

    pub fn uses(&self, row: u64) -> bool {
        self.rows.uses(row)
    }

    /// Scans may give none.
    pub const fn take_fix(&mut self) -> Option<FixSample> {
        self.fix.take()
    }

    pub const fn frame(&self) -> GridFrame {
        self.frame
    }

    pub fn saved_bytes(&self) -> usize {
        let evidence = match self.belief.sensed {
            Sensed::Hits => 0,
            Sensed::Evidence(_) => self.evidential.saved_bytes(),
        };
        let surroundings = if self.beams > 0 { Surroundings::MOST_BYTES } else { 0 };
        self.frame.area() + evidence + surroundings + 256
    }

    /// Returns room for a journal entry, which takes 250 bytes plus four per beam.
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
        self.movers.fill(&mut header);
        if let Sensed::Evidence(map) = &self.belief.sensed {
            map.beams.fill(&mut header);
        }
        header
    }

    fn mark_known(&mut self) {
        let Self { mission: Mission { known, zones, .. }, frame, target, reach, belief, .. } = self;
        for piece in known.pieces().chain(zones.iter().map(Piece::Zone)) {
            let (least, greatest) = piece.bounds();
            let near = frame.between(least - *reach, greatest + *reach);
            paint(&mut belief.cells, frame, near, |cell, held| {
                let covered = piece.clearance(frame.centre_of(cell)) <= *reach;
                if covered && Some(cell) != *target { CellState::Known } else { held }
            });
        }
        paint(&mut belief.cells, frame, frame.whole(), |cell, held| {
            if frame.is_rim(cell) { CellState::Perimeter } else { held }
        });
    }

    /// Replaces the zones. Sensed cells of former zones show again; the paper's hits there are
    /// lost.
    fn set_zones(&mut self, zones: Vec<Zone>) {
        self.mission.zones = zones;
        let Self { frame, target, evidential, belief: Belief { cells, sensed, .. }, .. } = self;
        paint(cells, frame, frame.whole(), |cell, held| match (held, &*sensed) {
            (CellState::Known, Sensed::Hits) => CellState::Free,
            (CellState::Known, Sensed::Evidence(map)) => {
                evidential.state(map, cell, Some(cell) == *target)
            }
            _ => held,
        });
        self.mark_known();
        self.belief.version += 1;
    }

    fn move_target(&mut self, target: DVec2) -> Window {
        self.belief.target = target;
        let cell = self.frame.cell_at(target).filter(|cell| !self.frame.is_rim(*cell));
        let before = std::mem::replace(&mut self.target, cell);
        let mut changed = Window::default();
        for cell in [before, cell].into_iter().flatten() {
            let state = self.state_for_target(cell);
            let own = Window::default().including(cell);
            changed = changed.union(paint(&mut self.belief.cells, &self.frame, own, |_, _| state));
        }
        changed
    }

    /// Decides by target, known shapes and evidence. The paper's hits exist only in its map.
    fn state_for_target(&self, cell: Cell) -> CellState {
        let Mission { known, zones, .. } = &self.mission;
        let is_target = Some(cell) == self.target;
        let centre = self.frame.centre_of(cell);
        let zones = zones.iter().map(|zone| zone.clearance(centre));
        if !is_target && zones.fold(known.clearance(centre), f64::min) <= self.reach {
            return CellState::Known;
        }
        match &self.belief.sensed {
            Sensed::Hits if is_target => CellState::Free,
            Sensed::Hits => CellState::from_byte(self.belief.cells[self.frame.index(cell)]),
            Sensed::Evidence(map) => self.evidential.state(map, cell, is_target),
        }
    }

    /// Maps a tick once, even if repeated.
    fn tick(
        &mut self,
        Tick { pose, ranges, scans, contact, target }: Tick,
        now: MissionTime,
    ) -> Window {
        let moved = target.map_or(Window::default(), |target| self.move_target(target));
        if self.beams > 0 {
            self.poses.add(&pose);
        }
        let changed = if self.belief.tick == Some(pose.stamp.tick) {
            moved
        } else {
            // Scans without a known pose are skipped.
            let placed = |scan: Scan| match scan {
                Scan { row, beams, sweep } if sweep == Sweep::default() => {
                    Some(Placed { row, robot: pose, capture_ns: now.0, beams })
                }
                scan => self.poses.scan_at_once(&self.rows, &pose, scan),
            };
            let scans: Vec<_> = scans.into_iter().filter_map(placed).collect();
            let surroundings = &mut self.belief.surroundings;
            self.fix = self.matcher.step(&self.rows, surroundings, &scans, &mut self.movers);
            let odometry = pose.odometry();
            let held = self.belief.surroundings.as_ref();
            self.movers.place(&pose, held.map_or(odometry, |held| held.carried(odometry)));
            let forgot = self.forget(pose.stamp.time());
            moved.union(forgot).union(self.map(&pose, (&ranges, &scans), contact.as_ref()))
        };
        self.belief.version += u64::from(changed.area() > 0);
        changed
    }

    fn forget(&mut self, now: MissionTime) -> Window {
        let (Some((step_s, newest)), Sensed::Evidence(map)) =
            (&mut self.forgets, &mut self.belief.sensed)
        else {
            return Window::default();
        };
        let steps = |at: MissionTime| (at.seconds() / *step_s).floor();
        let passed = steps(now) - steps(newest.unwrap_or(now));
        *newest = Some(now);
        if passed < 1.0 {
            return Window::default();
        }
        let window = self.evidential.forget(map, passed.min(f64::from(MOST)) as i8);
        self.redraw(window)
    }

    fn map(
        &mut self,
        pose: &PoseSample,
        (ranges, scans): (&[RangeReading], &[Placed]),
        contact: Option<&ContactSample>,
    ) -> Window {
        assert_ne!(self.belief.tick, Some(pose.stamp.tick), "a tick counts once");
        let belief = &mut self.belief;
        let robot = pose.pose();
        let before_m = belief.rolled;
        belief.tick = Some(pose.stamp.tick);
        belief.rolled += belief.robot.distance(robot.position)
            + self.half_track * (robot.heading - belief.heading).abs();
        belief.robot = robot.position;
        belief.heading = robot.heading;
        let (ranges, scans) =
            if self.mission.sensing { (ranges, scans) } else { (&[][..], &[][..]) };
        let (seen, is_event) = match &mut belief.sensed {
            // The paper's method takes hits of the front sonar.
            Sensed::Hits => {
                let hit = self.rows.front_hit(robot, ranges);
                let near = hit.filter(|(distance, _)| *distance <= self.mission.map_within_m());
                let seen = near.map(|(_, hit)| self.mark(hit, robot.position)).unwrap_or_default();
                (seen, seen.area() > 0)
            }
            Sensed::Evidence(map) => {
                let rows = &self.rows;
                let rolled_m = [before_m, belief.rolled];
                let fans = scans.iter().filter_map(|Placed { row, robot, beams, .. }| {
                    Some((*row, rows.scan(*row, robot.pose(), beams)?))
                });
                let readings = (fans, rows.rays(robot, ranges), rows.beams(robot, ranges));
                let (window, is_event) =
                    self.evidential.take(map, robot.position, rolled_m, readings);
                (self.redraw(window), is_event)
            }
        };
        self.belief.safety_events += u64::from(is_event);
        let contact = contact.and_then(|contact| Touch::of(robot, contact));
        let felt = contact.map(|touch| self.mark_touch(&touch)).unwrap_or_default();
        seen.union(felt).union(self.falsify())
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

    fn redraw(&mut self, window: Window) -> Window {
        let Self { frame, target, evidential, belief, .. } = self;
        let Sensed::Evidence(map) = &belief.sensed else {
            return Window::default();
        };
        paint(&mut belief.cells, frame, window, |cell, held| match held {
            CellState::Known | CellState::Perimeter => held,
            _ => evidential.state(map, cell, Some(cell) == *target),
        })
    }

    fn mark(&mut self, hit: DVec2, robot: DVec2) -> Window {
        let margin = f64::from(self.mission.margin_cells());
        let middle = self.frame.to_cells(hit).round();
        let last = DVec2::splat(f64::from(self.frame.cells) - 1.0);
        let (from, to) = ((middle - margin).max(DVec2::ZERO), (middle + margin).min(last));
        if !middle.is_finite() || !from.cmple(to).all() {
            return Window::default();
        }
        let [from, to] = [from, to].map(|at| Cell { col: at.x as u32, row: at.y as u32 });
        let Self { frame, target, footprint, belief, .. } = self;
        paint(
            &mut belief.cells,
            frame,
            Window::default().including(from).including(to),
            |cell, held| {
                let stays = held != CellState::Free
                    || Some(cell) == *target
                    || frame.centre_of(cell).distance(robot) <= *footprint;
                if stays { held } else { CellState::Sensed }
            },
        )
    }

    /// Resets to the perimeter and known shapes if `epoch` is newer, and returns whether it was.
    /// The evidential method keeps echoes near the robot.
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
                paint(
                    &mut self.belief.cells,
                    &self.frame,
                    self.frame.whole(),
                    |_, held| match held {
                        CellState::Sensed => CellState::Free,
                        _ => held,
                    },
                );
            }
        }
        // The wall around the target outlasts a reset.
        if self.belief.fault != FaultKind::CutOff {
            self.belief.fault = FaultKind::Nothing;
        }
        self.belief.surroundings = None;
        self.falsify();
        self.belief.epoch = epoch;
        self.belief.version += 1;
        true
    }

    fn falsify(&mut self) -> Window {
        let frame = self.frame;
        let target = self.target;
        let Belief { cells, fault, robot, target: place, .. } = &mut self.belief;
        if *fault == FaultKind::Nothing {
            return Window::default();
        }
        paint(cells, &frame, frame.whole(), |cell, held| {
            let stays = Some(cell) == target || held.is_hazard();
            let at = frame.centre_of(cell);
            let covered = !stays && fault::covers(*fault, at, frame.resolution_m, *robot, *place);
            if covered { CellState::Sensed } else { held }
        })
    }
}

#[cfg(test)]
mod tests;
