//! Trial: a mission in a solvable world, and its rules of judgement.

use common::{
    geometry::Shapes,
    mission::{Heights, Mission, Person, Realism, Thing},
};
use glam::DVec2;
use mission_control::outcome::RIGHT_PLACE_M;
use std::iter;

use crate::error::Result;
use report::shortest_path::shortest_path;

/// Step of the perimeter's width: a whole number of cells by both methods.
const WIDTH_STEP_M: f64 = 0.1;
const RIM_M: f64 = 0.6;
/// Free ground on each side of the body in a world's narrowest passage.
const MARGIN_M: f64 = 0.05;
/// Mission time allowed beside [`Rules::most_s`], for turning before the clock starts.
const BEFORE_CLOCK_S: f64 = 20.0;

pub fn swept_m(mission: &Mission) -> f64 {
    mission.body().radius_m + MARGIN_M
}

#[derive(Clone, Copy, Debug)]
pub struct Rules {
    /// Distance from the target beyond which an arrival is in the wrong place.
    pub success_within_m: f64,
    /// Whether the clock starts once the robot has moved 0.1 m, as in BARN, or with the mission.
    pub clock_after_departure: bool,
    /// Time limit of a success after the clock's start; none if the mission's timeout limits it.
    pub most_s: Option<f64>,
    pub scored: bool,
    /// Time of the reference path at 2 m/s, for the score; none if the body's shortest path
    /// replaces it.
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

/// World with a start and a target, in the frame of its source.
#[derive(Debug, Default)]
pub struct Scene {
    pub shapes: Shapes,
    /// The shortest path ignores these and `people`.
    pub things: Vec<Thing>,
    pub people: Vec<Person>,
    pub start: DVec2,
    /// Counter-clockwise from x.
    pub heading: f64,
    pub target: DVec2,
    /// Start heading of another robot that drives from target to start.
    pub oncoming: Option<f64>,
}

#[derive(Clone, Debug)]
pub struct Trial {
    /// Its name is that of the world.
    pub mission: Mission,
    pub shortest_m: f64,
    pub rules: Rules,
    pub oncoming: Option<Box<Self>>,
}

impl Trial {
    /// Returns a trial, if the body can reach the target with `swept_m` around its centre.
    pub fn new(world: &str, scene: Scene, rules: Rules, swept_m: f64) -> Result<Option<Self>> {
        let oncoming = scene.oncoming;
        let touched = Heights::preset(Realism::default()).touched(&scene.shapes);
        let Some(shortest_m) = shortest_path(&touched, scene.start, scene.target, swept_m) else {
            return Ok(None);
        };
        let mut mission = mission(world, scene)?;
        // Four times the time at 0.25 m/s, plus half a minute.
        let timeout_s = (30.0 + 16.0 * shortest_m).round();
        mission.timeout_s = rules.most_s.map_or(timeout_s, |it| it + BEFORE_CLOCK_S);
        let mut trial = Self { mission, shortest_m, rules, oncoming: None };
        trial.oncoming = oncoming.map(|heading| Box::new(trial.reversed(heading)));
        Ok(Some(trial))
    }

    /// Returns a trial of an unchanged `mission`.
    pub fn of_mission(mission: Mission, swept_m: f64) -> Option<Self> {
        let start = mission.start_pose().position;
        let shortest_m = shortest_path(&mission.obstacles(), start, mission.target, swept_m)?;
        Some(Self { mission, shortest_m, rules: Rules::PLAIN, oncoming: None })
    }

    pub fn robots(&self) -> impl Iterator<Item = &Self> {
        iter::once(self).chain(self.oncoming.as_deref())
    }

    fn reversed(&self, heading: f64) -> Self {
        let mut trial = self.clone();
        trial.mission.name += "-oncoming";
        trial.mission.start.at = self.mission.target;
        trial.mission.start.heading_deg = heading.to_degrees();
        trial.mission.target = self.mission.start.at;
        trial
    }
}

fn mission(world: &str, scene: Scene) -> Result<Mission> {
    let Scene { mut shapes, mut things, mut people, start, heading, target, .. } = scene;
    let target = target - start;
    let placed = things.iter_mut().map(|thing| &mut thing.shape);
    let walked = people.iter_mut().flat_map(|it| iter::once(&mut it.at).chain(&mut it.goals));
    let all = iter::once(&mut shapes).chain(placed).flat_map(points).chain(walked);
    all.for_each(|point| *point -= start);
    let (least, greatest) = shapes.bounds_with(DVec2::ZERO, target);
    let centre = (least + greatest) / 2.0;
    let width_m =
        (((greatest - least).max_element() + 2.0 * RIM_M) / WIDTH_STEP_M).ceil() * WIDTH_STEP_M;
    let text = format!(
        "target = [{:?}, {:?}]\nperimeter = {{ width_m = {width_m:?}, centre = [{:?}, {:?}] }}",
        target.x, target.y, centre.x, centre.y,
    );
    let mut mission = Mission::parse(&text, world)?;
    mission.name = world.to_owned();
    mission.start.heading_deg = heading.to_degrees();
    mission.world = shapes;
    (mission.simulation.things, mission.simulation.people) = (things, people);
    Ok(mission)
}

pub fn points(shapes: &mut Shapes) -> impl Iterator<Item = &mut DVec2> {
    let Shapes { drums, boxes, walls } = shapes;
    let drums = drums.iter_mut().map(|drum| &mut drum.at);
    let boxes = boxes.iter_mut().map(|block| &mut block.at);
    drums.chain(boxes).chain(walls.iter_mut().flat_map(|wall| &mut wall.points))
}
