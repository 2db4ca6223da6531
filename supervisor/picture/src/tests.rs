//! Tests of the picture, on a true harmonic field and on unusual scenes.

use std::path::Path;

use common::{
    geometry::distance_to_segment,
    grid::{Cell, CellState},
    kinematics::Pose2,
    mission::Mission,
    samples::FieldCell,
};
use glam::DVec2;

use super::{Facts, Scene, svg};

/// The owned data of a run.
struct Run {
    mission: Mission,
    grid: Vec<u8>,
    field: Vec<FieldCell>,
    believed: Vec<Pose2>,
    truth: Vec<Pose2>,
    captions: Vec<String>,
}

impl Run {
    fn scene(&self) -> Scene<'_> {
        let frame = self.mission.grid_frame();
        let path_length_m =
            self.truth.windows(2).map(|pair| pair[0].position.distance(pair[1].position)).sum();
        Scene {
            mission: &self.mission,
            grid: Some((frame, &self.grid)),
            field: Some((frame, &self.field)),
            believed: &self.believed,
            covariance: Some([0.04, 0.03, 0.09]),
            truth: &self.truth,
            targets: &[],
            facts: Facts {
                outcome: "reached",
                reached: true,
                mission_time_s: (self.truth.len().max(1) - 1) as f64 / 7.0,
                path_length_m,
                straight_m: self.mission.target.length(),
                safety_events: 14,
                seed: Some(self.mission.seed),
            },
            captions: &self.captions,
        }
    }
}

fn mission(cells: u32) -> Mission {
    let text = format!(
        "name = 'three-drums'
        target = [4.4, 1.2]
        [mapper]
        margin_m = 0
        [perimeter]
        width_m = 9
        cells = {cells}
        centre = [2, 0]
        [[known.box]]
        at = [2.4, -2.6]
        size_m = [1.6, 0.6]
        angle_deg = 20
        [[world.drum]]
        at = [1.3, 0.1]
        radius_m = 0.35
        [[world.drum]]
        at = [2.5, 1.5]
        radius_m = 0.45
        [[world.drum]]
        at = [3.1, -0.4]
        radius_m = 0.35
        [[world.box]]
        at = [2.4, -2.6]
        size_m = [1.6, 0.6]
        angle_deg = 20
        [[world.wall]]
        points = [[-1.2, 2.6], [0.6, 2.6], [0.6, 1.7]]"
    );
    Mission::parse(&text, Path::new("three-drums.toml")).unwrap()
}

/// The belief of a robot that came along y = 0: the near sides of the shapes there.
fn belief(mission: &Mission) -> Vec<u8> {
    let frame = mission.grid_frame();
    let margin = 0.25;
    (0..frame.area() as u32)
        .map(|at| {
            let cell = Cell { col: at % frame.cells, row: at / frame.cells };
            let point = frame.centre_of(cell);
            let faces_start = |centre: DVec2| (point - centre).dot(centre) < 0.0;
            let at_wall = |nth: usize| {
                let corners = &mission.world.walls[0].points;
                distance_to_segment(point, corners[nth], corners[nth + 1]) < margin
            };
            let sensed = mission.world.drums.iter().any(|drum| {
                (point.distance(drum.at) - drum.radius_m).abs() < margin && faces_start(drum.at)
            }) || at_wall(1);
            let state = if frame.is_rim(cell) {
                CellState::Perimeter
            } else if mission.known.clearance(point) < margin {
                CellState::Known
            } else if sensed {
                CellState::Sensed
            } else {
                CellState::Free
            };
            state as u8
        })
        .collect()
}

/// u of (11) by over-relaxation, and E from it.
fn harmonic(mission: &Mission, grid: &[u8], sweeps: usize) -> Vec<FieldCell> {
    let frame = mission.grid_frame();
    let across = frame.cells as usize;
    let target = frame.index(frame.cell_at(mission.target).unwrap());
    let mut u = vec![0.0_f64; grid.len()];
    u[target] = 1.0;
    for _ in 0..sweeps {
        for at in (0..grid.len()).filter(|&at| grid[at] == 0 && at != target) {
            let mean = (u[at - 1] + u[at + 1] + u[at - across] + u[at + across]) / 4.0;
            u[at] += 1.9 * (mean - u[at]);
        }
    }
    let cell = |at: usize| {
        if grid[at] != 0 {
            return FieldCell { log2_u: f32::NEG_INFINITY, ..FieldCell::default() };
        }
        let rise = DVec2::new(u[at + 1] - u[at - 1], u[at + across] - u[at - across]);
        let e = if at == target { DVec2::ZERO } else { rise.normalize_or_zero() };
        FieldCell { ex: e.x as f32, ey: e.y as f32, log2_u: u[at].log2() as f32 }
    };
    (0..grid.len()).map(cell).collect()
}

