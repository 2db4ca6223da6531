//! Scan matcher: estimates the robot's pose from its widest laser.
//!
//! It matches the points of a scan with the nearest surfaces that recent scans showed: point to
//! line (Censi 2008), in rounds with a shrinking gate, without the worst tenth. The search starts
//! where wheels and gyro carried the newest match. Wheels and gyro also constrain directions that
//! no surface does, such as along a corridor.
//!
//! If few points fit there, either the wheels slipped or things moved. A narrow search then holds
//! the wheels' motion by what stood before, and a wide one lets them slip. Pieces of the scan vote
//! between the two: fewer votes let wheels slip that turn than wheels at rest, and each known mover
//! makes it likelier that pieces move.
//!
//! A keyframe adds surfaces that are not known yet, removes those that the laser looks through, and
//! forgets those unseen for [`KEPT_M`] of travel. Known surfaces keep their place, so the matcher
//! drifts only as it sees new ones. Each keyframe adds the share of a match's covariance that its
//! new surfaces have of the scan.
//!
//! Dead reckoning assumes independent errors of fixes. Match errors are correlated over
//! [`SHARED_S`], so that period's fixes together weigh like one. A fix also states the drift, which
//! all later fixes share, because averaging never removes it.

use common::{
    geometry::symmetric,
    kinematics::Pose2,
    mission::Mission,
    samples::{FixSample, name},
};
use glam::{DMat3, DVec2, DVec3};
use serde::{Deserialize, Serialize};

use crate::{
    deskew::Placed,
    movers::Movers,
    reading::{Fan, Rows},
    scan_points::{Point, points},
    surfaces::{CELL_M, Index, Surface},
};

/// Minimum deviation of a point from its line. Walls are rough even if the laser's noise is lower.
/// With less, people beside the robot outweigh walls far away, where a laser is noisier.
const POINT_M: f64 = 0.05;
/// Greatest deviation of wheels that do not slip between two scans: metres and radians.
const PRIOR: [f64; 2] = [0.02, 0.01];
/// Deviation of wheels that may slip: at rest, metres or radians; as a share of the motion; and
/// metres per radian of turn.
const AT_REST: f64 = 0.0005;
const SLIPS: f64 = 0.5;
const ARM_M: f64 = 0.2;
/// Drift of a scan without a match, in deviations of the wheels.
const LOST: f64 = 3.0;
/// Logarithm of how much likelier a piece stands than moves, where nothing is known to move.
const VOTE: f64 = 3.0;
/// Gates from a point to the nearest surface: of the first round and of the last, metres.
const GATES_M: [f64; 2] = [CELL_M, 0.1];
/// Last gate in deviations of a noisy point.
const GATE: f64 = 2.5;
/// Ratio of a round's gate to the gate before.
const SHRINKS: f64 = 0.7;
/// Share of points that a round keeps, those nearest to their lines.
const KEPT_SHARE: f64 = 0.9;
/// Least cosine between the normals of a point and its surface: 45 degrees.
const ALIKE: f64 = 0.7;
/// Share of points on surfaces that shows a match without a wide search.
const SURE_SHARE: f64 = 0.7;
const ROUNDS: usize = 15;
/// Pose change that ends the rounds, metres and radians.
const SETTLED: f64 = 1e-4;
/// Approximate points per match.
const POINTS: usize = 240;
/// Spacing of surfaces, metres.
const SPACING_M: f64 = 0.05;
/// Bound on surfaces; those unseen for longest are forgotten first.
const MOST_SURFACES: usize = 2048;
/// Distance of surfaces from the robot: reach of a laser and [`KEPT_M`], metres.
const FARTHEST_M: f64 = 40.0;
/// Travel after which an unseen surface is forgotten, metres.
const KEPT_M: f64 = 5.0;
/// Range beyond a surface that shows it gone, metres.
const THROUGH_M: f64 = 0.3;
/// Minimum points on surfaces for a match, and their share of the scan.
const LEAST_POINTS: usize = 10;
const LEAST_SHARE: f64 = 0.1;
/// Travel, metres, and turn, radians, between keyframes.
const KEYFRAME: (f64, f64) = (0.2, 0.17);
/// Deviation that a scan's worth of new surfaces adds besides the match's: metres and radians.
const DRIFT: [f64; 2] = [0.02, 0.006];
/// Bounds of a match's variance, relative to that from points.
const SCALES: [f64; 2] = [0.25, 9.0];
/// Maximum rate, leaving room for other fixes.
const MOST_FIXES_HZ: f64 = 20.0;
/// Correlation time of match errors.
const SHARED_S: f64 = 2.0;
/// Minimum deviation of a match: metres and radians.
const LEAST: [f64; 2] = [0.005, 0.002];

