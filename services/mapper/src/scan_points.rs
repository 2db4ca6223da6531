//! Points of a scan, with the normals of the lines through their neighbours.
//!
//! Points vote on what stands. A gapless piece no wider than a mover has one vote, because it may
//! move as one.

use common::geometry::principal_axes;
use glam::DVec2;

use crate::{movers::WIDEST_M, reading::Fan};

/// Half-length of a line: minimum in metres, and deviations of a noisy point.
const LINE_M: f64 = 0.06;
const LINE: f64 = 2.5;
/// Maximum RMS distance of points from their line, relative to its half-length.
const STRAIGHT: f64 = 0.5;
/// Number of points from which a piece has its whole vote.
const VOTERS: usize = 4;

/// A point of a scan in the robot's frame.
pub(crate) struct Point {
    pub at: DVec2,
    /// None for points off a line.
    pub normal: Option<DVec2>,
    pub deviation_m: f64,
    /// Share of its piece's vote.
    pub vote: f64,
}

/// Returns a scan's points. Those on lines are their line's, because lines lie behind the points of
/// round surfaces, which would bias the match towards them.
pub(crate) fn points(fan: &Fan<'_>) -> Vec<Point> {
    let ends: Vec<_> = fan.ends().collect();
    let point = |beam: usize| {
        let at = ends[beam]?;
        let deviation_m = fan.deviation_m(at);
        let spacing_m = at.distance(fan.origin) * fan.step_rad;
        let half_m = LINE_M.max(LINE * deviation_m).max(1.5 * spacing_m);
        let beside = ((half_m / spacing_m.max(1e-6)).ceil() as usize).clamp(1, 40);
        let around = &ends[beam.saturating_sub(beside)..(beam + beside + 1).min(ends.len())];
        let near = around.iter().flatten().filter(|other| other.distance(at) <= 2.0 * half_m);
        let (at, normal) = line_through(near, half_m).map_or((at, None), |(middle, normal)| {
            (middle, Some(if normal.dot(fan.origin - middle) < 0.0 { -normal } else { normal }))
        });
        Some(Point { at, normal, deviation_m, vote: 0.0 })
    };
    let mut points: Vec<_> = (0..ends.len()).filter_map(point).collect();
    let mut rest = &mut points[..];
    while let Some(first) = rest.first() {
        let first = first.at;
        let mut last = first;
        let ends = rest.iter().position(|point| {
            let is_apart = !fan.joins(last, point.at) || point.at.distance(first) > WIDEST_M;
            last = point.at;
            is_apart
        });
        let (piece, others) = rest.split_at_mut(ends.unwrap_or(rest.len()));
        let vote = (piece.len().max(VOTERS) as f64).recip();
        piece.iter_mut().for_each(|point| point.vote = vote);
        rest = others;
    }
    points
}

/// Returns the middle and the normal of the line through points; none for fewer than three, or
/// points off the line.
fn line_through<'a>(
    points: impl Iterator<Item = &'a DVec2> + Clone,
    half_m: f64,
) -> Option<(DVec2, DVec2)> {
    let count = points.clone().count();
    if count < 3 {
        return None;
    }
    let share = 1.0 / count as f64;
    let middle = points.clone().sum::<DVec2>() * share;
    let mut xx = 0.0;
    let mut xy = 0.0;
    let mut yy = 0.0;
    for at in points {
        let off = *at - middle;
        xx += share * off.x * off.x;
        xy += share * off.x * off.y;
        yy += share * off.y * off.y;
    }
    let ([_, aside], along) = principal_axes([xx, xy, yy]);
    (aside <= STRAIGHT * half_m).then(|| (middle, DVec2::from_angle(along).perp()))
}
