//! Ultrasonic ranger: measures the nearest point in its cone that reflects sound.
//!
//! In the laboratory, surfaces reflect wherever the cone meets them. Otherwise, a smooth wall
//! reflects only at the foot of the perpendicular, within a limit off the axis. A drum reflects
//! over a wider angle, an edge sometimes. Silent surfaces still hide those behind them.
//!
//! An echo is detected if its amplitude reaches that of a post 3 cm in diameter at `post_reach_m`.
//! The amplitude falls with range r as 10^(-2 alpha r / 20) / r: the transmitter's mirror image in a
//! plane is 2 r away. Air at 40 kHz absorbs alpha = 1.3 dB/m (ISO 9613-1, 20 degrees Celsius, half
//! saturated). A cylinder of radius a adds sqrt(a / (a + r)). This geometrical acoustics needs k a
//! well above 1; a post of 1.25 cm has k a = 9. A soft surface returns its share `echo`.
//!
//! The cone is as wide vertically as horizontally, so it meets solids below or above the ranger
//! from some distance on. A smooth one then echoes only by its edge.

use std::f64::consts::FRAC_PI_2;

use common::{kinematics::Pose2, mission::SonarPhysics, wire::Echo};
use glam::DVec2;

use crate::{
    noise::Noise,
    world::{Solid, Surface, World},
};

pub const REACH_M: f64 = 2.55;
/// Distance before an echo within which a surface cannot hide it.
const HIDES_M: f64 = 0.01;
/// Offset of a reflected beam from its mirror.
const NUDGE_M: f64 = 1e-6;
const ABSORPTION_DB_PER_M: f64 = 1.3;
const POST_RADIUS_M: f64 = 0.015;

#[derive(Clone, Copy)]
struct Candidate {
    range: f64,
    /// From the ranger, seen from above, metres.
    offset: DVec2,
    /// Whether the echo is often lost: near a limit, or from an edge.
    weak: bool,
    share: f64,
}

fn off_axis(axis: DVec2, direction: DVec2) -> f64 {
    axis.perp_dot(direction).atan2(axis.dot(direction)).abs()
}

/// Returns the noiseless range, metres; infinite for nothing.
pub fn listen(
    world: &World,
    centre: DVec2,
    pose: Pose2,
    physics: &SonarPhysics,
    noise: &mut Noise,
) -> f64 {
    let height = world.heights.sonar_m;
    if world.is_between(centre, pose.position, height) {
        // A ranger pressed against an object that the body touches hears only that.
        return 0.0;
    }
    let receiver = Receiver::new(pose, height, physics);
    let mut candidates: Vec<Candidate> =
        world.solids().flat_map(|solid| receiver.candidates(&solid)).flatten().collect();
    candidates.sort_by(|a, b| a.range.total_cmp(&b.range));
    let answer = candidates.into_iter().find(|candidate| {
        let Candidate { offset, .. } = *candidate;
        let hidden = world
            .first_hit(pose.position, offset.normalize_or_zero(), height)
            .is_some_and(|(first, _)| first < offset.length() - HIDES_M);
        !hidden && (candidate.share >= 1.0 || noise.chance(candidate.share))
    });
    let heard = match answer {
        Some(Candidate { weak, range, .. }) => {
            let lost = if weak { physics.weak_dropout_share } else { physics.dropout_share };
            (!noise.chance(lost)).then_some(range)
        }
        None => bounced(world, pose, physics, noise),
    };
    let mut range = heard.unwrap_or(f64::INFINITY);
    if noise.chance(physics.false_echo_share) {
        range = 0.1 + noise.uniform() * (range.min(REACH_M) - 0.1).max(0.0);
    }
    assert!(range >= 0.0);
    range
}

pub fn byte(range: f64, physics: &SonarPhysics, noise: &mut Noise) -> u8 {
    if range > REACH_M {
        return Echo::byte_at(f64::INFINITY);
    }
    Echo::byte_at(range + noise.normal(physics.noise_m + physics.noise_per_m * range))
}

fn bounced(world: &World, pose: Pose2, physics: &SonarPhysics, noise: &mut Noise) -> Option<f64> {
    if !noise.chance(physics.multipath_share) {
        return None;
    }
    let (axis, height) = (pose.axis(), world.heights.sonar_m);
    let (there, Surface::Face { from, to }) = world.first_hit(pose.position, axis, height)? else {
        return None;
    };
    const { assert!(NUDGE_M < HIDES_M) };
    let normal = (to - from).perp().try_normalize()?;
    let onward = axis - 2.0 * axis.dot(normal) * normal;
    let mirror = pose.position + axis * there;
    let (further, second) = world.first_hit(mirror + onward * NUDGE_M, onward, height)?;
    let outward = second.outward(mirror)?;
    let square = off_axis(outward, -onward) <= physics.wall_limit_deg.to_radians();
    let range = there + further + NUDGE_M;
    (square && range <= REACH_M).then_some(range)
}

struct Receiver<'a> {
    physics: &'a SonarPhysics,
    origin: DVec2,
    axis: DVec2,
    /// Half the cone's angle.
    half: f64,
    lobe: f64,
    /// Height above the floor, metres.
    height: f64,
    threshold: f64,
}

impl<'a> Receiver<'a> {
    fn new(pose: Pose2, height: f64, physics: &'a SonarPhysics) -> Self {
        let half = physics.cone_deg.to_radians();
        Self {
            physics,
            origin: pose.position,
            axis: pose.axis(),
            half,
            lobe: physics.lobe_deg.to_radians().max(half),
            height,
            threshold: amplitude(physics.post_reach_m, Some(POST_RADIUS_M)),
        }
    }

