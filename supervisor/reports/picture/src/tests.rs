//! Tests of the picture, on an ordinary run and on unusual scenes.

use common::{grid::CellState, kinematics::Pose2, mission::Mission, samples::FieldCell};
use glam::DVec2;

use super::{Facts, Scene, Trail, svg};

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
            trails: &[],
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
    Mission::parse(&text, "three-drums.toml").unwrap()
}

fn three_drums() -> Run {
    let mission = mission(120);
    let frame = mission.grid_frame();
    let state = |cell| match (frame.is_rim(cell), mission.known.clearance(frame.centre_of(cell))) {
        (true, _) => CellState::Perimeter as u8,
        (false, clearance) if clearance < 0.25 => CellState::Known as u8,
        (false, _) => CellState::Free as u8,
    };
    let policy = |cell| {
        let way = mission.target - frame.centre_of(cell);
        let e = way.normalize_or_zero();
        FieldCell { ex: e.x as f32, ey: e.y as f32, log2_u: -way.length() as f32 }
    };
    let poses = |aside: f64| {
        let pose = |nth: u32| Pose2 {
            position: mission.target * f64::from(nth) / 100.0 + DVec2::Y * aside,
            heading: mission.target.to_angle(),
        };
        (0..100).map(pose).collect()
    };
    Run {
        grid: frame.whole().cells().map(state).collect(),
        field: frame.whole().cells().map(policy).collect(),
        believed: poses(0.1),
        truth: poses(0.0),
        captions: vec!["Least true clearance 0.11 m".to_owned()],
        mission,
    }
}

struct Dice(u64);

impl Dice {
    fn next(&mut self) -> u64 {
        // Knuth's MMIX generator, whose low bits are poor.
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.0 >> 33
    }

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

fn assert_well_formed(xml: &str) {
    roxmltree::Document::parse(xml).unwrap();
    assert!(!xml.contains("NaN") && !xml.contains("inf"), "not a number");
}

#[test]
fn any_scene_makes_well_formed_xml_without_nan_and_the_same_bytes_each_time() {
    let mut dice = Dice(1);
    for round in 0..60 {
        let run = dice.run(10 + round);
        let mut scene = run.scene();
        scene.facts.mission_time_s = dice.number();
        scene.facts.path_length_m = dice.number();
        scene.facts.straight_m = 0.0;
        let mut places: Vec<_> =
            dice.poses().iter().map(|pose| (dice.number(), pose.position)).collect();
        places.sort_by(|one, other| one.0.total_cmp(&other.0));
        let radius_m = dice.number();
        let trails = [Trail { places: &places, radius_m }];
        scene.trails = &trails;
        let picture = svg(&scene);
        assert_well_formed(&picture);
        assert_eq!(svg(&scene), picture);
    }
}

#[test]
fn a_run_that_ended_at_once_still_makes_a_picture() {
    let run = three_drums();
    let mut scene = Scene { grid: None, field: None, believed: &[], truth: &[], ..run.scene() };
    let picture = svg(&scene);
    assert_well_formed(&picture);
    assert!(picture.contains("three-drums"));

    // A field whose size differs from its frame's is not drawn.
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
    assert_eq!(far.collect::<Vec<_>>(), [2000.0]);
}

#[test]
fn what_is_low_is_dashed_what_is_of_glass_dash_dotted_what_is_soft_dotted_and_the_legend_says_so() {
    let drawn = |profile: &str| {
        let mut run = three_drums();
        let text =
            format!("target = [3, 0]\nworld.drum = [{{ at = [1, 1], radius_m = 0.3{profile} }}]");
        run.mission = Mission::parse(&text, "m.toml").unwrap();
        let picture = svg(&Scene { grid: None, field: None, ..run.scene() });
        assert_well_formed(&picture);
        ["drum, box, wall", "low or overhanging", ">glass<", "absorbs sound"]
            .map(|words| picture.contains(words))
    };
    for (profile, kind) in [
        ("", 0),
        (", top_m = 0.1", 1),
        (", bottom_m = 0.2", 1),
        (", light = 'glass'", 2),
        (", echo = 0.2", 3),
    ] {
        assert_eq!(drawn(profile), [0, 1, 2, 3].map(|it| it == kind), "{profile}");
    }
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

#[test]
fn what_moved_is_on_its_way_where_it_was_at_the_numbered_places_of_the_robot() {
    let run = three_drums();
    let mut scene = run.scene();
    let without = svg(&scene);
    assert!(!without.contains("what moves"), "there is no clutter without movers");
    // It crosses in front of the robot, which takes 14 s; a glimpse of another mover is omitted.
    let at = |nth: u32| (f64::from(nth) * 0.5, DVec2::new(2.0, 2.0 - 0.2 * f64::from(nth)));
    let places: Vec<_> = (0..16).map(at).collect();
    let trails = [&places[..], &places[..2]].map(|places| Trail { places, radius_m: 0.25 });
    scene.trails = &trails;
    let picture = svg(&scene);
    assert_well_formed(&picture);
    assert!(picture.contains("path of what moves"));
    let drawn = |number: &str| {
        let label = format!(">{number}</text>");
        picture.matches(&label).count() - without.matches(&label).count()
    };
    // Bodies are 1 s apart, every second one numbered. The number appears twice while the mover is
    // there, and in the legend, then only on the robot.
    assert_eq!(["2", "4", "6", "8"].map(drawn), [3, 2, 2, 1]);
    // At 4 s it is at (2, 0.4).
    let view = super::View::of(&run.mission.grid_frame());
    let centre = view.place(DVec2::new(2.0, 0.4));
    let (x, y) = (super::page::Px(centre.x), super::page::Px(centre.y + 4.0));
    let label = format!("<text x=\"{x}\" y=\"{y}\" text-anchor=\"middle\" font-size=\"12\"");
    assert!(picture.contains(&label), "{label}");
}
