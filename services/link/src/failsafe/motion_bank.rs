//! Hypotheses about readings that contradict the wheels' motion.
//!
//! Each hypothesis gives the robot other poses, or ranges other lengths. A monitor predicts readings, and
//! adds up how much better each hypothesis predicts than the first, that all is healthy. The sums
//! fade, and stay at 0 or above, as in Page's test (E. S. Page, "Continuous inspection schemes",
//! Biometrika 41, 1954).

use std::collections::VecDeque;

use common::{clock::MissionTime, kinematics::Pose2};
use glam::DVec2;

use super::keep;

/// Bound on kept poses and scans.
pub(super) const MOST_KEPT: usize = 2048;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Hypothesis {
    /// Readings are late, seconds.
    Late(f64),
    /// The robot rolls so far, relative to what its wheels count.
    Rolls(f64),
    /// Ranges are distances times a factor.
    Scaled(f64),
    /// Ranges are longer than distances, metres.
    Longer(f64),
}

impl Hypothesis {
    pub(super) const HEALTHY: Self = Self::Late(0.0);

    /// Returns the poses at two times, the later one last.
    pub(super) fn robots(self, poses: &Poses, [from_s, to_s]: [f64; 2]) -> [Pose2; 2] {
        let ago = |by_s: f64| [poses.at(from_s - by_s), poses.at(to_s - by_s)];
        match self {
            Self::Late(by_s) => ago(by_s),
            Self::Rolls(share) => {
                let counted = ago(0.0);
                [counted[0], rolled(counted[0], counted, share)]
            }
            _ => ago(0.0),
        }
    }

    pub(super) const fn distance(self, range_m: f64) -> f64 {
        match self {
            Self::Scaled(factor) => range_m / factor,
            Self::Longer(by_m) => range_m - by_m,
            _ => range_m,
        }
    }

    pub(super) const fn range(self, distance_m: f64) -> f64 {
        match self {
            Self::Scaled(factor) => distance_m * factor,
            Self::Longer(by_m) => distance_m + by_m,
            _ => distance_m,
        }
    }

    pub(super) fn words(self, whose: &str) -> String {
        let found = match self {
            Self::Late(by_s) => format!(
                "are consistent only if they are {by_s:.1} s later than stated; find what delays them, or send their age"
            ),
            Self::Rolls(0.0) => "do not change although the wheels turn; check the sensor, and whether the wheels slip".to_owned(),
            Self::Rolls(share) => format!(
                "are consistent only if the robot rolls about {share} times as far as its wheels count; check encoders and wheels"
            ),
            Self::Scaled(factor) => format!(
                "are consistent only if they are about {factor} times the distances; check the sensor and its unit"
            ),
            Self::Longer(by_m) => format!(
                "are consistent only if they are about {by_m} m longer than the distances; check the sensor"
            ),
        };
        format!("the readings of {whose} {found}, then run `firsthand stop` and `resume`")
    }
}

/// Returns `robot` after a share of the motion between two poses.
pub(super) fn rolled(robot: Pose2, [from, to]: [Pose2; 2], share: f64) -> Pose2 {
    let turn = to.heading - from.heading;
    let aside = robot.heading - from.heading + (share - 1.0) * turn / 2.0;
    let way = DVec2::from_angle(aside).rotate(to.position - from.position);
    Pose2 { position: robot.position + share * way, heading: robot.heading + share * turn }
}

/// Returns the motion between two poses, metres, with a turn's metres per radian.
pub(super) fn motion_m([from, to]: [Pose2; 2], m_per_rad: f64) -> f64 {
    to.position.distance(from.position) + m_per_rad * (to.heading - from.heading).abs()
}

/// Poses by the wheels.
#[derive(Clone, Debug, Default)]
pub(super) struct Poses(VecDeque<(f64, Pose2)>);

impl Poses {
    pub(super) fn robot_is(&mut self, pose: Pose2, now: MissionTime) {
        keep(&mut self.0, (now.seconds(), pose), f64::INFINITY, MOST_KEPT);
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(super) fn at(&self, at_s: f64) -> Pose2 {
        let after = self.0.partition_point(|(then, _)| *then < at_s);
        let before = after.saturating_sub(1);
        let kept = |it: usize| self.0.get(it).or(self.0.back()).copied().unwrap_or_default();
        let (from_s, from) = kept(before);
        let (to_s, to) = kept(after);
        let share = if to_s > from_s { (at_s - from_s) / (to_s - from_s) } else { 0.0 };
        let share = share.clamp(0.0, 1.0);
        Pose2 {
            position: from.position.lerp(to.position, share),
            heading: from.heading + share * (to.heading - from.heading),
        }
    }
}

/// A hypothesis, with the sums that make it doubtful and sure.
pub(super) type Row = (Hypothesis, [f64; 2]);

#[derive(Clone, Debug)]
pub(super) struct Bank<const N: usize> {
    rows: &'static [Row; N],
    sums: [f64; N],
    /// Times at which the sums were last 0, the likeliest onsets, seconds.
    since_s: [f64; N],
}

impl<const N: usize> Bank<N> {
    pub(super) const fn of(rows: &'static [Row; N]) -> Self {
        Self { rows, sums: [0.0; N], since_s: [0.0; N] }
    }

    pub(super) fn fade(&mut self, hypothesis: usize, left: f64) {
        assert!((0.0..=1.0).contains(&left));
        self.sums[hypothesis] *= left;
    }

    pub(super) fn add(&mut self, hypothesis: usize, better: f64, at_s: f64) {
        let sum = &mut self.sums[hypothesis];
        *sum += better;
        if *sum <= 0.0 {
            *sum = 0.0;
            self.since_s[hypothesis] = at_s;
        }
    }

    /// Returns the greatest share of a limit among some hypotheses.
    pub(super) fn doubt(&self, of: impl Fn(Hypothesis) -> bool) -> f64 {
        let rows = self.rows.iter().zip(&self.sums).filter(|((it, _), _)| of(*it));
        rows.map(|((_, [_, sure]), sum)| sum / sure).fold(0.0, f64::max)
    }

    /// Returns the hypothesis whose sum exceeds its limit most, and its onset, if any does.
    pub(super) fn likeliest(&self, sure: bool) -> Option<(Hypothesis, f64)> {
        let level = |it: &usize| self.sums[*it] / self.rows[*it].1[usize::from(sure)];
        let likeliest = (0..N)
            .max_by(|one, other| level(one).total_cmp(&level(other)))
            .filter(|it| level(it) > 1.0)?;
        Some((self.rows[likeliest].0, self.since_s[likeliest]))
    }

    pub(super) fn judged(&self, sure: bool, whose: &str) -> Option<String> {
        let (hypothesis, _) = self.likeliest(sure)?;
        Some(hypothesis.words(whose))
    }
}