/// What the scan matcher knows: surfaces around the robot, and its newest match.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Surroundings {
    surfaces: Vec<Surface>,
    /// Newest match, and the odometry pose of its scan.
    pose: Pose2,
    odometry: Pose2,
    keyframe: Pose2,
    /// Covariance of the drift of x, y and heading: m^2, m rad, rad^2.
    drift: DMat3,
    travelled_m: f64,
    /// By place; computed again after a restart.
    #[serde(skip)]
    index: Index,
}

struct Match {
    pose: Pose2,
    covariance: DMat3,
    /// Votes of the points that found a surface, and their share of all votes.
    votes: f64,
    share: f64,
}

/// Where a search looks for surfaces first, and whether wheels that went far from them hold it.
#[derive(Clone, Copy, PartialEq)]
enum Search {
    Narrow,
    Wide,
    Held,
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
        let (row, scans) = mission.laser().map_or((0, 1), |(row, laser)| (row, laser.every_ticks));
        let fixes_hz = rate_hz / every_ticks.max(scans) as f64;
        assert!(every_ticks > 0 && fixes_hz <= MOST_FIXES_HZ * (1.0 + 1e-9));
        Self { row, every_ticks, shared: (SHARED_S * fixes_hz).max(1.0) }
    }

    /// Matches the laser's scan with the known surroundings, and adds to them.
    ///
    /// Returns `None` in ticks that are due no fix, or if too little of them is visible; the match
    /// then goes on as the wheels went. Only static surfaces are added.
    pub(crate) fn step(
        &self,
        rows: &Rows,
        held: &mut Option<Surroundings>,
        scans: &[Placed],
        movers: &mut Movers,
    ) -> Option<FixSample> {
        let scan = scans.iter().find(|scan| scan.row == self.row)?;
        let reckoned = scan.robot.pose();
        let odometry = scan.robot.odometry();
        if !(is_finite(reckoned) && is_finite(odometry)) {
            return None;
        }
        // A file may hold any number.
        held.take_if(|held| !(is_finite(held.pose) && is_finite(held.odometry)));
        let held = held.get_or_insert_with(|| {
            *movers = Movers::default();
            let covariance = DMat3::from_cols_array_2d(&symmetric(scan.robot.covariance));
            let drift = covariance + variances(DRIFT);
            Surroundings { pose: reckoned, odometry, drift, ..Surroundings::default() }
        });
        let mut fan = rows.scan(self.row, Pose2::default(), &scan.beams)?;
        let at_s = scan.capture_ns as f64 * 1e-9;
        let carried = held.carried(odometry);
        let turned = DVec2::from_angle(carried.heading);
        let place = |point: &Point| carried.position + turned.rotate(point.at);
        let mut seen = points(&fan);
        seen.retain(|point| !movers.are_at(place(point), at_s));
        let stood = movers.stood(rows, self.row, at_s);
        let matched = held.matched(&seen, odometry, movers.count(), |point| stood(place(point)));
        drop(stood);
        let robot = matched.as_ref().map_or(carried, |matched| matched.pose);
        let without = movers.take(rows, scan, robot);
        if let Some(beams) = &without {
            fan = rows.scan(self.row, Pose2::default(), beams)?;
            seen = points(&fan);
        }
        held.follow(matched.as_ref(), odometry);
        let drift = held.drift;
        let is_new = matched.as_ref().is_none_or(|matched| matched.share < KEPT_SHARE);
        if is_new || held.has_left_keyframe() {
            let new = held.add(&fan, &seen);
            if let Some(Match { covariance, .. }) = matched {
                held.drift += (covariance + variances(DRIFT)) * new;
            }
        }
        let is_due = scan.robot.stamp.tick.is_multiple_of(self.every_ticks);
        let Match { pose, covariance, .. } = matched.filter(|_| is_due)?;
        let all = (covariance + variances(LEAST)) * self.shared + drift;
        let [x, y, turn] = [all.x_axis, all.y_axis, all.z_axis];
        Some(FixSample {
            capture_ns: scan.capture_ns,
            x_m: pose.position.x,
            y_m: pose.position.y,
            heading_rad: pose.heading,
            covariance: [x.x, x.y, x.z, y.y, y.z, turn.z],
            shared: [0.5 * (drift.x_axis.x + drift.y_axis.y), drift.z_axis.z],
            source: name("scan"),
            ..FixSample::default()
        })
    }
}

