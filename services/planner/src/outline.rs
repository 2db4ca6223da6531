//! Passage of a body that is not a disc through gaps narrower than its covering circle.
//!
//! Hazards are inflated by half the body's width, so the field leads wherever it may fit. From each
//! pose, the controller's path along the field is followed with its heading. If the outline would
//! touch, a hybrid A* search finds poses to the next open place on the field's way.
//!
//! If the search fails, the body cannot pass. Cells at the narrow place are then refused, at most
//! those that the covering circle would make hazard, and the field leads elsewhere.

use std::{cmp::Reverse, collections::BinaryHeap, collections::HashSet, f64::consts::PI};

use common::{
    geometry::wrap_angle,
    grid::Cell,
    kinematics::{LEAST_SPEED_M_S, Pose2},
    mission::{Footprint, Mission},
    motion_law::MotionLaw,
};
use glam::DVec2;

use crate::view::{STEP_M, View};

/// Speed limits where the covering circle does not fit, forward and back, m/s.
const NARROW_M_S: f64 = 0.5;
const BACK_M_S: f64 = 0.2;
/// Length of the followed controller path, in radii of the covering circle.
const AHEAD: f64 = 2.0;
/// Part of the margin that a touching pose may use to leave, metres.
const SQUEEZED_M: f64 = 0.03;
/// Turn, radians, and length, metres, of a search step: forward along arcs, on the spot, or back.
const TURN_RAD: f64 = PI / 16.0;
const WAY_M: f64 = 0.1;
const STEPS: [[f64; 2]; 6] = [
    [WAY_M, 0.0],
    [WAY_M, TURN_RAD],
    [WAY_M, -TURN_RAD],
    [0.0, TURN_RAD],
    [0.0, -TURN_RAD],
    [-WAY_M, 0.0],
];
/// Cost of a radian, metres; a metre back costs as much as two ahead.
const TURN_COSTS_M: f64 = 0.25;
/// Tolerances of a finished step, radians and metres, and the offset that voids a plan, metres.
const TURNED_RAD: f64 = 0.05;
const ARRIVED_M: f64 = 0.02;
const MOST_OFF_M: f64 = 0.1;
/// Distance to the goal at which the search ends, metres.
const NEAR_M: f64 = 0.15;
const GOAL_WITHIN_M: f64 = 2.0;
const MOST_POSES: usize = 5_000;

/// Motion of the body for a field direction.
#[derive(Clone, Debug)]
pub(crate) enum Passage {
    /// In m/s.
    Follow(f64),
    Turn(DVec2),
    /// Limit in m/s.
    Drive(DVec2, f64),
    /// In m/s, along the axis.
    Back(f64),
    /// Refuse these cells; none if the body cannot move.
    Refused(Vec<Cell>),
}

#[derive(Clone, Debug)]
pub(crate) struct Outline {
    /// Points in the body frame, at most a map cell apart.
    points: Vec<DVec2>,
    half_width: f64,
    covers: f64,
    speed: f64,
    law: MotionLaw,
    brakes_within_s: f64,
    /// Next step last.
    plan: Vec<Planned>,
}

#[derive(Clone, Copy, Debug)]
struct Planned {
    pose: Pose2,
    step: [f64; 2],
}

impl Planned {
    fn is_over(&self, pose: &Pose2) -> bool {
        let [way, turn] = self.step;
        let left_m = (self.pose.position - pose.position).dot(self.pose.axis());
        let left_rad = wrap_angle(self.pose.heading - pose.heading);
        match way == 0.0 {
            true => left_rad * turn.signum() <= TURNED_RAD,
            false => left_m * way.signum() <= ARRIVED_M,
        }
    }

    fn is_elsewhere(&self, pose: &Pose2) -> bool {
        let off = self.pose.position - pose.position;
        let turned = wrap_angle(self.pose.heading - pose.heading).abs();
        match self.step[0] == 0.0 {
            true => off.length() > MOST_OFF_M,
            false => self.pose.axis().perp_dot(off).abs() > MOST_OFF_M || turned > 2.0 * TURN_RAD,
        }
    }
}

#[derive(Clone, Copy)]
struct Reached {
    pose: Pose2,
    from: usize,
    step: [f64; 2],
    cost_m: f64,
}

impl Outline {
    pub(crate) fn new(mission: &Mission, footprint: &Footprint) -> Self {
        let (body, law) = (mission.body(), MotionLaw::new(mission));
        let [smaller, larger] = footprint.half_widths_m();
        assert!(smaller > 0.0 && larger <= body.radius_m + 1e-5);
        Self {
            points: footprint.outline(mission.grid_frame().resolution_m).collect(),
            half_width: smaller,
            covers: body.radius_m,
            speed: law.speed.min(NARROW_M_S),
            law,
            brakes_within_s: mission.brakes_within_s(),
            plan: Vec::new(),
        }
    }

