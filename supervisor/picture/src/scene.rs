//! The content of a picture of a run.

use common::{grid::GridFrame, kinematics::Pose2, mission::Mission, samples::FieldCell};
use glam::DVec2;

pub struct Scene<'a> {
    /// The mission: target, world, body, perimeter.
    pub mission: &'a Mission,
    /// The final belief: one [`common::grid::CellState`] byte a cell, row-major.
    pub grid: Option<(GridFrame, &'a [u8])>,
    /// The field of that belief, row-major.
    pub field: Option<(GridFrame, &'a [FieldCell])>,
    /// The poses of dead reckoning, at equal steps of mission time from its beginning.
    pub believed: &'a [Pose2],
    /// Covariance of the estimated position at the end, xx, xy, yy, m^2; none if it is not known.
    pub covariance: Option<[f64; 3]>,
    /// The true poses at the same times; empty with a real robot.
    pub truth: &'a [Pose2],
    /// The targets of the robot, metres; empty for those of the mission.
    pub targets: &'a [DVec2],
    /// The facts about the run.
    pub facts: Facts<'a>,
    /// Lines below the picture; each is cut where the page ends.
    pub captions: &'a [String],
}

/// The numbers of the title line.
#[derive(Clone, Copy, Debug)]
pub struct Facts<'a> {
    /// The outcome in a word: reached, unreachable, timeout, ...
    pub outcome: &'a str,
    /// Whether that is the wanted outcome.
    pub reached: bool,
    /// Mission time, seconds.
    pub mission_time_s: f64,
    /// Length of the way driven, metres.
    pub path_length_m: f64,
    /// Straight distance from start to target, metres.
    pub straight_m: f64,
    /// Range samples that put a hazard on the map.
    pub safety_events: u64,
    /// Seed of the simulation; none with a real robot.
    pub seed: Option<u64>,
}
