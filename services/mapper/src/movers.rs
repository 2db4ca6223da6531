//! Laser tracker of moving objects.
//!
//! Gapless runs of beams form objects. A constant-velocity Kalman filter tracks their middles in
//! the scan matcher's frame, which other fixes do not move. A mover's velocity and travel exceed
//! their uncertainty, and it was seen whole where an earlier scan saw farther or less far.
//!
//! The visible middle of a partly hidden object slides along it, so its deviation is its
//! half-width. For a mover of known width, the middle follows from its visible end. Only mutually
//! nearest objects and tracks match; otherwise tracks would jump between posts. A mover missing at
//! its predicted place may have turned round and takes the nearest unmatched object.
//!
//! While something moves, a beam counts as static only if a scan [`STANDS_S`] earlier had a surface
//! at its end.

use std::{collections::VecDeque, f64::consts::FRAC_PI_4};

use common::{
    kinematics::Pose2,
    samples::{GridHeader, Mover, PoseSample},
};
use glam::DVec2;

use crate::{
    deskew::Placed,
    reading::{Fan, GAP_M, Rows},
};

/// Interval of tracked scans, least age of a scan that shows what stood, age of scans that show
/// motion and rest, and retention of scans.
const APART_S: f64 = 0.09;
const STOOD_S: f64 = 0.25;
const CAME_S: f64 = 0.4;
const STANDS_S: f64 = 1.5;
const KEPT_S: f64 = 2.0;
/// Time after the last mover during which objects may still move.
const MOVES_FOR_S: f64 = 10.0;
/// Range difference that indicates another surface: metres, and deviations of a reading.
const OTHER_M: f64 = 0.12;
const OTHER: f64 = 3.0;
/// Minimum number of beams; fewer may hit any of several posts.
const LEAST_BEAMS: usize = 4;
/// One in this many of an object's beams must end where it newly appeared.
const OF_BEAMS: usize = 6;
/// Maximum width of a tracked object.
pub(crate) const WIDEST_M: f64 = 1.6;
/// Maximum expected speed, and distance between two middles of a static object.
const FASTEST_M_S: f64 = 2.5;
const NEAR_M: f64 = 0.15;
/// Time until a track missing at its predicted place, or a hidden mover, is dropped. Meanwhile its
/// uncertainty grows at [`HIDDEN_M_S`].
const FORGOTTEN_S: f64 = 1.0;
const HIDDEN_S: f64 = 6.0;
const HIDDEN_M_S: f64 = 0.2;
/// Deviation of an unknown velocity, and growth of its variance per second.
const FIRST_M_S: f64 = 1.2;
const GROWS: f64 = 0.1;
/// Requirements for a mover: speed, also in deviations, sightings, tracked time, and share of
/// recent positions where it newly appeared.
const LEAST_M_S: f64 = 0.25;
const SURE: f64 = 3.0;
const LEAST_PLACES: u32 = 3;
const FOLLOWED_S: f64 = 0.25;
const CAME_SHARE: f64 = 0.3;
/// Weight of the newest position in this share.
const NEWEST: f64 = 0.15;
/// Deviation of a visible middle: the surface is unknown.
const MIDDLE_M: f64 = 0.03;
/// Share of a seen radius kept at the next scan, which may see less.
const RADIUS_LEFT: f64 = 0.98;

#[derive(Clone, Copy)]
struct Thing {
    at_s: f64,
    origin: DVec2,
    /// First and last end, unless something in front hides the rest.
    own: [Option<DVec2>; 2],
    mean: DVec2,
    nearest_m: f64,
    half_width_m: f64,
    noise_m: f64,
    came: bool,
}

/// Constant-velocity track; accelerations are process noise.
#[derive(Clone, Copy, Debug)]
struct Track {
    first: (DVec2, f64),
    since_s: f64,
    seen_s: f64,
    was_whole: bool,
    places: u32,
    /// Share of recent positions where it newly appeared.
    came: f64,
    radius_m: f64,
    is_mover: bool,
    /// Position at `seen_s`.
    middle: DVec2,
    velocity: DVec2,
    /// Position variance, covariance with velocity, velocity variance.
    variance: [f64; 3],
}

type Kept = (f64, Pose2, Vec<f32>);

/// Tracker state, unsaved: the next process finds movers again within a second.
#[derive(Clone, Debug, Default)]
pub(crate) struct Movers {
    /// Times, poses and beams, oldest first.
    scans: VecDeque<Kept>,
    tracks: Vec<Track>,
    seen_s: Option<f64>,
    placed: Vec<Mover>,
}

