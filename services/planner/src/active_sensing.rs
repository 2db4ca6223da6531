//! Active sensing: what the evidential method makes of a direction before the robot goes there.
//!
//! The one sonar looks ahead, the body is wider than its cone where it matters, and faces at a slant do not answer. So
//! before the robot drives over ground, the sonar must have been pointed there, and square to every face that could be
//! touched there; and it drives no faster than it could stop before the next thing it believes in, or the next ground
//! it has not seen.
//!
//! All of it is computed from the belief and the pose alone: a scan is nothing but looking, tick by tick,
//! at ground that was not swept yet, so the next process of a planner that was killed goes on with it.

use common::{
    grid::{Cell, CellState, GridFrame},
    kinematics::{FACES_COSINE, LEAST_SPEED_M_S, Pose2},
    mission::Mission,
    samples::GridHeader,
};
use glam::DVec2;
use harmonic::{Field, Guidance};

use crate::{
    near_echoes::{STANDS_BEFORE_M, clear_ahead_m},
    undetected_surfaces::UndetectedSurfaces,
};

/// From point to point along a way, metres.
const STEP_M: f64 = 0.05;
/// The ground under so much of the way ahead must have been swept, and no face could be touched there undetected, metres.
const SWEPT_AHEAD_M: f64 = 0.25;
/// So far ahead it is looked at at all, metres.
const AHEAD_M: f64 = 0.6;
/// In this time the robot must be able to stop: the sonar's period, the radio's, the wheels' lag.
const STOPS_WITHIN_S: f64 = 0.6;
/// Cells of a fine grid are looked at no closer than this, metres.
const GRAIN_M: f64 = 0.025;

/// What to do about a direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Advice {
    /// Go, no faster than this, m/s.
    Go(f64),
    /// Turn on the spot until this unit vector is faced.
    Look(DVec2),
}

/// The belief the advice is given on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct View<'a> {
    /// How the cells lie.
    pub(crate) frame: GridFrame,
    /// One [`CellState`] byte a cell, row-major.
    pub(crate) cells: &'a [u8],
    /// The field over them.
    pub(crate) field: &'a Field,
}

/// The robot as the advice sees it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ActiveSensing {
    radius: f64,
    speed: f64,
    turn: f64,
    /// Unit vector from the robot's axis to the sonar's.
    bearing: DVec2,
}

impl ActiveSensing {
    /// For a mission's robot.
    pub(crate) fn new(mission: &Mission) -> Self {
        Self {
            radius: mission.body().radius_m,
            speed: mission.speed_m_s(),
            turn: mission.controller.turn_rad_s,
            bearing: DVec2::from_angle(mission.sonar.bearing_deg.to_radians()),
        }
    }

    /// Advice for a robot at `pose` that is to go along `direction`, a unit vector, by the readings in `belief`.
    pub(crate) fn advise(
        &self,
        view: &View<'_>,
        belief: &GridHeader,
        pose: &Pose2,
        direction: DVec2,
    ) -> Advice {
        let undetected = UndetectedSurfaces::new(belief, self.radius);
        let way = view.way(pose.position, direction);
        let steps = (SWEPT_AHEAD_M / STEP_M) as usize;
        let ahead = &way[..steps.min(way.len())];
        let ground = ahead
            .iter()
            .flat_map(|&at| view.unscanned(at, self.radius))
            .filter_map(|at| (at - pose.position).try_normalize());
        let before = std::iter::once(&pose.position).chain(ahead);
        let faces = before.zip(ahead).flat_map(|(&from, &to)| {
            let along = (to - from).normalize_or(direction);
            undetected.normals(to, along)
        });
        let unseen = ground.chain(faces);
        match scan(self.bearing.rotate(pose.axis()), unseen) {
            // The robot turns until its sonar faces it.
            Some(there) => Advice::Look(DVec2::new(self.bearing.x, -self.bearing.y).rotate(there)),
            None => Advice::Go(self.limit(view, &undetected, belief, pose, direction)),
        }
    }

    /// The most speed that the newest readings allow along the robot's axis, m/s: none towards what is right before the body.
    pub(crate) fn limit_before_echoes(&self, belief: &GridHeader, pose: &Pose2) -> f64 {
        let clear_m = clear_ahead_m(belief, pose, self.radius);
        if clear_m < STANDS_BEFORE_M {
            return 0.0;
        }
        clear_m / STOPS_WITHIN_S
    }