    fn edges(&self) -> [DVec2; 2] {
        [self.half, -self.half].map(|angle| DVec2::from_angle(angle).rotate(self.axis))
    }

    fn contains(&self, direction: DVec2) -> bool {
        off_axis(self.axis, direction) <= self.half + 1e-12
    }

    fn nearest(&self, from: DVec2, to: DVec2) -> Option<DVec2> {
        let surface = Surface::Face { from, to };
        let foot = common::geometry::nearest_on_segment(self.origin, from, to);
        let crossings = self.edges().into_iter().filter_map(|edge| {
            let range = surface.hit(self.origin, edge)?;
            Some(edge * range)
        });
        [foot, from, to]
            .into_iter()
            .map(|point| point - self.origin)
            .filter(|offset| self.contains(*offset))
            .chain(crossings)
            .min_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))
    }

    fn reach(&self, off: f64) -> f64 {
        if off <= self.half + 1e-12 {
            REACH_M
        } else if off < self.lobe {
            REACH_M * (self.lobe - off) / (self.lobe - self.half)
        } else {
            0.0
        }
    }

    /// Returns up to two points that may echo.
    fn candidates(&self, solid: &Solid) -> [Option<Candidate>; 2] {
        let (found, radius) = match solid.surface {
            Surface::Drum { at, radius } => ([self.drum(at, radius), None], Some(radius)),
            Surface::Face { from, to } => (self.face(from, to), None),
        };
        let gap = solid.profile.height_gap(self.height);
        found.map(|candidate| {
            let candidate = self.off_level(candidate?, gap)?;
            let heard = solid.profile.echo * amplitude(candidate.range, radius);
            (heard >= self.threshold).then_some(candidate)
        })
    }

    /// Raises a candidate that is `gap` metres above or below the ranger.
    fn off_level(&self, candidate: Candidate, gap: f64) -> Option<Candidate> {
        if gap == 0.0 {
            return Some(candidate);
        }
        let range = candidate.range.hypot(gap);
        let in_cone = gap.atan2(candidate.range) <= self.half && range <= REACH_M;
        let raised = Candidate { range, ..candidate };
        if self.is_rough() {
            return in_cone.then_some(raised);
        }
        let share = candidate.share.min(self.physics.edge_share);
        (in_cone && range <= self.physics.edge_reach_m && share > 0.0).then_some(Candidate {
            weak: true,
            share,
            ..raised
        })
    }

    fn is_rough(&self) -> bool {
        self.physics.wall_limit_deg.to_radians() >= FRAC_PI_2
    }

    fn drum(&self, at: DVec2, radius: f64) -> Option<Candidate> {
        let to_centre = at - self.origin;
        let range = to_centre.length() - radius;
        if range <= 0.0 {
            return Some(heard(self.axis * 1e-9, false));
        }
        let off = off_axis(self.axis, to_centre);
        if range <= self.reach(off) {
            let weak = off > self.half + 1e-12;
            return Some(heard(to_centre.normalize_or_zero() * range, weak));
        }
        // The nearest point is outside the cone, but the cone may still meet the flank.
        let drum = Surface::Drum { at, radius };
        let limit = self.physics.drum_limit_deg.to_radians();
        let flank = |edge: DVec2| {
            let range = drum.hit(self.origin, edge)?;
            let incidence = off_axis(-edge, edge * range - to_centre);
            (range <= REACH_M && incidence <= limit).then_some(edge * range)
        };
        let nearest = self
            .edges()
            .into_iter()
            .filter_map(flank)
            .min_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))?;
        Some(heard(nearest, true))
    }

    fn face(&self, from: DVec2, to: DVec2) -> [Option<Candidate>; 2] {
        let origin = self.origin;
        let Some(along) = (to - from).try_normalize() else {
            return [None; 2];
        };
        let foot = from + along * (origin - from).dot(along) - origin;
        let limit = self.physics.wall_limit_deg.to_radians();
        let off = if foot.length_squared() > 1e-18 { off_axis(self.axis, foot) } else { 0.0 };
        // A rough wall echoes even where the cone only grazes it.
        if off <= limit + 1e-12 || self.is_rough() {
            let share = (foot + origin - from).dot(along) / (to - from).length();
            if (0.0..=1.0).contains(&share) && foot.length() <= self.reach(off) {
                let weak = off > 0.8 * limit || off > self.half + 1e-12;
                return [Some(heard(foot, weak)), None];
            }
            let nearest = self.nearest(from, to);
            let nearest = nearest.filter(|offset| offset.length() <= REACH_M);
            return [nearest.map(|offset| heard(offset, false)), None];
        }
        [from, to].map(|end| {
            let offset = end - origin;
            let near = offset.length() <= self.physics.edge_reach_m && self.contains(offset);
            let share = self.physics.edge_share;
            (near && share > 0.0).then(|| Candidate { share, ..heard(offset, true) })
        })
    }
}

fn amplitude(range: f64, radius: Option<f64>) -> f64 {
    let spread = radius.map_or(1.0, |radius| (radius / (radius + range)).sqrt());
    spread * 10_f64.powf(-2.0 * ABSORPTION_DB_PER_M * range / 20.0) / range
}

fn heard(offset: DVec2, weak: bool) -> Candidate {
    Candidate { range: offset.length(), offset, weak, share: 1.0 }
}

#[cfg(test)]
mod tests;