impl Movers {
    /// Tracks the objects of a scan seen from `robot`, in the frame of all scans before.
    ///
    /// Returns its beams without those that may end on moving surfaces; none if nothing moves.
    pub(crate) fn take(&mut self, rows: &Rows, scan: &Placed, robot: Pose2) -> Option<Vec<f32>> {
        let at_s = scan.capture_ns as f64 * 1e-9;
        let fan = rows.scan(scan.row, robot, &scan.beams)?;
        let scans = std::mem::take(&mut self.scans);
        let older = |by_s| older(&scans, rows, scan.row, at_s, by_s);
        let is_next = scans.back().is_none_or(|(newest, ..)| at_s - newest >= APART_S);
        if is_next {
            // At first, no scan is that old.
            let came_s = scans.front().map_or(CAME_S, |(first_s, ..)| at_s - first_s);
            let came_s = came_s.clamp(0.5 * CAME_S, CAME_S);
            let before = older(came_s);
            let laser =
                before.map_or(DVec2::ZERO, |(ago_s, before)| (fan.origin - before.origin) / ago_s);
            let before = before.map(|(_, before)| before);
            self.follow(&things(&fan, before.as_ref(), at_s), &fan, at_s, laser);
        }
        debug_assert!(scans.iter().is_sorted_by(|one, next| one.0 < next.0));
        let moves = self.seen_s.is_some_and(|seen_s| at_s - seen_s <= MOVES_FOR_S);
        let beams = moves.then(|| {
            let before = older(STANDS_S);
            let stands = |end: DVec2| {
                before.is_some_and(|(_, before)| Difference::of(&before, end).has_same())
            };
            let beams = scan.beams.iter().zip(fan.ends());
            beams
                .map(|(beam, end)| if end.is_some_and(stands) { *beam } else { f32::NAN })
                .collect()
        });
        self.scans = scans;
        if is_next {
            self.scans.retain(|(then, ..)| at_s - then <= KEPT_S);
            self.scans.push_back((at_s, robot, scan.beams.clone()));
            assert!((self.scans.len() as f64) < KEPT_S / APART_S + 2.0);
        }
        beams
    }

    pub(crate) fn count(&self) -> usize {
        self.tracks.iter().filter(|track| track.is_mover).count()
    }

    /// `place` is in the frame of the scans.
    pub(crate) fn are_at(&self, place: DVec2, at_s: f64) -> bool {
        self.tracks.iter().filter(|track| track.is_mover).any(|track| {
            let doubt_m = (SURE * track.variance_at(at_s)[0].sqrt()).min(track.radius_m);
            track.at(at_s).distance(place) <= track.radius_m + NEAR_M + doubt_m
        })
    }

    /// Returns which places of a scan's ends showed a surface [`STOOD_S`] earlier too; all if no
    /// scan is that old.
    pub(crate) fn stood(&self, rows: &Rows, row: usize, at_s: f64) -> impl Fn(DVec2) -> bool {
        let before = older(&self.scans, rows, row, at_s, STOOD_S);
        move |place| before.as_ref().is_none_or(|(_, it)| Difference::of(it, place).has_same())
    }

    fn follow(&mut self, things: &[Thing], fan: &Fan<'_>, at_s: f64, laser: DVec2) {
        self.tracks.retain(|track| {
            let age_s = at_s - track.seen_s;
            age_s <= FORGOTTEN_S || age_s <= HIDDEN_S && track.is_hidden(fan, at_s)
        });
        let mut is_free = vec![true; things.len()];
        debug_assert!(self.tracks.iter().all(|track| track.seen_s < at_s));
        for turns in [false, true] {
            let mut pairs = Vec::new();
            for (index, track) in self.tracks.iter().enumerate() {
                if track.seen_s < at_s && (track.is_mover || !turns) {
                    let most_m = track.most_off_m(at_s, turns);
                    let near = things.iter().enumerate().filter(|(thing, _)| is_free[*thing]);
                    let near = near.map(|(thing, it)| {
                        (it.middle(track).0.distance(track.at(at_s)), index, thing)
                    });
                    pairs.extend(near.filter(|(off_m, ..)| *off_m <= most_m));
                }
            }
            pairs.sort_by(|one, other| one.0.total_cmp(&other.0));
            for (_, track, thing) in pairs {
                let track = &mut self.tracks[track];
                if track.seen_s < at_s && is_free[thing] {
                    track.see(&things[thing], laser, turns);
                    is_free[thing] = false;
                }
            }
        }
        debug_assert!(
            self.tracks.iter().filter(|track| track.seen_s == at_s).count() <= things.len()
        );
        let new = things.iter().zip(is_free).filter(|(_, is_free)| *is_free);
        self.tracks.extend(new.map(|(thing, _)| Track::new(thing)));
        if self.count() > 0 {
            self.seen_s = Some(at_s);
        }
    }

