//! Scans at their capture times: recent robot poses, and motion-compensated sweeps.
//!
//! Poses are in the odometry frame, which corrections do not move. The newest correction transforms
//! them into the mission frame.
//!
//! A rotating laser measures beam by beam while the robot moves, so each beam's end follows from
//! the pose at its time. Interpolating between these ends gives a scan from the pose in mid-sweep.

use std::{collections::VecDeque, time::Duration};

use common::{geometry::wrap_angle, kinematics::Pose2, samples::PoseSample};
use glam::DVec2;

use crate::{
    reading::{Fan, Rows},
    step::Scan,
};

const KEPT: Duration = Duration::from_secs(3);
/// Poses that span [`KEPT`] at 50 Hz.
const MOST_POSES: usize = 160;
/// Spacing of two ends, in beams, above which beams between them have no reading: a surface ends
/// there.
const APART_BEAMS: f64 = 3.0;
/// Range difference of ends on different surfaces.
const EDGE_M: f64 = 0.20;

/// Recent odometry poses with mission times in nanoseconds, oldest first. Unsaved: a new process's
/// first scans may be too old for it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Poses {
    held: VecDeque<(i64, Pose2)>,
    /// First pose of this process if the robot was at rest, valid for earlier times, too.
    stood_at: Option<(i64, Pose2)>,
}

impl Poses {
    /// Repeats have no effect.
    pub(crate) fn add(&mut self, pose: &PoseSample) {
        let ns = time_ns(pose);
        if self.held.back().is_some_and(|(newest_ns, _)| *newest_ns >= ns) {
            return;
        }
        let robot = pose.odometry();
        if self.held.is_empty() && (pose.v_m_s, pose.omega_rad_s) == (0.0, 0.0) {
            self.stood_at = Some((ns, robot));
        }
        debug_assert!(self.stood_at.is_none_or(|(first_ns, _)| first_ns <= ns));
        self.held.push_back((ns, robot));
        let oldest_ns = ns - KEPT.as_nanos() as i64;
        let is_old = |(ns, _): &(i64, Pose2)| *ns < oldest_ns;
        while self.held.len() > MOST_POSES || self.held.front().is_some_and(is_old) {
            self.held.pop_front();
        }
        assert!(!self.held.is_empty());
    }

    /// Interpolates the pose at a time, or extrapolates by at most a tick.
    fn at(&self, ns: i64) -> Option<Pose2> {
        if let Some((_, pose)) = self.stood_at.filter(|(first_ns, _)| ns <= *first_ns) {
            return Some(pose);
        }
        debug_assert!(self.held.iter().is_sorted_by(|one, next| one.0 < next.0));
        let last = self.held.len().max(2) - 1;
        let later = self.held.partition_point(|(at, _)| *at < ns).clamp(1, last);
        let (from_ns, from) = self.held.get(later - 1)?;
        let (to_ns, to) = self.held.get(later)?;
        assert!(from_ns < to_ns);
        let share = (ns - from_ns) as f64 / (to_ns - from_ns) as f64;
        (-1.0..=2.0).contains(&share).then(|| Pose2 {
            position: from.position.lerp(to.position, share),
            heading: from.heading + share * (to.heading - from.heading),
        })
    }

    /// Returns a scan of this tick as seen from the robot's pose at the middle beam's time.
    ///
    /// Returns `None` if a beam's pose is unknown.
    pub(crate) fn scan_at_once(
        &self,
        rows: &Rows,
        pose: &PoseSample,
        Scan { row, beams, sweep }: Scan,
    ) -> Option<Placed> {
        if !sweep.is_plausible(beams.len()) {
            return None;
        }
        let [x, y, turn] = pose.map_from_odom;
        let turned = DVec2::from_angle(turn);
        let robot_at = |offset_ns: i64| {
            let Pose2 { position, heading } = self.at(time_ns(pose) + offset_ns)?;
            Some(Pose2 {
                position: DVec2::new(x, y) + turned.rotate(position),
                heading: heading + turn,
            })
        };
        let middle_ns = sweep.middle_ns(beams.len());
        // Before the first tick the robot stood; dead reckoning knows no earlier time.
        let first_ns = self.stood_at.map_or(0, |(first_ns, _)| first_ns);
        let capture_ns = (time_ns(pose) + middle_ns).max(first_ns) as u64;
        let robot = robot_at(middle_ns)?;
        let beams = match sweep.beam_ns {
            0 => beams,
            _ => {
                let seen_from =
                    |beam| rows.scan(row, robot_at(sweep.beam_time_ns(beam, beams.len()))?, &beams);
                at_once(&rows.scan(row, robot, &beams)?, seen_from)?
            }
        };
        let Pose2 { position, heading } = robot;
        let robot = PoseSample { x_m: position.x, y_m: position.y, heading_rad: heading, ..*pose };
        Some(Placed { row, robot, capture_ns, beams })
    }
}

pub(crate) struct Placed {
    pub row: usize,
    pub robot: PoseSample,
    pub capture_ns: u64,
    pub beams: Vec<f32>,
}

fn time_ns(pose: &PoseSample) -> i64 {
    pose.stamp.time().0.min(i64::MAX as u64 / 2) as i64
}

/// Returns the beams of `fan` as if measured from its origin; `seen_from` gives each beam's true
/// origin.
fn at_once<'a>(fan: &Fan<'_>, seen_from: impl Fn(usize) -> Option<Fan<'a>>) -> Option<Vec<f32>> {
    let count = fan.beams.len();
    assert!(count > 0 && fan.step_rad > 0.0);
    let end = |(beam, range): (usize, &f32)| {
        let own = seen_from(beam)?;
        let range = f64::from(*range);
        let place = beam as f64;
        let along = DVec2::from_angle(own.first_rad + own.step_rad * place);
        let to = own.origin + range * along - fan.origin;
        let ends = (0.0..=fan.reach_m).contains(&range);
        let (bearing, range) = if ends { (to, to.length()) } else { (along, range) };
        let expected = fan.first_rad + fan.step_rad * place;
        Some((place + wrap_angle(bearing.to_angle() - expected) / fan.step_rad, range))
    };
    let ends: Option<Vec<_>> = fan.beams.iter().enumerate().map(end).collect();
    let mut ends = ends?;
    let is_circle = fan.is_circle();
    if is_circle {
        ends.extend(ends.first().map(|(place, range)| (place + count as f64, *range)));
    }
    assert_eq!(ends.len(), count + usize::from(is_circle));
    let mut beams = vec![f32::NAN; count];
    for pair in ends.windows(2) {
        let [mut low, mut high] = [pair[0], pair[1]];
        if low.0 > high.0 {
            (low, high) = (high, low);
        }
        let apart = high.0 - low.0;
        if !(0.0..=APART_BEAMS).contains(&apart) {
            continue;
        }
        for place in low.0.ceil() as i64..=high.0.floor() as i64 {
            let share = if apart > 0.0 { (place as f64 - low.0) / apart } else { 0.0 };
            let range = match (low.1 - high.1).abs() <= EDGE_M && low.1.min(high.1) > 0.0 {
                // Along a straight surface, the range's reciprocal is linear in a small angle.
                true => (low.1.recip() * (1.0 - share) + high.1.recip() * share).recip(),
                false if share < 0.5 => low.1,
                false => high.1,
            };
            let place = if is_circle { place.rem_euclid(count as i64) } else { place };
            if let Some(beam) = usize::try_from(place).ok().and_then(|place| beams.get_mut(place)) {
                *beam = beam.min(range as f32);
            }
        }
    }
    Some(beams)
}
