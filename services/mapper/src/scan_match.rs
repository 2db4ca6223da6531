//! Scan matcher: estimates the robot's pose from its widest laser.
//!
//! It matches scan points with lines through a reference scan (point-to-line, Censi 2008). The
//! search starts at the dead-reckoned pose, which also constrains directions without lines, such as
//! along a corridor.
//!
//! The scan after a new reference moves it once, so that both references agree on this scan's pose.
//! Otherwise reference errors add up with a bias, because badly matched scans become references.
//!
//! Dead reckoning assumes independent errors of fixes. Match errors are correlated over
//! [`SHARED_S`], so that period's fixes together weigh like one. A fix also states the error shared
//! with all references so far, because averaging never removes it. The second scan after a new
//! reference, matched with both, measures the added error.

use common::{
    found_response::if_there,
    geometry::principal_axes,
    kinematics::Pose2,
    mission::Mission,
    samples::{FixSample, PoseSample},
};
use glam::{DMat3, DVec2, DVec3};
use serde::{Deserialize, Serialize};

use crate::{
    deskew::Placed,
    movers::Movers,
    reading::{Fan, Rows},
};

/// Minimum deviation of a point from its line. Walls are rough even if the laser's noise is lower.
const POINT_M: f64 = 0.02;
/// Prior deviation: metres and radians.
const PRIOR: [f64; 2] = [0.10, 0.05];
/// Gate from point to line: metres, and deviations of a noisy point.
const GATE_M: f64 = 0.08;
const GATE: f64 = 2.5;
/// Gate of the first rounds: dead-reckoning deviations of a point [`AWAY_M`] away, at most
/// [`MOST_GATE_M`]. Beyond, a turning Jackal matched the wrong box and was 0.14 m off.
const FIRST_GATE: f64 = 4.0;
const AWAY_M: f64 = 3.0;
const MOST_GATE_M: f64 = 0.30;
const ROUNDS: usize = 6;
/// Pose change that ends the rounds, metres and radians.
const SETTLED: f64 = 1e-4;
/// Approximate points per match.
const POINTS: usize = 240;
/// Half-length of a line: minimum in metres, and deviations of a noisy point.
const LINE_M: f64 = 0.06;
const LINE: f64 = 2.5;
const EDGE_M: f64 = 0.20;
/// Maximum RMS distance of points from their line, relative to its half-length.
const STRAIGHT: f64 = 0.5;
/// Search angle around a point's bearing.
const BESIDE_RAD: f64 = 0.08;
/// Minimum points on lines for a match.
const LEAST_POINTS: usize = 10;
/// Travel, metres, and turn, radians, that replace the reference; a share on lines below
/// [`LEAST_SHARE`] does, too.
const REPLACED_AFTER: (f64, f64) = (2.0, std::f64::consts::FRAC_PI_3);
const LEAST_SHARE: f64 = 0.6;
/// Deviation that a new reference adds for all later poses: metres and radians.
const OF_REFERENCE: [f64; 2] = [0.0005, 0.0002];
/// Ratio of a match's variance to its scatter's, because the reference has scan noise, too.
const OF_SCATTER: f64 = 1.75;
/// Bounds of a match's variance, relative to that from points.
const SCALES: [f64; 2] = [0.25, 9.0];
/// Share of the scatter kept at each match.
const REMEMBERED: f64 = 0.99;
/// Maximum rate, leaving room for other fixes.
const MOST_FIXES_HZ: f64 = 20.0;
/// Correlation time of match errors.
const SHARED_S: f64 = 2.0;
/// Minimum deviation of a match: metres and radians.
const LEAST: [f64; 2] = [0.005, 0.002];

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Reference {
    pose: Pose2,
    beams: Vec<f32>,
    /// Covariance of x, y and heading: m^2, m rad, rad^2.
    covariance: DMat3,
    /// Lines by beam; recomputed after a restart.
    #[serde(skip)]
    lines: Vec<Option<Line>>,
    #[serde(deserialize_with = "if_there")]
    scatter: Scatter,
    /// Previous reference, and whether this one was moved to agree with it. None after two scans.
    /// Unsaved: the next scan comes soon.
    #[serde(skip)]
    before: Option<(Box<Self>, bool)>,
}

/// Scatter of matches around dead-reckoned poses, which drift slowly.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Scatter {
    off: DVec2,
    /// Sums of match variances, m^2: from scatter, and from points.
    seen: f64,
    stated: f64,
    /// Sums of variances added by references, m^2: from a scan's positions by both references, and
    /// from points.
    added: f64,
    added_stated: f64,
}