/// A robot that turns towards E, and what it believes with a wheel that is a little too large.
fn drive(mission: &Mission, field: &[FieldCell]) -> (Vec<Pose2>, Vec<Pose2>) {
    let frame = mission.grid_frame();
    let (mut truth, mut believed) = (vec![mission.start_pose()], vec![mission.start_pose()]);
    while truth.len() < 7 * 60 {
        let (here, believed_here) = (truth[truth.len() - 1], believed[believed.len() - 1]);
        let to_go = here.position.distance(mission.target);
        if to_go < mission.arrival_tolerance_m {
            break;
        }
        let e = frame.cell_at(here.position).map_or(DVec2::ZERO, |cell| {
            let cell = field[frame.index(cell)];
            DVec2::new(cell.ex.into(), cell.ey.into())
        });
        let turn = (here.axis().perp_dot(e) * 1.8).clamp(-0.8, 0.8) / 7.0;
        let arc = 0.3 / 7.0 * here.axis().dot(e).max(0.1) * (to_go / 0.4).min(1.0);
        truth.push(here.along_arc(arc, turn));
        believed.push(believed_here.along_arc(arc * 1.01, turn * 1.06));
    }
    (truth, believed)
}

fn three_drums() -> Run {
    let mission = mission(120);
    let grid = belief(&mission);
    let field = harmonic(&mission, &grid, 3000);
    let (truth, believed) = drive(&mission, &field);
    Run {
        mission,
        grid,
        field,
        believed,
        truth,
        captions: vec![
            "Least true clearance 0.11 m · pose error at the end 0.08 m · 1 full solve".to_owned(),
            "Tick latency 310 µs (median), 520 µs (99 %) · no restarts".to_owned(),
        ],
    }
}

/// Pseudorandom numbers, the same in every run of the tests.
struct Dice(u64);

impl Dice {
    fn next(&mut self) -> u64 {
        // This is Knuth's MMIX generator, whose low bits are poor.
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.0 >> 33
    }

    /// A number that is mostly ordinary, at times an extreme one.
    fn number(&mut self) -> f64 {
        match self.next() % 12 {
            0 => f64::NAN,
            1 => f64::NEG_INFINITY,
            2 => 1e300,
            3 => -1e12,
            _ => (self.next() % 4000) as f64 / 200.0 - 10.0,
        }
    }

    fn poses(&mut self) -> Vec<Pose2> {
        (0..self.next() % 200)
            .map(|_| Pose2 {
                position: DVec2::new(self.number(), self.number()),
                heading: self.number(),
            })
            .collect()
    }

    fn run(&mut self, cells: u32) -> Run {
        let mut mission = mission(cells);
        mission.name = "a <\"name\"> & \u{7} more".to_owned();
        let area = mission.grid_frame().area();
        Run {
            grid: (0..area).map(|_| (self.next() % 6) as u8).collect(),
            field: (0..area)
                .map(|_| FieldCell {
                    ex: self.number() as f32,
                    ey: self.number() as f32,
                    log2_u: self.number() as f32,
                })
                .collect(),
            believed: self.poses(),
            truth: self.poses(),
            captions: vec!["]]> <!-- \u{0} &amp;".to_owned(); self.next() as usize % 12],
            mission,
        }
    }
}

/// Assert that every tag is closed in order, every attribute is quoted, and no stray `<`, `&` or control character is
/// left.
fn assert_well_formed(xml: &str) {
    let mut open = Vec::new();
    let mut rest = xml;
    while let Some((text, tail)) = rest.split_once('<') {
        assert_characters(text);
        let (tag, after) = tail.split_once('>').unwrap();
        rest = after;
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name));
            continue;
        }
        let body = tag.strip_suffix('/').unwrap_or(tag);
        let name = body.split(' ').next().unwrap();
        assert!(name.chars().all(char::is_alphabetic), "<{tag}>");
        let mut quoted = body[name.len()..].split('"');
        let mut before = quoted.next().unwrap();
        while let Some(value) = quoted.next() {
            let key = before.trim().strip_suffix('=');
            assert!(key.is_some_and(|key| !key.contains(' ')), "<{tag}>");
            assert_characters(value);
            before = quoted.next().unwrap();
        }
        assert!(before.trim().is_empty(), "<{tag}>");
        if body == tag {
            open.push(name);
        }
    }
    assert!(open.is_empty() && rest.trim().is_empty());
}

fn assert_characters(text: &str) {
    assert!(!text.contains('>') && !text.chars().any(|c| c.is_control() && c != '\n'));
    for reference in text.split('&').skip(1) {
        let name = reference.split(';').next().unwrap();
        assert!(["lt", "gt", "amp", "quot"].contains(&name), "&{reference}");
    }
}