impl Surroundings {
    /// Bound on the saved state: 40 bytes per surface.
    pub(crate) const MOST_BYTES: usize = 40 * MOST_SURFACES + 256;

    /// Moves to a scan's pose: as matched, or as the wheels went.
    fn follow(&mut self, matched: Option<&Match>, odometry: Pose2) {
        let (pose, lost) = match matched {
            Some(Match { pose, .. }) => (*pose, DMat3::ZERO),
            None if self.surfaces.is_empty() => (self.pose, DMat3::ZERO),
            None => (self.carried(odometry), LOST * LOST * self.prior(odometry)),
        };
        let way = pose.position - self.pose.position;
        let carried = DMat3::from_cols(DVec3::X, DVec3::Y, way.perp().extend(1.0));
        self.drift = carried * self.drift * carried.transpose() + lost;
        self.travelled_m += way.length();
        self.pose = pose;
        self.odometry = odometry;
    }

    fn has_left_keyframe(&self) -> bool {
        let went = self.pose.position.distance(self.keyframe.position);
        let turned = (self.pose.heading - self.keyframe.heading).abs();
        went > KEYFRAME.0 || turned > KEYFRAME.1
    }

    /// Returns the best-fit pose of a scan; none if too few of its points are on surfaces.
    ///
    /// `stood` tells whether a point showed a surface before too.
    fn matched(
        &mut self,
        points: &[Point],
        odometry: Pose2,
        movers: usize,
        stood: impl Fn(&Point) -> bool,
    ) -> Option<Match> {
        if self.index.is_empty() {
            self.reindex();
        }
        let every = points.len().div_ceil(POINTS).max(1);
        let mut points: Vec<_> = points.iter().step_by(every).collect();
        let near = self.matched_if(Search::Narrow, &points, every, odometry);
        if near.as_ref().is_some_and(|near| near.share >= SURE_SHARE) {
            return near;
        }
        let slipped = self.matched_if(Search::Wide, &points, every, odometry);
        points.retain(|point| stood(point));
        let held = self.matched_if(Search::Held, &points, every, odometry);
        let Some(found) = &slipped else { return held };
        let gone = off(found.pose, self.carried(odometry));
        let unlikely = gone.dot(variances(self.slips(odometry)).inverse() * gone).ln_1p();
        let gained = found.votes - held.as_ref().map_or(0.0, |held| held.votes);
        if VOTE * gained > unlikely * (1.0 + movers as f64) { slipped } else { held }
    }

