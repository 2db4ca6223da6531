mod evidential;
mod laser;

use super::*;
use crate::testing::mission;
use CellState::{Free, Known, Perimeter, Scanned, Sensed};
use common::samples::{RangeStatus, Stamp};
use glam::dvec2;
use std::f64::consts::FRAC_PI_2;

impl Mapper {
    fn give(&mut self, mut tick: Tick) -> Window {
        tick.pose.stamp.tick = self.belief.tick.map_or(0, |tick| tick + 1);
        self.repeat(tick)
    }

    fn repeat(&mut self, tick: Tick) -> Window {
        let now = tick.pose.stamp.time();
        match self.step(Input::Tick(tick), now) {
            Change::Window(window) => window,
            other => panic!("a tick gave {other:?}"),
        }
    }

    fn sense(&mut self, pose: PoseSample, ranges: &[RangeReading]) -> Window {
        self.give(Tick { pose, ranges: ranges.to_vec(), ..Tick::default() })
    }

    fn scan(&mut self, pose: PoseSample, scans: Vec<Scan>) {
        self.give(Tick { pose, scans, ..Tick::default() });
    }

    fn touch(&mut self, bearing_rad: f64) {
        let contact = ContactSample {
            bearing_rad,
            half_width_rad: 0.8,
            left: 1,
            right: 1,
            ..ContactSample::default()
        };
        assert!(self.give(Tick { contact: Some(contact), ..Tick::default() }).area() > 0);
    }

    fn reset(&mut self, epoch: u64) -> bool {
        self.step(Input::Reset { epoch }, MissionTime(0)) == Change::Whole
    }

    fn state_at(&self, x_cm: i32, y_cm: i32) -> CellState {
        let place = dvec2(x_cm.into(), y_cm.into()) / 100.0;
        let cell = self.frame.cell_at(place).unwrap();
        CellState::from_byte(self.belief.cells[self.frame.index(cell)])
    }

    fn ahead(&self, x_cm: i32) -> CellState {
        self.state_at(x_cm, 0)
    }

    fn hazard_ahead(&self, x_cm: i32) -> bool {
        self.ahead(x_cm).is_hazard()
    }

    fn is_hazard(&self, x_cm: i32, y_cm: i32) -> bool {
        self.state_at(x_cm, y_cm).is_hazard()
    }

    fn cells(&self, is: impl Fn(CellState) -> bool) -> Vec<Cell> {
        let state = |cell| CellState::from_byte(self.belief.cells[self.frame.index(cell)]);
        self.frame.whole().cells().filter(|cell| is(state(*cell))).collect()
    }

    fn hazards(&self) -> Vec<Cell> {
        self.cells(CellState::is_hazard)
    }
}

fn mapper_of(text: &str) -> Mapper {
    Mapper::new(&mission(text))
}

/// D = 5 m, N = 50: Delta = 0.1 m, the origin in cell (25, 25). The sensor is 0.2 m ahead.
fn mapper(extra: &str) -> Mapper {
    of(&format!("mapper.margin_m = 0.15\n{extra}"), 0.1)
}

/// Returns a mapper of the same place with other cells; `set` ends its mission file.
fn of(set: &str, cell_m: f64) -> Mapper {
    mapper_of(&format!(
        "target = [1.5, 0.0]\nmethod = 'paper'\nperimeter = {{ width_m = 5, cells = {} }}\n\
         sonar.forward_m = 0.2\nmapper.map_within_m = 2.0\n{set}",
        (5.0 / cell_m) as u32
    ))
}

fn start() -> PoseSample {
    PoseSample::default()
}

fn at(x_m: f64, y_m: f64, heading_rad: f64) -> PoseSample {
    PoseSample { x_m, y_m, heading_rad, ..PoseSample::default() }
}

fn reading(status: RangeStatus, range_m: f64) -> RangeReading {
    RangeReading { range_m, status: status.into(), ..RangeReading::default() }
}

fn echo(range_m: f64) -> RangeReading {
    reading(RangeStatus::Measured, range_m)
}

fn sensed(mapper: &Mapper) -> Vec<(u32, u32)> {
    let cells = mapper.cells(|cell| cell == Sensed);
    cells.into_iter().map(|Cell { col, row }| (col, row)).collect()
}

#[test]
fn equation_18_blocks_the_border_alone_and_no_margin_changes_it() {
    let mut mapper = mapper("");
    assert_eq!(mapper.cells(|cell| cell != Free).len(), 4 * 49);
    mapper.sense(at(1.9, 0.0, 0.0), &[echo(0.2)]);
    assert_eq!(mapper.state().cells[25 * 50 + 49], Perimeter as u8);
}