impl Default for Scatter {
    fn default() -> Self {
        Self { off: DVec2::ZERO, seen: 1e-4, stated: 1e-4, added: 0.0, added_stated: 0.0 }
    }
}

impl Scatter {
    fn add(&mut self, off: DVec2, stated: f64) {
        assert!(stated > 0.0);
        self.seen = self.seen * REMEMBERED + 0.5 * (off - self.off).length_squared();
        self.stated = self.stated * REMEMBERED + stated;
        self.off = off;
    }

    fn scale(&self) -> f64 {
        let [least, most] = SCALES;
        (OF_SCATTER * self.seen / self.stated).clamp(least, most)
    }

    /// Returns this ratio for a new reference's added variance.
    ///
    /// Before the first measurement it is a match's ratio. Later, the scatter counts as one
    /// measurement of `variance`.
    fn scale_of_reference(&self, variance: f64) -> f64 {
        assert!(variance > 0.0);
        if self.added_stated == 0.0 {
            return self.scale();
        }
        let by_scatter = variance * self.scale() / OF_SCATTER;
        (by_scatter + self.added) / (variance + self.added_stated)
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Line {
    point: DVec2,
    normal: DVec2,
}

#[derive(Clone, Debug)]
pub(crate) struct ScanMatcher {
    row: usize,
    every_ticks: u64,
    /// Number of matches with correlated errors.
    shared: f64,
}

impl ScanMatcher {
    pub(crate) fn new(mission: &Mission) -> Self {
        let rate_hz = mission.robot.rate_hz;
        let every_ticks = (rate_hz / MOST_FIXES_HZ).ceil().max(1.0) as u64;
        let (row, scans) = match mission.laser() {
            Some((row, laser)) => (row, laser.every_ticks.max(1)),
            None => (0, 1),
        };
        let fixes_hz = rate_hz / every_ticks.max(scans) as f64;
        assert!(every_ticks > 0 && fixes_hz <= MOST_FIXES_HZ * (1.0 + 1e-9));
        Self { row, every_ticks, shared: (SHARED_S * fixes_hz).max(1.0) }
    }

    pub(crate) const fn publishes(&self, tick: u64) -> bool {
        tick.is_multiple_of(self.every_ticks)
    }

    /// Matches the laser's scan with the reference, and replaces it if necessary.
    ///
    /// Returns `None` if too little of the reference is visible. While something moves, only static
    /// surfaces count.
    pub(crate) fn step(
        &self,
        rows: &Rows,
        reference: &mut Option<Reference>,
        scans: &[Placed],
        movers: &mut Movers,
    ) -> Option<FixSample> {
        let row = self.row;
        let scan = scans.iter().find(|scan| scan.row == row)?;
        let (beams, moves_first) = movers.take(rows, scan);
        let (Placed { robot: reckoned, capture_ns, .. }, beams) = (scan, &beams[..]);
        let robot = reckoned.pose();
        let fan = rows.scan(row, robot, beams)?;
        // The reference may contain an object now known to move.
        let held = reference.as_mut().filter(|_| !moves_first);
        let Some(held) = held else {
            let covariance = covariance_of(reckoned) + variances(OF_REFERENCE);
            *reference = Some(Reference::new(&fan, robot, covariance, Scatter::default()));
            return None;
        };
        if held.lines.is_empty() {
            let saved = std::mem::take(&mut held.beams);
            let fan = rows.scan(row, held.pose, &saved)?;
            *held = Reference::new(&fan, held.pose, held.covariance, held.scatter);
        }
        let seen_from = rows.scan(row, held.pose, beams)?;
        let [xx, _, _, yy, _, turn] = reckoned.covariance;
        let deviation_m = (0.5 * (xx + yy) + AWAY_M * AWAY_M * turn).sqrt();
        let first_gate_m = (FIRST_GATE * deviation_m).clamp(GATE_M, MOST_GATE_M);
        let start = (robot, first_gate_m);
        let found = held.matched(&fan, &seen_from, start);
        let (mut pose, matched, share) = found.unwrap_or((robot, DMat3::IDENTITY, 1.0));
        assert!((0.0..=1.0).contains(&share));
        let variance = matched.x_axis.x + matched.y_axis.y;
        if found.is_some() {
            if let Some((before, is_laid)) = held.before.take()
                && let Some(seen_from) = rows.scan(row, before.pose, beams)
                && let Some((by_before, ..)) = before.matched(&fan, &seen_from, start)
            {
                if is_laid {
                    // Moving and measuring have equal errors: half the square each.
                    held.scatter.added += 0.5 * pose.position.distance_squared(by_before.position);
                    held.scatter.added_stated += variance;
                } else {
                    held.lay(pose, by_before);
                    pose = by_before;
                    held.before = Some((before, true));
                }
            }
            held.scatter.add(pose.position - robot.position, variance);
        }
        let scatter = held.scatter;
        let of_reference = held.carried_to(pose.position);
        let fix = found.map(|_| {
            let all = (matched + variances(LEAST)) * self.shared + of_reference;
            FixSample {
                capture_ns: *capture_ns,
                x_m: pose.position.x,
                y_m: pose.position.y,
                heading_rad: pose.heading,
                covariance: [
                    all.x_axis.x,
                    all.x_axis.y,
                    all.x_axis.z,
                    all.y_axis.y,
                    all.y_axis.z,
                    all.z_axis.z,
                ],
                shared: [
                    0.5 * (of_reference.x_axis.x + of_reference.y_axis.y),
                    of_reference.z_axis.z,
                ],
                ..FixSample::default()
            }
        });
        let is_empty = held.lines.iter().flatten().count() < LEAST_POINTS;
        let went = pose.position.distance(held.pose.position);
        let turned = (pose.heading - held.pose.heading).abs();
        let is_left = went > REPLACED_AFTER.0 || turned > REPLACED_AFTER.1;
        if is_left || share < LEAST_SHARE || is_empty {
            let covariance = match found {
                Some(_) => of_reference + matched * scatter.scale_of_reference(variance),
                None => covariance_of(reckoned),
            };
            let fan = rows.scan(row, pose, beams)?;
            let covariance = covariance + variances(OF_REFERENCE);
            held.before = None;
            let before = found.and_then(|_| reference.take()).map(|it| (Box::new(it), false));
            *reference =
                Some(Reference { before, ..Reference::new(&fan, pose, covariance, scatter) });
        }
        fix
    }
}

impl Reference {
    fn new(fan: &Fan<'_>, pose: Pose2, covariance: DMat3, scatter: Scatter) -> Self {
        let points = fan.ends().collect::<Vec<_>>();
        let lines = (0..points.len()).map(|beam| Line::through(&points, fan, beam)).collect();
        Self { pose, beams: fan.beams.to_vec(), covariance, lines, scatter, before: None }
    }

    /// Moves the reference as `from` moves to `to`.
    fn lay(&mut self, from: Pose2, to: Pose2) {
        let turn = to.heading - from.heading;
        let turned = DVec2::from_angle(turn);
        let laid = |at: DVec2| to.position + turned.rotate(at - from.position);
        self.pose = Pose2 { position: laid(self.pose.position), heading: self.pose.heading + turn };
        for line in self.lines.iter_mut().flatten() {
            *line = Line { point: laid(line.point), normal: turned.rotate(line.normal) };
        }
    }

    fn carried_to(&self, there: DVec2) -> DMat3 {
        let arm = (there - self.pose.position).perp();
        let carried = DMat3::from_cols(DVec3::X, DVec3::Y, DVec3::new(arm.x, arm.y, 1.0));
        carried * self.covariance * carried.transpose()
    }

    /// Returns the best-fit pose, its covariance, and the share of points that found a line.
    ///
    /// `fan` is the scan at `start`, `seen_from` the same scan at the reference's pose.
    fn matched(
        &self,
        fan: &Fan<'_>,
        seen_from: &Fan<'_>,
        (start, first_gate_m): (Pose2, f64),
    ) -> Option<(Pose2, DMat3, f64)> {
        let ends = fan.ends().collect::<Vec<_>>();
        assert_eq!(self.lines.len(), self.beams.len());
        assert_eq!(ends.len(), seen_from.beams.len());
        let seen: Vec<_> = (0..ends.len()).filter(|beam| ends[*beam].is_some()).collect();
        let every = seen.len().div_ceil(POINTS).max(1);
        let back = DVec2::from_angle(-start.heading);
        // Lines lie behind the points of round surfaces. Matching points with lines would bias
        // references towards the surface; lines with lines match without bias.
        let point = |beam: &usize| {
            let line = Line::through(&ends, fan, *beam).map(|line| line.point);
            let point = line.or(ends[*beam])?;
            Some((back.rotate(point - start.position), fan.deviation_m(point)))
        };
        let points: Vec<_> = seen.iter().step_by(every).filter_map(point).collect();
        // The reference's points have errors, too; each line averages over them.
        let of_lines = 1.0 + 1.0 / every as f64;
        let prior = variances(PRIOR).inverse();
        let (mut pose, mut information, mut found) = (start, DMat3::ZERO, 0);
        for round in 0..ROUNDS {
            let gate = if round < 2 { first_gate_m } else { GATE_M };
            let turned = DVec2::from_angle(pose.heading);
            (information, found) = (DMat3::ZERO, 0);
            let gone = pose.position - start.position;
            let mut pull = -(prior * gone.extend(pose.heading - start.heading));
            for (point, deviation) in &points {
                let arm = turned.rotate(*point);
                let at = pose.position + arm;
                let Some(line) = self.line_near(seen_from, at, gate.max(GATE * deviation)) else {
                    continue;
                };
                let off = line.normal.dot(at - line.point);
                let by = line.normal.extend(line.normal.dot(arm.perp()));
                let weight = (of_lines * deviation * deviation).max(POINT_M * POINT_M).recip();
                information += weight * DMat3::from_cols(by * by.x, by * by.y, by * by.z);
                pull -= weight * off * by;
                found += 1;
            }
            if found < LEAST_POINTS {
                return None;
            }
            let change = (information + prior).inverse() * pull;
            pose.position += change.truncate();
            pose.heading += change.z;
            if round > 1 && change.abs().max_element() < SETTLED {
                break;
            }
        }
        // The identity stands for directions that the scan leaves unconstrained.
        let covariance = (information + DMat3::IDENTITY).inverse();
        let usable =
            pose.position.is_finite() && pose.heading.is_finite() && covariance.is_finite();
        usable.then(|| (pose, covariance, found as f64 / points.len().max(1) as f64))
    }

    /// Returns the nearest line within `gate` metres around the point's bearing.
    fn line_near(&self, seen_from: &Fan<'_>, at: DVec2, gate: f64) -> Option<Line> {
        let way = at - seen_from.origin;
        let bearing = (way.to_angle() - seen_from.first_rad).rem_euclid(std::f64::consts::TAU);
        let beam = (bearing / seen_from.step_rad).round() as i32;
        let beside_rad = BESIDE_RAD.max(gate / way.length().max(gate));
        let beside = (beside_rad / seen_from.step_rad).ceil() as i32;
        // A scan of 1,081 beams has spare candidates. They must be symmetric: one-sided selection
        // turned a Jackal between walls at maximum range by 0.1 rad in 15 m.
        let stride = (beside / 6).max(1);
        let whole_turn = (std::f64::consts::TAU / seen_from.step_rad).round().max(1.0) as i32;
        let near = |line: &Line| line.point.distance_squared(at);
        (-(beside / stride)..=beside / stride)
            .map(|step| (beam + step * stride).rem_euclid(whole_turn) as usize)
            .filter_map(|beam| *self.lines.get(beam)?)
            .min_by(|a, b| near(a).total_cmp(&near(b)))
            .filter(|line| near(line) <= gate * gate)
    }
}

impl Line {
    /// Fits a line around `beam`; none for too few points, an edge, or points off the line.
    fn through(points: &[Option<DVec2>], fan: &Fan<'_>, beam: usize) -> Option<Self> {
        let point = points[beam]?;
        let spacing = point.distance(fan.origin) * fan.step_rad;
        let half_m = LINE_M.max(LINE * fan.deviation_m(point));
        let beside = ((half_m / spacing.max(1e-6)).ceil() as usize).clamp(1, 40);
        let around = points.get(beam.checked_sub(beside)?..=beam + beside)?;
        let edge_m = EDGE_M.max(2.0 * half_m);
        let near = |other: &Option<DVec2>| other.is_some_and(|at| at.distance(point) <= edge_m);
        if !around.iter().all(near) {
            return None;
        }
        let share = 1.0 / around.len() as f64;
        let mean = around.iter().flatten().sum::<DVec2>() * share;
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for at in around.iter().flatten() {
            let off = *at - mean;
            xx += share * off.x * off.x;
            xy += share * off.x * off.y;
            yy += share * off.y * off.y;
        }
        let ([_, aside], along) = principal_axes([xx, xy, yy]);
        let normal = DVec2::from_angle(along).perp();
        (aside <= STRAIGHT * half_m).then_some(Self { point: mean, normal })
    }
}

fn covariance_of(pose: &PoseSample) -> DMat3 {
    let [xx, xy, xt, yy, yt, tt] = pose.covariance;
    DMat3::from_cols(DVec3::new(xx, xy, xt), DVec3::new(xy, yy, yt), DVec3::new(xt, yt, tt))
}

fn variances([place, heading]: [f64; 2]) -> DMat3 {
    DMat3::from_diagonal(DVec3::new(place, place, heading).map(|deviation| deviation * deviation))
}

#[cfg(test)]
mod tests {
    use std::sync::LazyLock;

    use super::*;
    use crate::testing::mission;

    struct Matcher(ScanMatcher, Rows);

    impl Matcher {
        fn step(
            &self,
            reference: &mut Option<Reference>,
            robot: Pose2,
            beams: &[f32],
        ) -> Option<FixSample> {
            self.by_unsure(reference, (robot, 0.0), beams)
        }

        fn by_unsure(
            &self,
            reference: &mut Option<Reference>,
            (robot, deviation_m): (Pose2, f64),
            beams: &[f32],
        ) -> Option<FixSample> {
            let Pose2 { position, heading: heading_rad } = robot;
            let (x_m, y_m, variance) = (position.x, position.y, deviation_m * deviation_m);
            let covariance = [variance, 0.0, 0.0, variance, 0.0, 0.0];
            let reckoned =
                PoseSample { x_m, y_m, heading_rad, covariance, ..PoseSample::default() };
            let beams = beams.to_vec();
            let scan = Placed { row: 0, robot: reckoned, capture_ns: 0, beams };
            self.0.step(&self.1, reference, &[scan], &mut Movers::default())
        }
    }

    static MISSION: LazyLock<Mission> = LazyLock::new(|| {
        mission("target = [3, 0]\nrobot.model = 'turtlebot3-waffle'\nrobot.rate_hz = 10")
    });

    fn matcher() -> Matcher {
        Matcher(ScanMatcher::new(&MISSION), Rows::new(&MISSION))
    }

    /// Returns the scan of a robot at `pose` in a room of 6 m by 4 m, or in an endless corridor
    /// along x.
    fn scan(pose: Pose2, corridor: bool) -> Vec<f32> {
        let mount = MISSION.sensor_table()[0].mount.on(pose);
        (0..360)
            .map(|beam| {
                let angle = mount.heading - std::f64::consts::PI + f64::from(beam).to_radians();
                let along = DVec2::from_angle(angle);
                let to = |at: f64, way: f64, wall: f64| (wall * way.signum() - at) / way;
                let across = to(mount.position.y, along.y, 2.0);
                let range = match corridor {
                    true => across,
                    false => across.min(to(mount.position.x, along.x, 3.0)),
                };
                if range <= 8.0 { range as f32 } else { f32::INFINITY }
            })
            .collect()
    }

    #[test]
    fn the_variance_of_matches_follows_how_they_scatter_within_bounds() {
        let scale = |off: f64| {
            let mut scatter = Scatter::default();
            for step in 0..400 {
                let off = if step % 2 == 0 { off } else { -off };
                scatter.add(DVec2::new(off, 0.0), 1e-4);
            }
            scatter.scale()
        };
        assert!((scale(0.005) - 0.5 * OF_SCATTER).abs() < 0.02, "{}", scale(0.005));
        assert_eq!([scale(0.0), scale(0.05)], SCALES);
    }

    #[test]
    fn along_a_corridor_the_wheels_are_believed() {
        let matcher = matcher();
        let mut reference = None;
        let start = Pose2::default();
        matcher.step(&mut reference, start, &scan(start, true));
        let wheels = Pose2 { position: DVec2::new(0.3, 0.05), heading: 0.02 };
        let fix = matcher.step(&mut reference, wheels, &scan(start, true)).unwrap();
        assert!((fix.x_m - 0.3).abs() < 0.01 && fix.y_m.abs() < 0.01, "{fix:?}");
        assert!(fix.covariance[0] > 100.0 * fix.covariance[3], "{fix:?}");
    }

    #[test]
    fn a_robot_that_is_sure_of_its_place_does_not_take_a_thing_for_another_one() {
        let matcher = matcher();
        let start = Pose2::default();
        // The corridor ends ahead.
        let ends_at = |x: f64| {
            let mut beams = scan(start, true);
            for (beam, range) in beams.iter_mut().enumerate().take(200).skip(161) {
                *range = ((x + 0.064) / (beam as f64 - 180.0).to_radians().cos()) as f32;
            }
            beams
        };
        let mut reference = None;
        matcher.step(&mut reference, start, &ends_at(2.0));
        let [sure, unsure] = [0.005, 0.1].map(|deviation_m| {
            let held = &mut reference.clone();
            matcher.by_unsure(held, (start, deviation_m), &ends_at(2.2)).unwrap().x_m
        });
        assert!(sure.abs() < 0.02 && (unsure + 0.2).abs() < 0.02, "{sure} {unsure}");
    }

    /// Returns scans as [`scan`] does, with the noise of the laser's model.
    fn noisy() -> impl FnMut(Pose2) -> Vec<f32> {
        let mut random = 1_u32;
        move |pose| {
            let mut beams = scan(pose, false);
            for range in &mut beams {
                // A sum of twelve uniform numbers is nearly normal.
                let noise: f64 = (0..12)
                    .map(|_| {
                        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                        f64::from(random) / f64::from(u32::MAX) - 0.5
                    })
                    .sum();
                let (least_m, share) = MISSION.sensor_table()[0].model.beam_noise();
                let exact = f64::from(*range);
                *range = (exact + noise * (least_m + share * exact)) as f32;
            }
            beams
        }
    }

    #[test]
    fn a_new_reference_is_laid_where_the_next_scan_is_by_the_one_before() {
        let matcher = matcher();
        let mut noisy = noisy();
        let at = |x| Pose2 { position: DVec2::new(x, 0.0), heading: 0.0 };
        let mut reference = None;
        matcher.step(&mut reference, at(-1.0), &noisy(at(-1.0)));
        let mut before = reference.clone();
        matcher.step(&mut reference, at(1.1), &noisy(at(1.1)));
        let replaced = reference.as_ref().unwrap().pose;
        assert_ne!(replaced, before.as_ref().unwrap().pose, "the reference was not replaced");
        let there = at(1.0);
        let beams = noisy(there);
        let [by_before, by_both] =
            [&mut before, &mut reference].map(|held| matcher.step(held, there, &beams).unwrap());
        assert_eq!([by_both.x_m, by_both.y_m], [by_before.x_m, by_before.y_m]);
        let again = matcher.step(&mut reference, there, &beams).unwrap();
        let off = |fix: &FixSample| (fix.x_m - by_before.x_m).hypot(fix.y_m - by_before.y_m);
        let laid = reference.as_ref().unwrap().pose.position.distance(replaced.position);
        assert!(laid > 0.003 && off(&again) < 0.001, "{laid} {}", off(&again));
    }

    #[test]
    fn a_laser_of_great_noise_is_matched_with_its_reference_and_says_how_well() {
        let matcher = matcher();
        let mut noisy = noisy();
        let (mut reference, start) = (None, Pose2::default());
        matcher.step(&mut reference, start, &noisy(start));
        let (mut squares, mut stated) = (0.0, 0.0);
        for step in 0..40 {
            let position = DVec2::new(0.01 * f64::from(step), 0.0);
            let truth = Pose2 { position, heading: 0.0 };
            let fix = matcher.step(&mut reference, truth, &noisy(truth)).unwrap();
            squares += DVec2::new(fix.x_m, fix.y_m).distance_squared(position);
            stated += (fix.covariance[0] + fix.covariance[3]) / matcher.0.shared;
        }
        assert_eq!(reference.unwrap().pose, start, "the scans were not matched with the first one");
        assert!((0.3..2.0).contains(&(squares / stated)), "{squares} where {stated} is stated");
    }

    #[test]
    fn a_reference_without_its_lines_matches_as_with_them() {
        let matcher = matcher();
        let (start, there) =
            (Pose2::default(), Pose2 { position: DVec2::new(0.1, 0.0), heading: 0.1 });
        let mut reference = None;
        matcher.step(&mut reference, start, &scan(start, false));
        let mut restored = reference.clone();
        restored.as_mut().unwrap().lines.clear();
        let beams = scan(there, false);
        let fixes = [&mut reference, &mut restored].map(|held| matcher.step(held, start, &beams));
        assert_eq!(fixes[0], fixes[1]);
        assert_eq!(reference, restored);
    }
}
