//! A trial: a mission in a solvable world, and the rules of its judgement.

use common::{
    geometry::Shapes,
    mission::{Heights, Mission, Person, Realism, Thing},
};
use glam::DVec2;
use mission_control::outcome::RIGHT_PLACE_M;
use std::path::Path;

use crate::error::Result;
use report::shortest_path::shortest_path;

/// The perimeter's width is a multiple of this, metres: a whole number of cells by both methods.
const WIDTH_STEP_M: f64 = 0.1;
/// Free ground between the things of a world and the perimeter, metres.
const RIM_M: f64 = 0.6;
/// Free ground on both sides of the body in the narrowest way of a world, metres.
const MARGIN_M: f64 = 0.05;
/// Mission seconds allowed beside those of [`Rules::most_s`], to turn before the clock starts.
const BEFORE_CLOCK_S: f64 = 20.0;

/// Half the width of the narrowest passage for the robot of `mission`, metres.
pub fn swept_m(mission: &Mission) -> f64 {
    mission.body().radius_m + MARGIN_M
}

/// The rules by which the ground truth judges a mission.
#[derive(Clone, Copy, Debug)]
pub struct Rules {
    /// Distance from the target beyond which an arrival is in the wrong place, metres.
    pub success_within_m: f64,
    /// Whether the clock starts once the robot has moved 0.1 m, as BARN's does, or with the mission.
    pub clock_after_departure: bool,
    /// Time after the clock's start within which an arrival is a success, seconds; none if the mission's timeout limits it.
    pub most_s: Option<f64>,
    pub scored: bool,
    /// Time of the reference path at 2 m/s, seconds, for the score; none if the shortest path of the body takes its place.
    pub optimal_time_s: Option<f64>,
}

impl Rules {
    pub const PLAIN: Self = Self {
        success_within_m: RIGHT_PLACE_M,
        clock_after_departure: false,
        most_s: None,
        scored: false,
        optimal_time_s: None,
    };
}

/// A world with a start and a target, in the frame of the world it comes from.
#[derive(Debug, Default)]
pub struct Scene {
    pub shapes: Shapes,
    /// The things that move in the world; the shortest path does not regard them.
    pub things: Vec<Thing>,
    /// Likewise.
    pub people: Vec<Person>,
    pub start: DVec2,
    /// Heading at the start, radians counter-clockwise from x.
    pub heading: f64,
    pub target: DVec2,
    /// Heading at the start of another robot, which goes from the target to the start.
    pub oncoming: Option<f64>,
}

#[derive(Clone, Debug)]
pub struct Trial {
    pub world: String,
    /// The mission, its origin at the start of the robot.
    pub mission: Mission,
    /// Length of the body's shortest path, metres.
    pub shortest_m: f64,
    pub rules: Rules,
    pub oncoming: Option<Box<Self>>,
}

impl Trial {
    /// The trial `world` in `scene`, if the body can get from start to target with `swept_m` around its centre.
    pub fn new(world: String, scene: &Scene, rules: Rules, swept_m: f64) -> Result<Option<Self>> {
        let touched = Heights::preset(Realism::default()).touched(&scene.shapes);
        let Some(shortest_m) = shortest_path(&touched, scene.start, scene.target, swept_m) else {
            return Ok(None);
        };
        let mut mission = mission(&world, scene)?;
        // Four times the time of a robot at 0.25 m/s, and half a minute.
        let timeout_s = (30.0 + 16.0 * shortest_m).round();
        mission.timeout_s = rules.most_s.map_or(timeout_s, |it| it + BEFORE_CLOCK_S);
        let mut trial = Self { world, mission, shortest_m, rules, oncoming: None };
        trial.oncoming = scene.oncoming.map(|heading| Box::new(trial.reversed(heading)));
        Ok(Some(trial))
    }

    /// The trial `world` of an unchanged `mission`, if a body can get from start to target in its world.
    pub fn of_mission(world: String, mission: Mission, swept_m: f64) -> Option<Self> {
        let start = mission.start_pose().position;
        let shortest_m = shortest_path(&mission.obstacles(), start, mission.target, swept_m)?;
        Some(Self { world, mission, shortest_m, rules: Rules::PLAIN, oncoming: None })
    }

    pub fn robots(&self) -> impl Iterator<Item = &Self> {
        std::iter::once(self).chain(self.oncoming.as_deref())
    }

    /// The trial of a robot that goes the other way.
    fn reversed(&self, heading: f64) -> Self {
        let mut trial = self.clone();
        trial.world = format!("{}-oncoming", self.world);
        trial.mission.name.clone_from(&trial.world);
        trial.mission.start.at = self.mission.target;
        trial.mission.start.heading_deg = heading.to_degrees();
        trial.mission.target = self.mission.start.at;
        trial
    }
}

/// The mission of `scene`: origin at the start, x along the x of the scene's own frame.
fn mission(world: &str, scene: &Scene) -> Result<Mission> {
    let target = scene.target - scene.start;
    let shapes = moved(&scene.shapes, -scene.start);
    // The bounding box of shapes, origin and target.
    let (least, greatest) = shapes.pieces().map(|piece| piece.bounds()).fold(
        (DVec2::ZERO.min(target), DVec2::ZERO.max(target)),
        |(least, greatest), (from, to)| (least.min(from), greatest.max(to)),
    );
    let centre = (least + greatest) / 2.0;
    let width_m =
        (((greatest - least).max_element() + 2.0 * RIM_M) / WIDTH_STEP_M).ceil() * WIDTH_STEP_M;
    let text = format!(
        "target = [{:?}, {:?}]\nperimeter = {{ width_m = {width_m:?}, centre = [{:?}, {:?}] }}",
        target.x, target.y, centre.x, centre.y,
    );
    let mut mission = Mission::parse(&text, Path::new(world))?;
    mission.name = world.to_owned();
    mission.start.heading_deg = scene.heading.to_degrees();
    mission.world = shapes;
    let placed = scene.things.iter().cloned();
    mission.simulation.things =
        placed.map(|it| Thing { shape: moved(&it.shape, -scene.start), ..it }).collect();
    mission.simulation.people = scene.people.clone();
    for person in &mut mission.simulation.people {
        std::iter::once(&mut person.at).chain(&mut person.goals).for_each(|at| *at -= scene.start);
    }
    Ok(mission)
}

/// `shapes` moved by `by`, metres.
fn moved(shapes: &Shapes, by: DVec2) -> Shapes {
    let mut shapes = shapes.clone();
    points(&mut shapes).for_each(|point| *point += by);
    shapes
}

pub fn points(shapes: &mut Shapes) -> impl Iterator<Item = &mut DVec2> {
    let Shapes { drums, boxes, walls } = shapes;
    let drums = drums.iter_mut().map(|drum| &mut drum.at);
    let boxes = boxes.iter_mut().map(|block| &mut block.at);
    drums.chain(boxes).chain(walls.iter_mut().flat_map(|wall| &mut wall.points))
}