    /// Places the movers around `pose`, which is `robot` in the frame of the scans.
    pub(crate) fn place(&mut self, pose: &PoseSample, robot: Pose2) {
        let turned = DVec2::from_angle(pose.heading_rad - robot.heading);
        let at_s = pose.stamp.seconds();
        let robot = turned.rotate(robot.position);
        let [x, y] = (pose.pose().position - robot).to_array();
        let movers = self.tracks.iter().filter(|it| it.is_mover && at_s - it.seen_s <= HIDDEN_S);
        let mover = |track: &Track| {
            let unseen_s = (at_s - track.seen_s - CAME_S).max(0.0);
            let [place, _, velocity] = track.variance.map(f64::sqrt);
            let at = turned.rotate(track.at(at_s));
            let toward = turned.rotate(track.velocity);
            Mover {
                x_m: (at.x + x) as f32,
                y_m: (at.y + y) as f32,
                vx_m_s: toward.x as f32,
                vy_m_s: toward.y as f32,
                radius_m: track.radius_m as f32,
                doubt_m: (place + HIDDEN_M_S * unseen_s) as f32,
                doubt_m_s: velocity as f32,
            }
        };
        self.placed = movers.map(mover).collect();
    }

    pub(crate) fn fill(&self, header: &mut GridHeader) {
        assert_eq!(header.mover_count, 0);
        for (mover, placed) in header.movers.iter_mut().zip(&self.placed) {
            *mover = *placed;
            header.mover_count += 1;
        }
    }
}

impl Track {
    fn new(thing: &Thing) -> Self {
        let mut track = Self {
            first: (DVec2::ZERO, 0.0),
            since_s: thing.at_s,
            seen_s: thing.at_s,
            was_whole: thing.is_whole(),
            places: 1,
            came: f64::from(thing.came),
            radius_m: thing.half_width_m,
            is_mover: false,
            middle: DVec2::ZERO,
            velocity: DVec2::ZERO,
            variance: [0.0; 3],
        };
        track.first = thing.middle(&track);
        track.middle = track.first.0;
        track.variance = [track.first.1.powi(2), 0.0, FIRST_M_S.powi(2)];
        track
    }

    fn at(&self, at_s: f64) -> DVec2 {
        self.middle + (at_s - self.seen_s) * self.velocity
    }

    fn variance_at(&self, at_s: f64) -> [f64; 3] {
        let for_s = at_s - self.seen_s;
        let [place, both, velocity] = self.variance;
        let grown = GROWS * for_s;
        [
            place + for_s * (2.0 * both + for_s * (velocity + grown / 3.0)),
            both + for_s * (velocity + grown / 2.0),
            velocity + grown,
        ]
    }

    fn is_hidden(&self, fan: &Fan<'_>, at_s: f64) -> bool {
        let way = self.at(at_s) - fan.origin;
        // Outside the fan, or too near, there is no reading.
        let is_seen = fan.range(fan.beam_along(way)) >= way.length() - self.radius_m - GAP_M;
        self.is_mover && !is_seen
    }

    fn most_off_m(&self, at_s: f64, turns: bool) -> f64 {
        let way_m = if turns { 2.0 * FASTEST_M_S * (at_s - self.seen_s).min(CAME_S) } else { 0.0 };
        NEAR_M + (SURE * self.variance_at(at_s)[0].sqrt()).max(way_m).min(WIDEST_M)
    }

