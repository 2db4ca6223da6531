use common::{grid::GridFrame, kinematics::Pose2, mission::Mission, samples::FieldCell};
use glam::DVec2;

pub struct Scene<'a> {
    pub mission: &'a Mission,
    /// Map, one [`common::grid::CellState`] byte a cell, row-major.
    pub grid: Option<(GridFrame, &'a [u8])>,
    /// Field of that map, row-major.
    pub field: Option<(GridFrame, &'a [FieldCell])>,
    /// Dead reckoning at equal steps of mission time from its beginning.
    pub believed: &'a [Pose2],
    /// Covariance of the estimated end, xx, xy, yy, m^2; `None` if unknown.
    pub covariance: Option<[f64; 3]>,
    /// True poses at the same times; empty with a real robot.
    pub truth: &'a [Pose2],
    /// Targets, metres; empty for those of the mission.
    pub targets: &'a [DVec2],
    pub trails: &'a [Trail<'a>],
    pub facts: Facts<'a>,
    /// Captions, cut where the page ends.
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
    /// One word: reached, unreachable, timeout, ...
    pub outcome: &'a str,
    pub reached: bool,
    pub mission_time_s: f64,
    pub path_length_m: f64,
    pub straight_m: f64,
    /// Range samples that put a hazard on the map.
    pub safety_events: u64,
    /// `None` with a real robot.
    pub seed: Option<u64>,
}