    fn matched_if(
        &mut self,
        search: Search,
        points: &[&Point],
        every: usize,
        odometry: Pose2,
    ) -> Option<Match> {
        let start = self.carried(odometry);
        // The surface has errors, too, but averages over its points.
        let of_lines = 1.0 + 1.0 / every as f64;
        let holds = search == Search::Held;
        // The full deviation: wheels at rest would hold the first round of a search where it is.
        let prior = if holds { self.prior(odometry) } else { variances(PRIOR) }.inverse();
        let mut pose = start;
        let mut gate_m = GATES_M[usize::from(search != Search::Wide)];
        let mut information = DMat3::ZERO;
        let mut squares = 0.0;
        let mut fits = Vec::new();
        let mut votes = 0.0;
        for _ in 0..ROUNDS {
            let turned = DVec2::from_angle(pose.heading);
            fits.clear();
            votes = 0.0;
            for point in points {
                let arm = turned.rotate(point.at);
                let at = pose.position + arm;
                let gate_m = gate_m.max(GATE * point.deviation_m).min(GATES_M[0]);
                let Some(number) = self.index.nearest(&self.surfaces, at, gate_m) else { continue };
                let surface = &mut self.surfaces[number];
                let faces = |normal: DVec2| turned.rotate(normal).dot(surface.normal) > ALIKE;
                if !point.normal.is_none_or(faces) {
                    continue;
                }
                surface.seen_m = self.travelled_m;
                votes += every as f64 * point.vote;
                let off = surface.normal.dot(at - surface.at);
                let by = surface.normal.extend(surface.normal.dot(arm.perp()));
                let variance = of_lines * point.deviation_m * point.deviation_m;
                fits.push((off, by, variance.max(POINT_M * POINT_M).recip()));
            }
            let found = fits.len();
            if found < LEAST_POINTS || (found as f64) < LEAST_SHARE * points.len() as f64 {
                return None;
            }
            let kept = (KEPT_SHARE * found as f64).ceil() as usize;
            fits.select_nth_unstable_by(kept - 1, |a, b| a.0.abs().total_cmp(&b.0.abs()));
            let gone = off(pose, start);
            // Cauchy's weight: wheels that slipped far do not hold the match.
            let weight = if holds { 1.0 } else { (1.0 + gone.dot(prior * gone)).recip() };
            let prior = weight * prior;
            let mut pull = -(prior * gone);
            information = DMat3::ZERO;
            squares = 0.0;
            for (off, by, weight) in &fits[..kept] {
                information += *weight * DMat3::from_cols(by * by.x, by * by.y, by * by.z);
                pull -= weight * off * by;
                squares += weight * off * off / kept as f64;
            }
            let change = (information + prior).inverse() * pull;
            pose.position += change.truncate();
            pose.heading += change.z;
            let is_narrow = gate_m <= GATES_M[1];
            gate_m = (SHRINKS * gate_m).max(GATES_M[1]);
            if is_narrow && change.abs().max_element() < SETTLED {
                break;
            }
        }
        // The identity stands for directions that the scan leaves unconstrained.
        let covariance =
            (information + DMat3::IDENTITY).inverse() * squares.clamp(SCALES[0], SCALES[1]);
        let all = every as f64 * points.iter().map(|point| point.vote).sum::<f64>();
        (is_finite(pose) && covariance.is_finite()).then(|| Match {
            pose,
            covariance,
            votes,
            share: votes / all,
        })
    }

    /// Makes the newest match a keyframe, and returns the share of its points that are new.
    fn add(&mut self, fan: &Fan<'_>, points: &[Point]) -> f64 {
        let Pose2 { position, heading } = self.pose;
        let turned = DVec2::from_angle(heading);
        let is_gone = |surface: &Surface| {
            let from = DVec2::from_angle(-heading).rotate(surface.at - position) - fan.origin;
            let beam = fan.beam_along(from);
            let through = |beam: usize| fan.range(beam) > from.length() + THROUGH_M;
            (beam.saturating_sub(1)..=beam + 1).all(through)
        };
        let oldest_m = self.travelled_m - KEPT_M;
        self.surfaces.retain(|surface| surface.seen_m >= oldest_m && !is_gone(surface));
        self.reindex();
        let mut new = 0_u32;
        let mut all = 0_u32;
        for Point { at, normal, deviation_m, .. } in points {
            let Some(normal) = normal else { continue };
            all += 1;
            let at = position + turned.rotate(*at);
            let [held_m, known_m] =
                [SPACING_M, GATES_M[1]].map(|it| it.max(GATE * deviation_m).min(GATES_M[0]));
            let near = self.index.nearest(&self.surfaces, at, known_m);
            new += u32::from(near.is_none());
            let is_near = |other: &Surface| other.at.distance(at) <= held_m;
            if !near.is_some_and(|near| is_near(&self.surfaces[near]))
                && !self.surfaces.last().is_some_and(is_near)
            {
                let normal = turned.rotate(*normal);
                self.surfaces.push(Surface { at, normal, seen_m: self.travelled_m });
            }
        }
        self.reindex();
        self.keyframe = self.pose;
        f64::from(new) / f64::from(all.max(1))
    }

