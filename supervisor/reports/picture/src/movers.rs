//! Tracks of movers. Equal numbers mark simultaneous places of mover and robot.

use common::kinematics::Pose2;
use glam::DVec2;

use super::{
    motion::Motion,
    page::{Path, View, ink, text},
    scene::{Scene, Trail},
};

const LEAST_S: f64 = 1.0;
/// Most tracks drawn, the longest of a run.
const MOST_WAYS: usize = 24;

pub(super) struct Movers<'a> {
    trails: Vec<&'a Trail<'a>>,
    /// Disc times, every second one of the body's, and the robot's poses.
    instants: Vec<(f64, &'a Pose2)>,
    body_m: f64,
}

impl<'a> Movers<'a> {
    pub(super) fn of(scene: &'a Scene<'a>, motion: &Motion<'a>) -> Self {
        let mut trails: Vec<_> = scene.trails.iter().filter(|it| lasts_s(it) >= LEAST_S).collect();
        trails.sort_by(|one, other| lasts_s(other).total_cmp(&lasts_s(one)));
        trails.truncate(MOST_WAYS);
        let instants =
            motion.instants().skip(2).step_by(2).filter(|_| !trails.is_empty()).collect();
        Self { trails, instants, body_m: scene.mission.body().radius_m }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.trails.is_empty()
    }

    /// Returns the seconds between discs; `None` if they have no numbers.
    pub(super) fn period_s(&self) -> Option<f64> {
        self.instants.first().map(|(at_s, _)| *at_s)
    }

    pub(super) fn layer(&self, view: &View) -> String {
        let ways: String = self
            .trails
            .iter()
            .map(|it| view.line(it.places.iter().map(|(_, at)| *at)))
            .map(|way| way.element(&line()))
            .collect();
        let (mut discs, mut robots, mut numbers) =
            (Path::default(), Path::default(), String::new());
        for (at_s, robot) in &self.instants {
            let mut number = |at: DVec2| numbers += &number(view.place(at), *at_s);
            for trail in &self.trails {
                let Some(at) = place_at(trail.places, *at_s) else { continue };
                if view.shows(at, 0.0) && trail.radius_m.is_finite() {
                    discs.circle(view.place(at), view.px(trail.radius_m));
                    number(at);
                }
            }
            if view.shows(robot.position, 0.0) {
                robots.circle(view.place(robot.position), view.px(self.body_m));
                number(robot.position);
            }
        }
        [ways, discs.element(&disc()), robots.element(ROBOT), numbers].concat()
    }
}

fn lasts_s(trail: &Trail<'_>) -> f64 {
    trail
        .places
        .first()
        .zip(trail.places.last())
        .map_or(0.0, |((from_s, _), (until_s, _))| until_s - from_s)
}

fn place_at(places: &[(f64, DVec2)], at_s: f64) -> Option<DVec2> {
    let next = places.partition_point(|(then_s, _)| *then_s < at_s);
    let (after_s, after) = places.get(next)?;
    if *after_s == at_s {
        return Some(*after);
    }
    let (before_s, before) = places.get(next.checked_sub(1)?)?;
    Some(before.lerp(*after, (at_s - before_s) / (after_s - before_s)))
}

const ROBOT: &str = "fill=\"#fff\" fill-opacity=\"0.5\" stroke=\"#0b0f14\" stroke-width=\"2\"";

pub(super) fn line() -> String {
    let colour = ink::MOVER;
    format!("fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.3\" stroke-dasharray=\"3 3\"")
}

pub(super) fn disc() -> String {
    format!("fill=\"{0}\" fill-opacity=\"0.18\" stroke=\"{0}\" stroke-width=\"1.2\"", ink::MOVER)
}

pub(super) fn number(at: DVec2, at_s: f64) -> String {
    let style = " text-anchor=\"middle\" font-size=\"12\" font-weight=\"700\" stroke=\"#fff\" \
         stroke-width=\"3\" paint-order=\"stroke\"";
    text(at + DVec2::Y * 4.0, style, &format!("{}", (at_s * 10.0).round() / 10.0))
}