#[test]
fn equation_19_by_hand() {
    // From (0.3, -0.2) facing y, S + offset = 0.5 + 0.2: the hit is at (0.3, 0.5), cell (28, 30).
    let mut mapper = mapper("");
    let window = mapper.sense(at(0.3, -0.2, FRAC_PI_2), &[echo(0.5)]);
    let want = (29..=31).flat_map(|row| (27..=29).map(move |col| (col, row)));
    assert_eq!(sensed(&mapper), Vec::from_iter(want));
    assert_eq!((window.col, window.row, window.width, window.height), (27, 29, 3, 3));
    // A tick that is given twice is one safety event.
    let again = Tick { ranges: vec![echo(0.5)], ..Tick::default() };
    assert_eq!(mapper.repeat(again).area(), 0);
    assert_eq!(mapper.state().safety_events, 1);
    assert_eq!(mapper.state().version, 2);
}

#[test]
fn equation_19_takes_the_sensors_offset_along_its_bearing() {
    // From the origin facing x, S + offset = 0.8 + 0.2 along the bearing.
    for bearing_deg in [0, 45, -90] {
        let set = format!("sonar.bearing_deg = {bearing_deg}\nmapper.margin_m = 0.0");
        let mut mapper = of(&set, 0.02);
        mapper.sense(start(), &[echo(0.8)]);
        let hit = DVec2::from_angle(f64::from(bearing_deg).to_radians());
        let cell = mapper.frame().cell_at(hit).unwrap();
        assert_eq!(sensed(&mapper), [(cell.col, cell.row)], "{bearing_deg}");
    }
}

#[test]
fn a_hit_just_outside_the_map_marks_the_part_of_its_margin_that_is_inside() {
    let mut mapper = mapper("");
    // The hit is at (2.5, 0), one cell outside. The margin is a cell, and the last cell stays
    // border.
    let outside = echo(0.5);
    mapper.sense(at(1.8, 0.0, 0.0), &[outside]);
    assert_eq!(sensed(&mapper), []);
    let mut mapper = of("mapper.margin_m = 0.25", 0.1);
    mapper.sense(at(1.8, 0.0, 0.0), &[outside]);
    assert!(sensed(&mapper).contains(&(48, 25)));
    let far = at(f64::NAN, 1e300, 0.0);
    assert_eq!(mapper.sense(far, &[outside]).area(), 0);
}

#[test]
fn a_reading_that_shows_nothing_leaves_the_map_alone() {
    let mut mapper = mapper("");
    let shows_nothing = [RangeStatus::Nothing, RangeStatus::Invalid, RangeStatus::Absent];
    let one = shows_nothing.map(|status| vec![reading(status, 0.5)]);
    for readings in one.into_iter().chain([vec![], vec![echo(2.1)]]) {
        mapper.sense(start(), &readings);
    }
    assert_eq!(sensed(&mapper), []);
    assert_eq!(mapper.state().version, 1);
}

#[test]
fn four_centimetres_or_nearer_is_mapped_just_ahead_and_never_under_the_robot() {
    let mut mapper = mapper("");
    mapper.sense(start(), &[reading(RangeStatus::AtContact, 0.0)]);
    let marked = sensed(&mapper);
    assert!(marked.contains(&(27, 25)), "{marked:?}");
    for (col, row) in marked {
        let centre = mapper.frame().centre_of(Cell { col, row });
        assert!(centre.length() > 0.19, "({col}, {row}) lies under the robot");
    }
}

#[test]
fn a_priori_shapes_are_hazard_from_the_start_and_after_a_reset() {
    let mut mapper = mapper("[[known.drum]]\nat = [1.0, 1.0]\nradius_m = 0.2");
    let known = |mapper: &Mapper| mapper.cells(|cell| cell == Known).len();
    let before = known(&mapper);
    // A disc of 0.2 + 0.15 m has about pi 3.5^2 = 38 cells.
    assert!((34..=42).contains(&before), "{before} cells");
    mapper.sense(start(), &[echo(0.5)]);
    assert!(mapper.reset(1) && !mapper.reset(1));
    assert_eq!((known(&mapper), sensed(&mapper).len()), (before, 0));
}