    /// Indexes the surfaces, without those beyond a laser's reach.
    fn reindex(&mut self) {
        let there = self.pose.position;
        self.surfaces.retain(|surface| {
            surface.at.distance(there) <= FARTHEST_M && surface.normal.is_normalized()
        });
        if self.surfaces.len() > MOST_SURFACES {
            self.surfaces.sort_by(|one, other| other.seen_m.total_cmp(&one.seen_m));
            self.surfaces.truncate(MOST_SURFACES);
        }
        self.index = Index::new(&self.surfaces);
    }

    /// Returns the deviations of wheels that may have slipped since the newest match.
    fn slips(&self, odometry: Pose2) -> [f64; 2] {
        let way_m = odometry.position.distance(self.odometry.position);
        let turn = (odometry.heading - self.odometry.heading).abs();
        [way_m + ARM_M * turn, way_m + turn].map(|motion| AT_REST + SLIPS * motion)
    }

    fn prior(&self, odometry: Pose2) -> DMat3 {
        let [place, heading] = self.slips(odometry);
        variances([place.min(PRIOR[0]), heading.min(PRIOR[1])])
    }

    /// Returns the newest match, moved as the wheels went since.
    pub(crate) fn carried(&self, odometry: Pose2) -> Pose2 {
        let turned = DVec2::from_angle(self.pose.heading - self.odometry.heading);
        let went = turned.rotate(odometry.position - self.odometry.position);
        let heading = self.pose.heading + odometry.heading - self.odometry.heading;
        Pose2 { position: self.pose.position + went, heading }
    }
}

fn is_finite(pose: Pose2) -> bool {
    pose.position.is_finite() && pose.heading.is_finite()
}

fn off(pose: Pose2, from: Pose2) -> DVec3 {
    (pose.position - from.position).extend(pose.heading - from.heading)
}

fn variances([place, heading]: [f64; 2]) -> DMat3 {
    DMat3::from_diagonal(DVec3::new(place, place, heading).map(|deviation| deviation * deviation))
}

#[cfg(test)]
mod tests {
    use std::sync::LazyLock;

    use super::*;
    use crate::testing::{mission, range_in_room};
    use common::samples::PoseSample;
    use glam::dvec2;

    const START: Pose2 = Pose2 { position: DVec2::ZERO, heading: 0.0 };
    const ROOM: DVec2 = dvec2(3.0, 2.0);
    const CORRIDOR: DVec2 = dvec2(f64::INFINITY, 2.0);

    static MISSION: LazyLock<Mission> = LazyLock::new(|| {
        mission("target = [3, 0]\nrobot.model = 'turtlebot3-waffle'\nrobot.rate_hz = 10")
    });

    static MATCHER: LazyLock<(ScanMatcher, Rows)> =
        LazyLock::new(|| (ScanMatcher::new(&MISSION), Rows::new(&MISSION)));

    fn matched(
        held: &mut Option<Surroundings>,
        Pose2 { position: DVec2 { x: x_m, y: y_m }, heading: heading_rad }: Pose2,
        beams: &[f32],
    ) -> Option<FixSample> {
        let robot = PoseSample { x_m, y_m, heading_rad, ..PoseSample::default() };
        let scan = Placed { row: 0, robot, capture_ns: 0, beams: beams.to_vec() };
        MATCHER.0.step(&MATCHER.1, held, &[scan], &mut Movers::default())
    }

    /// Returns what a robot holds after this scan at its start.
    fn started(beams: &[f32]) -> Option<Surroundings> {
        let mut held = None;
        matched(&mut held, START, beams);
        held
    }

    fn off_m(fix: &FixSample, truth: DVec2) -> f64 {
        dvec2(fix.x_m, fix.y_m).distance(truth)
    }