    fn see(&mut self, thing: &Thing, laser: DVec2, turns: bool) {
        // An object that comes into view seems to move until it is whole.
        if !self.was_whole && thing.is_whole() {
            *self = Self::new(thing);
            return;
        }
        assert!(self.seen_s < thing.at_s);
        let (middle, doubt_m) = thing.middle(self);
        let off = middle - self.at(thing.at_s);
        let [place, both, velocity] = self.variance_at(thing.at_s);
        let velocity = if turns { FIRST_M_S.powi(2) } else { velocity };
        let both = if turns { place.sqrt() * FIRST_M_S } else { both };
        let gain = [place, both].map(|it| it / (place + doubt_m.powi(2)));
        self.middle = self.at(thing.at_s) + gain[0] * off;
        self.velocity += gain[1] * off;
        self.variance =
            [(1.0 - gain[0]) * place, (1.0 - gain[0]) * both, velocity - gain[1] * both];
        self.seen_s = thing.at_s;
        assert!(!self.variance.iter().any(|variance| *variance < -1e-9));
        self.places += 1;
        self.came += NEWEST.max(1.0 / f64::from(self.places)) * (f64::from(thing.came) - self.came);
        assert!((0.0..=1.0).contains(&self.came));
        self.radius_m = thing.half_width_m.max(RADIUS_LEFT * self.radius_m);
        let deviation_m_s = self.variance[2].sqrt();
        // A reflection in glass appears where the laser is perpendicular to it and follows the
        // robot.
        let aside = (thing.mean - thing.origin).normalize_or_zero().perp();
        let glint = aside * aside.dot(laser);
        let speed = self.velocity.length();
        self.is_mover = if self.is_mover {
            speed > 0.5 * LEAST_M_S
        } else {
            self.places >= LEAST_PLACES
                && thing.at_s - self.since_s >= FOLLOWED_S
                && self.came >= CAME_SHARE
                && speed > LEAST_M_S.max(SURE * deviation_m_s)
                && self.middle.distance(self.first.0) > self.first.1 + doubt_m
                && self.velocity.distance(glint) > SURE * deviation_m_s
        };
    }
}

impl Thing {
    fn is_whole(&self) -> bool {
        self.own.iter().all(Option::is_some)
    }

    /// Returns the object's middle as a part of `track`, and its deviation. A disc's ends lie on
    /// its near side.
    fn middle(&self, track: &Track) -> (DVec2, f64) {
        let along = (self.mean - self.origin).normalize_or_zero();
        let hidden = self.own.iter().filter(|it| it.is_none()).count() as f64;
        let radius_m = if hidden == 0.0 { self.half_width_m } else { track.radius_m };
        let whole = self.mean + FRAC_PI_4 * radius_m * along;
        match self.own {
            [Some(end), None] | [None, Some(end)] if track.is_mover => {
                let aside = along.perp() * along.perp().dot(self.mean - end).signum();
                let middle = along * (self.nearest_m + radius_m)
                    + aside * (aside.dot(end - self.origin) + radius_m);
                let hidden_m = (radius_m - self.half_width_m).max(0.0);
                (self.origin + middle, self.noise_m + 0.5 * hidden_m)
            }
            _ => (whole, self.noise_m + hidden * self.half_width_m),
        }
    }
}

/// Returns the newest scan that is `by_s` seconds older, and its age.
fn older<'a>(
    scans: &'a VecDeque<Kept>,
    rows: &Rows,
    row: usize,
    at_s: f64,
    by_s: f64,
) -> Option<(f64, Fan<'a>)> {
    let (then_s, robot, beams) = scans.iter().rev().find(|(then, ..)| at_s - then >= by_s)?;
    Some((at_s - then_s, rows.scan(row, *robot, beams)?))
}