fn assert_numbers(xml: &str) {
    assert!(!xml.contains("NaN") && !xml.contains("inf"), "not a number");
}

#[test]
fn any_scene_makes_well_formed_xml_without_nan() {
    let mut dice = Dice(1);
    for round in 0..60 {
        let run = dice.run(10 + round);
        let mut scene = run.scene();
        scene.facts.mission_time_s = dice.number();
        scene.facts.path_length_m = dice.number();
        scene.facts.straight_m = 0.0;
        let picture = svg(&scene);
        assert_well_formed(&picture);
        assert_numbers(&picture);
    }
}

#[test]
fn a_run_that_ended_at_once_still_makes_a_picture() {
    let run = three_drums();
    let mut scene = run.scene();
    (scene.grid, scene.field) = (None, None);
    (scene.believed, scene.truth) = (&[], &[]);
    let picture = svg(&scene);
    assert_well_formed(&picture);
    assert_numbers(&picture);
    assert!(picture.contains("three-drums"));

    // A field of another size than its frame says is not drawn.
    scene.field = Some((run.mission.grid_frame(), &run.field[1..]));
    assert_eq!(svg(&scene), picture);
}

#[test]
fn a_field_of_1024_cells_a_side_stays_below_400_kb_even_in_shreds() {
    let run = Dice(2).run(1024);
    let size = svg(&run.scene()).len();
    assert!(size < 400_000, "{size} bytes");
}

#[test]
fn far_poses_leave_no_far_coordinates() {
    let mut run = three_drums();
    run.truth.extend(
        [1e3, -1e9, 1e300].map(|x| Pose2 { position: DVec2::new(x, 2.0 * x), heading: 0.0 }),
    );
    let picture = svg(&run.scene());
    let far = picture
        .split('#')
        .flat_map(|after| {
            let past_colour = after.trim_start_matches(|c: char| c.is_ascii_hexdigit());
            past_colour.split(|c: char| !(c.is_ascii_digit() || c == '.'))
        })
        .filter_map(|number| number.parse::<f64>().ok())
        .filter(|number| *number > 1200.0);
    // The address of the SVG namespace holds the one other large number, its year.
    assert_eq!(far.collect::<Vec<_>>(), [2000.0]);
}

#[test]
fn the_same_scene_gives_the_same_bytes() {
    let run = three_drums();
    assert_eq!(svg(&run.scene()), svg(&run.scene()));
}

#[test]
fn what_is_low_is_dashed_what_is_of_glass_dash_dotted_what_is_soft_dotted_and_the_legend_says_so() {
    let drawn = |profile: &str| {
        let mut run = three_drums();
        let text =
            format!("target = [3, 0]\nworld.drum = [{{ at = [1, 1], radius_m = 0.3{profile} }}]");
        run.mission = Mission::parse(&text, Path::new("m.toml")).unwrap();
        let picture = svg(&Scene { grid: None, field: None, ..run.scene() });
        assert_well_formed(&picture);
        ["drum, box, wall", "low or overhanging", ">glass<", "absorbs sound"]
            .map(|words| picture.contains(words))
    };
    assert_eq!(drawn(""), [true, false, false, false]);
    assert_eq!(drawn(", top_m = 0.1"), [false, true, false, false]);
    assert_eq!(drawn(", bottom_m = 0.2"), [false, true, false, false]);
    assert_eq!(drawn(", echo = 0.2"), [false, false, false, true]);
    assert_eq!(drawn(", light = 'glass'"), [false, false, true, false]);
}

#[test]
fn the_region_of_the_believed_end_is_the_covariances_ellipse_of_95_percent() {
    let run = three_drums();
    let mut scene = run.scene();
    // Standard deviations of 0.2 and 0.1 m: the half axes are 2.45 times as long.
    let per_metre = 800.0 / run.mission.perimeter.width_m;
    let [long, short] = [0.2, 0.1].map(|sigma| 2.4477 * sigma * per_metre);
    let axes = format!("<ellipse rx=\"{long:.1}\" ry=\"{short:.1}\"");
    scene.covariance = Some([0.04, 0.0, 0.01]);
    let along_x = svg(&scene);
    assert!(along_x.contains(&axes) && along_x.contains("rotate(0)"), "{axes}");
    // The sheet's y axis points down.
    scene.covariance = Some([0.025, 0.015, 0.025]);
    let diagonal = svg(&scene);
    assert!(diagonal.contains(&axes) && diagonal.contains("rotate(-45)"));
    scene.covariance = None;
    assert!(!svg(&scene).contains("<ellipse"));
}