    /// Returns the scan of a robot at `pose` in a room of this half size.
    fn scan(pose: Pose2, half_m: DVec2) -> Vec<f32> {
        let mount = MISSION.sensor_table()[0].mount.on(pose);
        let beam = |beam| {
            let angle = mount.heading - std::f64::consts::PI + f64::from(beam).to_radians();
            let range = range_in_room(half_m, mount.position, DVec2::from_angle(angle));
            if range <= 8.0 { range as f32 } else { f32::INFINITY }
        };
        (0..360).map(beam).collect()
    }

    #[test]
    fn along_a_corridor_the_wheels_are_believed() {
        let beams = scan(START, CORRIDOR);
        let wheels = Pose2 { position: dvec2(0.3, 0.05), heading: 0.02 };
        let fix = matched(&mut started(&beams), wheels, &beams).unwrap();
        assert!((fix.x_m - 0.3).abs() < 0.01 && fix.y_m.abs() < 0.01, "{fix:?}");
        assert!(fix.covariance[0] > 100.0 * fix.covariance[3], "{fix:?}");
    }

    /// Returns scans as [`scan`] does, with the noise of the laser's model.
    fn noisy() -> impl FnMut(Pose2) -> Vec<f32> {
        let mut random = 1_u32;
        move |pose| {
            let mut beams = scan(pose, ROOM);
            for range in &mut beams {
                // A sum of twelve uniform numbers is nearly normal.
                let noise: f64 = (0..12)
                    .map(|_| {
                        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                        f64::from(random) / f64::from(u32::MAX) - 0.5
                    })
                    .sum();
                let (least_m, share) = MISSION.sensor_table()[0].model.product().noise;
                let exact = f64::from(*range);
                *range = (exact + noise * (least_m + share * exact)) as f32;
            }
            beams
        }
    }

    /// Drives an ellipse by scans with noise; returns the matches' error, and its ratio to
    /// what they state: squares over variances.
    fn ellipse(held: &mut Option<Surroundings>) -> (f64, f64) {
        let mut noisy = noisy();
        let (mut last_m, mut squares, mut stated) = (0.0, 0.0, 0.0);
        for step in 0..200 {
            let (sin, cos) = (f64::from(step) * 0.03).sin_cos();
            let truth = Pose2 { position: dvec2(sin, 0.6 - 0.6 * cos), heading: 0.0 };
            // The wheels slip: a tenth too far, and a turn of 0.5 degrees per scan.
            let heading = 0.01 * f64::from(step);
            let wheels = Pose2 { position: 1.1 * truth.position, heading };
            if let Some(fix) = matched(held, wheels, &noisy(truth)) {
                last_m = off_m(&fix, truth.position);
                squares += last_m * last_m;
                stated += fix.covariance[0] + fix.covariance[3];
            }
        }
        (last_m, squares / stated)
    }

    #[test]
    fn scans_hold_the_pose_of_a_robot_whose_wheels_slip_and_say_how_well() {
        let (last_m, ratio) = ellipse(&mut None);
        assert!(last_m < 0.02 && (0.02..1.0).contains(&ratio), "{last_m} {ratio}");
    }

    #[test]
    fn a_missing_beam_and_a_thing_in_front_change_nothing() {
        let there = Pose2 { position: dvec2(0.3, 0.1), heading: 0.2 };
        let mut beams = scan(there, ROOM);
        for (beam, range) in beams.iter_mut().enumerate() {
            match beam {
                40..55 => *range = 0.8,
                _ if beam % 5 == 0 => *range = f32::NAN,
                _ => {}
            }
        }
        let fix = matched(&mut started(&scan(START, ROOM)), START, &beams).unwrap();
        let off_m = off_m(&fix, there.position);
        assert!(off_m < 0.01 && (fix.heading_rad - 0.2).abs() < 0.005, "{fix:?}");
    }