    /// Returns the outline points at `pose` that are nearer to an obstacle than the margin minus
    /// `squeezed` metres.
    fn touching(
        &self,
        view: &View<'_>,
        pose: &Pose2,
        squeezed: f64,
    ) -> impl Iterator<Item = DVec2> {
        let (axis, position, depth) = (pose.axis(), pose.position, self.half_width + squeezed);
        let points = self.points.iter().map(move |point| position + axis.rotate(*point));
        points.filter(move |at| view.is_deep(*at, depth))
    }

    pub(crate) fn touches(&self, view: &View<'_>, pose: &Pose2) -> bool {
        self.comes_near(view, pose, 0.0)
    }

    pub(crate) fn comes_near(&self, view: &View<'_>, pose: &Pose2, apart_m: f64) -> bool {
        self.touching(view, pose, -apart_m.min(self.half_width)).next().is_some()
    }

    pub(crate) fn is_narrow(&self, view: &View<'_>, at: DVec2) -> bool {
        view.has_hazard(at, self.covers - self.half_width)
    }

    pub(crate) fn turns(&self, view: &View<'_>, pose: &Pose2, angle: f64) -> bool {
        let steps = (angle.abs() / TURN_RAD * 2.0).ceil();
        !self.is_narrow(view, pose.position)
            || (1..=steps as u32).all(|step| {
                let turn = angle * f64::from(step) / steps;
                !self.touches(view, &pose.along_arc(0.0, turn))
            })
    }

    /// Returns how a body moves in the field's `direction`, a unit vector.
    pub(crate) fn pass(&mut self, view: &View<'_>, pose: &Pose2, direction: DVec2) -> Passage {
        if let Some(passage) = self.go_on(view, pose) {
            return passage;
        }
        match self.follow(view, pose, direction) {
            Some(false) => Passage::Follow(f64::INFINITY),
            // On the spot, the controller may turn to either side.
            Some(true) if pose.axis().dot(direction) < 0.0 => {
                let left = pose.axis().perp_dot(direction) > 0.0;
                Passage::Turn(if left { pose.axis().perp() } else { -pose.axis().perp() })
            }
            Some(true) => Passage::Follow(self.speed),
            None => match self.search(view, pose, direction) {
                Ok(plan) => {
                    self.plan = plan;
                    self.go_on(view, pose).unwrap_or(Passage::Refused(Vec::new()))
                }
                Err(cells) => Passage::Refused(cells),
            },
        }
    }

    /// Returns a test for poses that fit. A body that touches the margin may leave but come no
    /// nearer.
    fn fits(&self, view: &View<'_>, pose: &Pose2) -> impl Fn(&Pose2) -> bool {
        let (squeezed, allowed) = match self.touches(view, pose) {
            true => (SQUEEZED_M, self.touching(view, pose, SQUEEZED_M).count()),
            false => (0.0, 0),
        };
        move |at| self.touching(view, at, squeezed).nth(allowed).is_none()
    }

    fn go_on(&mut self, view: &View<'_>, pose: &Pose2) -> Option<Passage> {
        while self.plan.pop_if(|next| next.is_over(pose)).is_some() {}
        let Planned { step: [way, turn], .. } = *self.plan.last()?;
        let run = self.plan.iter().rev().take_while(|it| it.step[0] == way);
        let room_m = run.clone().count() as f64 * WAY_M;
        assert!(room_m > 0.0);
        let speed = self.law.response.speed_to_stop_within(room_m, self.brakes_within_s);
        let speed = speed.max(LEAST_SPEED_M_S);
        let fits = self.fits(view, pose);
        let moves = |way, turn| {
            [0.5, 1.0].iter().all(|share| fits(&pose.along_arc(share * way, share * turn)))
        };
        let passage = if way == 0.0 {
            let left = |to: &Planned| wrap_angle(to.pose.heading - pose.heading) * turn.signum();
            let ahead = run.map(left).take_while(|left| *left < PI / 2.0).fold(0.0, f64::max);
            let there = pose.along_arc(0.0, ahead * turn.signum());
            let next = ahead.min(TURN_RAD) * turn.signum();
            moves(0.0, next).then_some(Passage::Turn(there.axis()))
        } else if way < 0.0 {
            let speed = speed.min(BACK_M_S);
            moves(way, 0.0).then_some(Passage::Back(speed))
        } else {
            // Pure pursuit of a place after the next two steps, or the step itself.
            let to = run.take(2).last()?.pose;
            let to = to.position + WAY_M * to.axis() - pose.position;
            let pursuit = 2.0 * pose.axis().perp_dot(to) / to.length_squared();
            let speed = speed.min(self.speed);
            // By (15), the controller's turn rate is proportional to the sine.
            let sines = [pursuit, turn / way].map(|curvature| curvature * speed / self.law.turn);
            let mut sines = sines.into_iter().map(|sine| sine.clamp(-0.9, 0.9));
            let sine = sines.find(|sine| moves(way, way * sine * self.law.turn / speed));
            sine.map(|sine| Passage::Drive(pose.along_arc(0.0, sine.asin()).axis(), speed))
        };
        let is_valid =
            self.plan.iter().all(|it| fits(&it.pose)) && !self.plan.last()?.is_elsewhere(pose);
        drop(fits);
        let passage = passage.filter(|_| is_valid);
        if passage.is_none() {
            self.plan.clear();
        }
        passage
    }