fn things(fan: &Fan<'_>, before: Option<&Fan<'_>>, at_s: f64) -> Vec<Thing> {
    let ends: Vec<_> = fan.ends().collect();
    let count = ends.len();
    let is_circle = fan.is_circle();
    let range = |beam: usize| {
        ends[beam % count].map_or(f64::INFINITY, |end: DVec2| end.distance(fan.origin))
    };
    let joins = |beam: usize| {
        let pair = ends[beam % count].zip(ends[(beam + 1) % count]);
        pair.is_some_and(|(one, next)| fan.joins(one, next))
    };
    // Cut a circle at a gap.
    let cut = (0..count).find(|beam| is_circle && !joins(*beam)).map_or(0, |beam| beam + 1);
    let end = cut + count;
    let mut things = Vec::new();
    let mut first = cut;
    while first < end {
        let last = (first..end - 1).find(|beam| !joins(*beam)).unwrap_or(end - 1);
        let points: Vec<_> = (first..=last).filter_map(|beam| ends[beam % count]).collect();
        // An end belongs to the object if the next beam ends behind it.
        let is_own = |beam: usize, next: Option<usize>| {
            next.is_some_and(|it| !fan.beams[it % count].is_nan() && range(it) > range(beam))
        };
        let next = (is_circle || last + 1 < count).then_some(last + 1);
        let former = if is_circle { Some(first + count - 1) } else { first.checked_sub(1) };
        let [from_own, to_own] = [is_own(first, former), is_own(last, next)];
        first = last + 1;
        let [Some(from), Some(to)] = [points.first(), points.last()] else { continue };
        let width_m = from.distance(*to);
        let number = points.len() as f64;
        if width_m > WIDEST_M {
            continue;
        }
        let mean = points.iter().sum::<DVec2>() / number;
        let spacing_m = fan.step_rad * mean.distance(fan.origin);
        let half_width_m = 0.5 * (width_m + spacing_m);
        let noise_m = MIDDLE_M + 0.5 * spacing_m + fan.deviation_m(mean) / number.sqrt();
        let nearest_m =
            points.iter().map(|it| it.distance(fan.origin)).fold(f64::INFINITY, f64::min);
        let came = before.is_some_and(|before| {
            let came = points.iter().filter(|it| Difference::of(before, **it).is_other());
            let is_whole = from_own && to_own && points.len() >= LEAST_BEAMS;
            is_whole && came.count() * OF_BEAMS >= points.len()
        });
        let own = [from_own.then_some(*from), to_own.then_some(*to)];
        let origin = fan.origin;
        things.push(Thing { at_s, origin, own, mean, nearest_m, half_width_m, noise_m, came });
    }
    things
}

/// Distances behind a point at which three earlier beams ended; NaN without an end.
struct Difference {
    by_beams: [f64; 3],
    most_m: f64,
}

impl Difference {
    fn of(before: &Fan<'_>, end: DVec2) -> Self {
        let way = end - before.origin;
        assert!(before.step_rad > 0.0);
        let beam = before.beam_along(way);
        let count = before.beams.len();
        let by = |beside: usize| {
            let beam = beam + count + beside - 1;
            let beam = if before.is_circle() { beam % count } else { beam.wrapping_sub(count) };
            let range = before.range(beam);
            if range <= before.reach_m { range - way.length() } else { f64::NAN }
        };
        Self { by_beams: [by(0), by(1), by(2)], most_m: OTHER_M + OTHER * before.deviation_m(end) }
    }

    fn has_same(&self) -> bool {
        self.by_beams.iter().any(|by| by.abs() <= self.most_m)
    }

    fn is_other(&self) -> bool {
        let all = |side: f64| self.by_beams.iter().all(|by| side * by > self.most_m);
        all(1.0) || all(-1.0)
    }
}

#[cfg(test)]
mod tests {
    use common::{bus::Stamp, clock::MissionTime};

    use super::*;
    use crate::testing::{mission, range_in_room};
    use glam::dvec2;

    const PERIOD_S: f64 = 1.0 / 7.0;
    /// Start, velocity and radius.
    const WALKER: (DVec2, DVec2, f64) = (dvec2(3.5, -1.0), dvec2(-0.8, -0.3), 0.25);

    /// A robot with a laser drives along x at 0.5 m/s in a room of 10 m by 8 m. Discs have starts,
    /// velocities and radii.
    struct Room {
        rows: Rows,
        movers: Movers,
        discs: Vec<(DVec2, DVec2, f64)>,
    }

    impl Room {
        fn new(discs: &[(DVec2, DVec2, f64)]) -> Self {
            let mission = mission("target = [3, 0]\nrobot.model = 'kobuki'");
            Self { rows: Rows::new(&mission), movers: Movers::default(), discs: discs.to_vec() }
        }

        fn tick(&mut self, tick: u64) -> (Placed, Option<Vec<f32>>) {
            let at_s = PERIOD_S * tick as f64;
            let time = MissionTime::from_seconds(at_s);
            let stamp = Stamp { tick, stamp_ns: time.0, ..Stamp::default() };
            let robot = PoseSample { stamp, x_m: 0.5 * at_s, ..PoseSample::default() };
            let blank = vec![0.0; 360];
            let fan = self.rows.scan(0, robot.pose(), &blank).unwrap();
            let beams = fan.iter().map(|(along, _)| {
                let discs = self.discs.iter().filter_map(|(start, velocity, radius)| {
                    let way = *start + *velocity * at_s - fan.origin;
                    let (near, aside) = (way.dot(along), way.perp_dot(along));
                    let ends = near > 0.0 && aside.abs() < *radius;
                    ends.then(|| near - (radius * radius - aside * aside).sqrt())
                });
                let walls = range_in_room(dvec2(5.0, 4.0), fan.origin, along);
                discs.fold(walls, f64::min) as f32
            });
            let scan = Placed { row: 0, robot, capture_ns: time.0, beams: beams.collect() };
            let taken = self.movers.take(&self.rows, &scan, robot.pose());
            self.movers.place(&robot, robot.pose());
            (scan, taken)
        }
    }