    #[test]
    fn a_near_drum_that_passes_a_standing_robot_does_not_take_it_along() {
        // Six far posts stand; the drum has more beams than all of them.
        let scan = |drum: DVec2| {
            let posts = (-3..3).map(|post| (5.0 * DVec2::from_angle(0.5 * f64::from(post)), 0.3));
            let discs = Vec::from_iter(posts.chain([(drum, 0.6)]));
            let beam = |beam| {
                let along = DVec2::from_angle(f64::from(beam - 180).to_radians());
                let origin = MISSION.sensor_table()[0].mount.on(START).position;
                let ends = discs.iter().filter_map(|(at, radius)| {
                    let (near, aside) = ((*at - origin).dot(along), (*at - origin).perp_dot(along));
                    (near > 0.0 && aside.abs() < *radius)
                        .then(|| near - (radius * radius - aside * aside).sqrt())
                });
                ends.fold(f64::INFINITY, f64::min) as f32
            };
            Vec::from_iter((0..360).map(beam))
        };
        let drum = |step: i32| dvec2(0.2 * f64::from(step) - 1.0, 1.2);
        let (mut held, mut movers) = (None, Movers::default());
        for step in 0..10 {
            let capture_ns = 140_000_000 * step as u64;
            let beams = scan(drum(step));
            let scan = Placed { row: 0, robot: PoseSample::default(), capture_ns, beams };
            MATCHER.0.step(&MATCHER.1, &mut held, &[scan], &mut movers);
            let off_m = held.as_ref().unwrap().pose.position.length();
            assert!(off_m < 0.02, "{step}: {off_m}");
        }
    }

    #[test]
    fn a_thing_is_not_taken_for_another_one_beside_it() {
        // The corridor ends ahead.
        let ends_at = |x: f64| {
            let mut beams = scan(START, CORRIDOR);
            for (beam, range) in beams.iter_mut().enumerate().take(200).skip(161) {
                *range = ((x + 0.064) / (beam as f64 - 180.0).to_radians().cos()) as f32;
            }
            beams
        };
        let x_m = matched(&mut started(&ends_at(2.0)), START, &ends_at(2.2)).unwrap().x_m;
        assert!(x_m.abs() < 0.02, "{x_m}");
    }

    #[test]
    fn a_robot_that_sees_nothing_known_goes_on_by_its_wheels_and_says_so() {
        let room = scan(START, ROOM);
        let held = &mut started(&room);
        let hall = Vec::from_iter(room.iter().map(|range| 2.5 * range));
        let there = Pose2 { position: dvec2(0.2, 0.0), heading: 0.1 };
        assert_eq!(matched(held, there, &hall), None);
        let fix = matched(held, there, &hall).unwrap();
        assert!(fix.x_m > 0.19 && fix.shared[0] >= (LOST * PRIOR[0]).powi(2), "{fix:?}");
    }

    #[test]
    fn wild_numbers_of_a_saved_state_are_dropped() {
        let beams = scan(START, ROOM);
        let held = started(&beams);
        for wild in [f64::NAN, f64::INFINITY, 1e300, -1e12] {
            let mut saved = held.clone();
            let surroundings = saved.as_mut().unwrap();
            surroundings.index = Index::default();
            surroundings.surfaces[3].at.x = wild;
            surroundings.surfaces[4].normal.y = wild;
            assert!(matched(&mut saved, START, &beams).is_some());
            saved.as_mut().unwrap().pose.position.y = wild;
            matched(&mut saved, START, &beams);
            assert!(matched(&mut saved, START, &beams).is_some(), "{wild}: lost for good");
        }
    }

    #[test]
    fn surroundings_of_most_surfaces_fit_their_file_and_match_as_before() {
        let mut held = None;
        ellipse(&mut held);
        let full = held.as_mut().unwrap();
        full.surfaces = full.surfaces.iter().copied().cycle().take(MOST_SURFACES).collect();
        full.reindex();
        let saved = postcard::to_allocvec(&held).unwrap();
        assert!(saved.len() <= Surroundings::MOST_BYTES);
        let mut restored: Option<Surroundings> = postcard::from_bytes(&saved).unwrap();
        restored.as_mut().unwrap().reindex();
        assert_eq!(held, restored);
        restored.as_mut().unwrap().index = Index::default();
        let Surroundings { pose, odometry, .. } = held.clone().unwrap();
        let beams = scan(pose, ROOM);
        let fixes = [&mut held, &mut restored].map(|held| matched(held, odometry, &beams));
        assert!(fixes[0].is_some());
        assert_eq!(fixes[0], fixes[1]);
        assert_eq!(held, restored);
    }
}