    pub(crate) fn forget_plan(&mut self) {
        self.plan.clear();
    }

    /// Returns whether the controller's path is narrow anywhere; `None` if the body touches on it.
    fn follow(&self, view: &View<'_>, pose: &Pose2, direction: DVec2) -> Option<bool> {
        let (mut at, mut along, mut way, mut narrow) = (*pose, direction, 0.0, false);
        while way < AHEAD * self.covers && along != DVec2::ZERO {
            let (cosine, sine) = (at.axis().dot(along), at.axis().perp_dot(along));
            if cosine < self.law.turns {
                let angle = sine.atan2(cosine);
                at = at.along_arc(0.0, angle.clamp(-TURN_RAD / 2.0, TURN_RAD / 2.0));
            } else {
                at = at.along_arc(STEP_M, STEP_M * self.law.turn * sine / self.speed);
                way += STEP_M;
                along = view.along(at.position);
            }
            if self.is_narrow(view, at.position) {
                narrow = true;
                if self.touches(view, &at) {
                    return None;
                }
            }
        }
        Some(narrow)
    }

    /// Returns the field's way to the next open place, or its whole checked length.
    fn way_out(&self, view: &View<'_>, pose: &Pose2, direction: DVec2) -> Vec<DVec2> {
        let mut way = view.way(pose.position, direction, GOAL_WITHIN_M);
        let is_narrow = |at: &DVec2| self.is_narrow(view, *at);
        let least = ((AHEAD * self.covers / STEP_M) as usize).min(way.len());
        if let Some(open) = way[least..].iter().position(|at| !is_narrow(at)) {
            way.truncate(least + open + 1);
        }
        way
    }

    fn search(
        &self,
        view: &View<'_>,
        pose: &Pose2,
        direction: DVec2,
    ) -> Result<Vec<Planned>, Vec<Cell>> {
        let way = self.way_out(view, pose, direction);
        let goal = way.last().copied().unwrap_or(pose.position);
        let along = view.along(goal);
        let is_open = !self.is_narrow(view, goal);
        let ends = |at: &Pose2| {
            let is_along = along == DVec2::ZERO || at.axis().dot(along).abs() > 0.9;
            at.position.distance(goal) <= NEAR_M && (is_open || is_along)
        };
        let fits = self.fits(view, pose);
        let key = |at: &Pose2| {
            let turn = (wrap_angle(at.heading) / TURN_RAD).round() as i32;
            view.frame.cell_at(at.position).map(|cell| (cell, turn.rem_euclid(32)))
        };
        let mut reached = vec![Reached { pose: *pose, from: 0, step: [0.0; 2], cost_m: 0.0 }];
        let mut open = BinaryHeap::from([(Reverse(0), 0)]);
        let mut closed = HashSet::new();
        while let Some((_, index)) = open.pop()
            && closed.len() < MOST_POSES
        {
            let Reached { pose: at, cost_m, .. } = reached[index];
            if !key(&at).is_some_and(|key| closed.insert(key)) {
                continue;
            }
            if index > 0 && ends(&at) {
                let mut plan = Vec::new();
                let mut index = index;
                while index > 0 {
                    let Reached { pose, step, from, .. } = reached[index];
                    assert!(from < index);
                    plan.push(Planned { pose, step });
                    index = from;
                }
                assert!(!plan.is_empty());
                return Ok(plan);
            }
            for step in STEPS {
                let [way, turn] = step;
                let [middle, end] = [0.5, 1.0].map(|share| at.along_arc(share * way, share * turn));
                let is_known = key(&end).is_none_or(|key| closed.contains(&key));
                if is_known || view.is_hazard(end.position) || !fits(&middle) || !fits(&end) {
                    continue;
                }
                let back = if way < 0.0 { 2.0 } else { 1.0 };
                let cost_m = cost_m + back * way.abs() + TURN_COSTS_M * turn.abs();
                let estimate_mm = 1e3 * (cost_m + end.position.distance(goal));
                assert!(cost_m >= reached[index].cost_m);
                open.push((Reverse(estimate_mm as u32), reached.len()));
                reached.push(Reached { pose: end, from: index, step, cost_m });
            }
        }
        Err(self.refused(view, &way, &reached))
    }

    fn refused(&self, view: &View<'_>, way: &[DVec2], reached: &[Reached]) -> Vec<Cell> {
        let is_reached =
            |at: &DVec2| reached.iter().any(|it| it.pose.position.distance(*at) <= NEAR_M);
        let on = way.iter().rposition(is_reached).map_or(0, |last| last + 1);
        let start = reached[0].pose.position;
        let narrow = way[on.min(way.len())..].iter().find(|at| self.is_narrow(view, **at));
        let cells = narrow.map(|&at| view.cells_within(at, self.covers, 1));
        let cells = cells.into_iter().flatten().filter(|cell| {
            let at = view.frame.centre_of(*cell);
            at.distance(start) > NEAR_M && !view.is_hazard(at) && self.is_narrow(view, at)
        });
        cells.collect()
    }
}

#[cfg(test)]
mod tests;