    /// The speed that the readings, and the arc on which the controller brings the robot into `direction`, allow, m/s.
    ///
    /// A robot that faces a way which the belief does not forbid would stall for ever where the arc allows no speed: it
    /// goes as slowly as it can, as long as the readings allow that.
    fn limit(
        &self,
        view: &View<'_>,
        undetected: &UndetectedSurfaces,
        belief: &GridHeader,
        pose: &Pose2,
        direction: DVec2,
    ) -> f64 {
        let curvature = self.turn * pose.axis().perp_dot(direction) / self.speed;
        let steps = (AHEAD_M / STEP_M) as usize;
        let open = |step: &usize| {
            let way = *step as f64 * STEP_M;
            let ahead = pose.along_arc(way, way * curvature);
            let at = ahead.position;
            !view.is_hazard(at)
                && view.unscanned(at, self.radius).next().is_none()
                && undetected.normals(at, ahead.axis()).next().is_none()
        };
        let free = (1..=steps).find(|step| !open(step)).unwrap_or(steps + 1) - 1;
        let on_arc = free as f64 * STEP_M / STOPS_WITHIN_S;
        let faces = pose.axis().dot(direction) > FACES_COSINE;
        let least = if faces { LEAST_SPEED_M_S } else { 0.0 };
        on_arc
            .max(least)
            .min(self.limit_before_echoes(belief, pose))
    }
}

/// Where to turn from `axis` to see everything in the directions `unseen`: first to the side where less
/// turning brings something new, and there to the far end without a stop.
fn scan(axis: DVec2, unseen: impl Iterator<Item = DVec2>) -> Option<DVec2> {
    // Per side: the least and the greatest angle, and where that one is.
    let mut sides = [None::<(f64, f64, DVec2)>; 2];
    for there in unseen {
        let angle = axis.angle_to(there);
        let side = &mut sides[usize::from(angle < 0.0)];
        let angle = angle.abs();
        *side = Some(match *side {
            None => (angle, angle, there),
            Some((least, greatest, _)) if angle > greatest => (least.min(angle), angle, there),
            Some((least, greatest, end)) => (least.min(angle), greatest, end),
        });
    }
    let nearer = sides.into_iter().flatten();
    let nearer = nearer.min_by(|a, b| a.0.total_cmp(&b.0));
    nearer.map(|(_, _, end)| end)
}

impl View<'_> {
    /// Points of the field's own way from `from`, which it leaves along `direction`.
    fn way(&self, from: DVec2, direction: DVec2) -> Vec<DVec2> {
        let mut way = Vec::with_capacity((AHEAD_M / STEP_M) as usize);
        let (mut at, mut direction) = (from, direction);
        while way.len() < way.capacity() {
            at += direction * STEP_M;
            way.push(at);
            let cells = self.frame.to_cells(at);
            match self.field.guidance(cells.x, cells.y) {
                Guidance::Along(next) => direction = next.into(),
                _ => break,
            }
        }
        way
    }

    fn state(&self, cell: Cell) -> CellState {
        let byte = self.cells.get(self.frame.index(cell)).copied();
        byte.map_or(CellState::Perimeter, CellState::from_byte)
    }

    pub(crate) fn is_hazard(&self, at: DVec2) -> bool {
        self.frame
            .cell_at(at)
            .is_none_or(|cell| self.state(cell).is_hazard())
    }

    /// Middles of the cells within `radius` of `at` that nobody looked at and nobody knows.
    fn unscanned(&self, at: DVec2, radius: f64) -> impl Iterator<Item = DVec2> {
        let frame = self.frame;
        let last = f64::from(frame.cells) - 1.0;
        let inside = |corner: DVec2| corner.clamp(DVec2::ZERO, DVec2::splat(last));
        let from = inside(frame.to_cells(at - radius).ceil());
        let to = inside(frame.to_cells(at + radius).floor());
        let grain = (GRAIN_M / frame.resolution_m).max(1.0) as usize;
        (from.y as u32..=to.y as u32)
            .step_by(grain)
            .flat_map(move |row| {
                let columns = (from.x as u32..=to.x as u32).step_by(grain);
                columns.map(move |col| Cell { col, row })
            })
            .filter(move |&cell| {
                let unknown = matches!(self.state(cell), CellState::Free | CellState::Sensed);
                unknown && frame.centre_of(cell).distance(at) <= radius
            })
            .map(move |cell| frame.centre_of(cell))
    }
}

#[cfg(test)]
mod tests;
