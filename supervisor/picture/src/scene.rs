use common::{grid::GridFrame, kinematics::Pose2, mission::Mission, samples::FieldCell};
use glam::DVec2;

pub struct Scene<'a> {
    pub mission: &'a Mission,
    /// One [`common::grid::CellState`] byte a cell, row-major.
    pub grid: Option<(GridFrame, &'a [u8])>,
    /// The field of that belief, row-major.
    pub field: Option<(GridFrame, &'a [FieldCell])>,
    /// Dead reckoning, at equal steps of mission time from its beginning.
    pub believed: &'a [Pose2],
    /// The estimated end's xx, xy, yy, m^2; none if unknown.
    pub covariance: Option<[f64; 3]>,
    /// True poses at the same times; empty with a real robot.
    pub truth: &'a [Pose2],
    /// Metres; empty for those of the mission.
    pub targets: &'a [DVec2],
    pub trails: &'a [Trail<'a>],
    pub facts: Facts<'a>,
    /// Each is cut where the page ends.
    pub captions: &'a [String],
}

#[derive(Debug)]
pub struct Trail<'a> {
    /// Mission times in order, seconds, and places, metres.
    pub places: &'a [(f64, DVec2)],
    pub radius_m: f64,
}

#[derive(Debug)]
pub struct Facts<'a> {
    /// A word: reached, unreachable, timeout, ...
    pub outcome: &'a str,
    pub reached: bool,
    pub mission_time_s: f64,
    pub path_length_m: f64,
    pub straight_m: f64,
    /// Range samples that put a hazard on the map.
    pub safety_events: u64,
    /// None with a real robot.
    pub seed: Option<u64>,
}