    #[test]
    fn a_mover_is_hidden_right_behind_a_laser_too_and_not_where_the_laser_sees_through() {
        let mission = mission("target = [3, 0]\nrobot.model = 'jackal'");
        let (rows, beams) = (Rows::new(&mission), mission.laser().unwrap().1.beams);
        let is_hidden = |x_m: f64, range_m: f32| {
            let beams = vec![range_m; beams];
            let fan = rows.scan(0, Pose2::default(), &beams).unwrap();
            let middle = fan.origin + dvec2(x_m, 0.0);
            let thing = Thing {
                at_s: 0.0,
                origin: DVec2::ZERO,
                own: [None; 2],
                mean: middle,
                nearest_m: middle.length(),
                half_width_m: 0.4,
                noise_m: 0.05,
                came: true,
            };
            let track = Track { middle, is_mover: true, ..Track::new(&thing) };
            track.is_hidden(&fan, 0.0)
        };
        assert!([-0.6, -3.0].iter().all(|behind| is_hidden(*behind, 8.0)));
        assert!(is_hidden(3.0, 1.0) && !is_hidden(3.0, 8.0) && !is_hidden(0.6, 8.0));
    }

    #[test]
    fn what_moves_is_known_within_a_second_with_its_velocity_and_posts_that_the_robot_passes_stand()
    {
        let posts = [1.0, 1.5, 2.0].map(|x| (dvec2(x, 1.0), DVec2::ZERO, 0.05));
        let mut room = Room::new(&posts);
        for tick in 0..30 {
            room.tick(tick);
            assert!(room.movers.placed.is_empty(), "{tick}: {:?}", room.movers.placed);
        }
        let mut room = Room::new(&[&posts[..], &[WALKER]].concat());
        (0..=7).for_each(|tick| drop(room.tick(tick)));
        let [mover] = room.movers.placed[..] else { panic!("{:?}", room.movers.placed) };
        let (start, velocity, _) = WALKER;
        let there = start + velocity * 7.0 * PERIOD_S;
        let off_m = there.distance(mover.place());
        let off_m_s = velocity.distance(mover.velocity());
        assert!(off_m < 0.1 && off_m_s < 0.15, "{mover:?} {off_m} {off_m_s}");
    }

    #[test]
    fn a_mover_that_turns_round_stays_known_and_its_velocity_is_right_within_a_second() {
        let velocity = dvec2(0.0, -1.5);
        let mut room = Room::new(&[(dvec2(3.0, 2.0), velocity, 0.3)]);
        (0..8).for_each(|tick| drop(room.tick(tick)));
        let turned = room.discs[0].0 + 2.0 * velocity * 7.0 * PERIOD_S;
        room.discs[0] = (turned, -velocity, 0.3);
        for tick in 8..16 {
            room.tick(tick);
            assert_eq!(room.movers.placed.len(), 1, "{tick}: {:?}", room.movers.placed);
        }
        let mover = room.movers.placed[0];
        let off_m_s = mover.velocity().distance(-velocity);
        assert!(off_m_s < 0.3, "{mover:?}");
    }

    #[test]
    fn only_beams_that_end_on_what_stands_are_kept_while_something_moves() {
        let mut room = Room::new(&[WALKER]);
        let first = (0..16).find(|tick| room.tick(*tick).1.is_some());
        let (scan, beams) = room.tick(first.unwrap() + 8);
        let beams = beams.unwrap();
        let fan = room.rows.scan(0, scan.robot.pose(), &scan.beams).unwrap();
        let at_s = scan.capture_ns as f64 * 1e-9;
        let (mut on_walker, mut on_walls) = ([0, 0], [0, 0]);
        for (end, beam) in fan.ends().zip(&beams) {
            let off_m = end.unwrap().distance(WALKER.0 + WALKER.1 * at_s);
            let counts = if off_m < 0.3 { &mut on_walker } else { &mut on_walls };
            counts[usize::from(beam.is_nan())] += 1;
        }
        assert!(on_walker[0] == 0 && on_walker[1] > 3, "{on_walker:?}");
        assert!(on_walls[0] > 10 * on_walls[1], "{on_walls:?}");
    }
}