#[test]
fn without_sensing_nothing_that_the_sonar_gives_is_mapped_by_either_method() {
    for method in ["paper", "evidential"] {
        let text = format!(
            "target = [1.5, 0.0]\nmethod = '{method}'\nsensing = false\nknown.drum = [{{ at = [1, 1], radius_m = 0.2 }}]"
        );
        let mut mapper = mapper_of(&text);
        let before = mapper.state().cells.to_vec();
        assert!(before.contains(&(Known as u8)), "{method}");
        for _ in 0..10 {
            mapper.sense(start(), &[echo(0.5)]);
        }
        assert_eq!(mapper.state().cells, before, "{method}");
        assert_eq!(mapper.state().safety_events, 0, "{method}");
    }
}

#[test]
fn a_contact_is_hazard_where_the_body_touches_by_the_papers_method() {
    let mut mapper = mapper("");
    mapper.touch(FRAC_PI_2);
    assert!(mapper.is_hazard(0, 30));
    assert!(!mapper.is_hazard(0, -30) && !mapper.hazard_ahead(0));
}

#[test]
fn the_cell_of_the_target_is_free_as_long_as_the_robot_is_sent_there() {
    for method in ["paper", "evidential"] {
        let drum = "known.drum = [{ at = [-1.5, 0], radius_m = 0.2 }]";
        let text = format!("target = [1.5, 0.0]\nmethod = '{method}'\n{drum}");
        let mut mapper = mapper_of(&text);
        // Listed targets may lie in a drum's margin.
        assert_eq!(mapper.ahead(-125), Known, "{method}");
        let send = |mapper: &mut Mapper, x| {
            let target = Some(dvec2(x, 0.0));
            mapper.give(Tick { target, ..Tick::default() }).area()
        };
        let version = mapper.state().version;
        assert_eq!(send(&mut mapper, -1.25), 1, "{method}");
        assert!(!mapper.hazard_ahead(-125), "{method}");
        assert_eq!(mapper.state().version, version + 1, "{method}");
        let mut restored = mapper.clone();
        restored.restore(mapper.state().clone()).unwrap();
        assert_eq!(restored.state().target, dvec2(-1.25, 0.0));
        assert_eq!(send(&mut restored, 1.5), 1, "{method}");
        assert_eq!(restored.ahead(-125), Known, "{method}");
        // Nor do echoes at it make it hazard.
        for _ in 0..3 {
            restored.sense(at(0.8, 0.0, 0.0), &[echo(0.5)]);
        }
        assert!(restored.hazard_ahead(140) && !restored.hazard_ahead(150), "{method}");
    }
}

#[test]
fn zones_are_hazard_by_either_method_and_what_was_sensed_shows_again_without_them() {
    let zone = |x: f64| {
        let points = [(x, -1.0), (x + 0.5, -1.0), (x + 0.5, -0.5), (x, -0.5)].map(DVec2::from);
        Zone { points: points.to_vec() }
    };
    for method in ["paper", "evidential"] {
        let mut mapper = mapper_of(&format!(
            "target = [1.5, 1.0]\nmethod = '{method}'\nperimeter = {{ width_m = 5, cells = 50 }}\n\
             [[zone]]\npoints = [[-1.0, -1.0], [-0.5, -1.0], [-0.5, -0.5], [-1.0, -0.5]]"
        ));
        let fresh = mapper.clone();
        assert_eq!(mapper.state_at(-75, -75), Known);
        assert_eq!(mapper.state_at(-100, -40), Known, "the body has a radius");
        assert!(!mapper.hazard_ahead(0));
        let set = |mapper: &mut Mapper, zones| mapper.step(Input::Zones(zones), MissionTime(0));
        assert_eq!(set(&mut mapper, vec![zone(1.0)]), Change::Whole);
        assert!(!mapper.is_hazard(-75, -75), "{method}");
        assert_eq!(mapper.state_at(125, -75), Known);
        // The target moves away from the zone, and its cell becomes hazard again.
        let tick = |target| Tick { target: Some(target), ..Tick::default() };
        mapper.give(tick(dvec2(1.25, -0.45)));
        assert!(!mapper.is_hazard(125, -45));
        mapper.give(tick(dvec2(1.5, 1.0)));
        assert_eq!(mapper.state_at(125, -45), Known);
        assert!(mapper.reset(1));
        assert_eq!(mapper.state_at(125, -75), Known, "a reset forgets no zone");
        set(&mut mapper, vec![zone(-1.0)]);
        assert_eq!(mapper.hazards(), fresh.hazards(), "{method}");
    }
}
