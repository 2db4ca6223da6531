//! Bumpers and cliff sensors, which say no distance, but whether they feel something: rows of `[[robot.touch]]`.

use serde::{Deserialize, Serialize};

pub const MOST_TOUCHES: usize = 16;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TouchKind {
    /// Something presses an arc of the body's edge.
    Bumper,
    /// There is no floor below a place of the body.
    Cliff,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TouchRow {
    pub name: String,
    pub kind: TouchKind,
    /// From the robot's axis counter-clockwise, to the middle of a bumper's arc.
    pub bearing_deg: f64,
    /// A bumper's whole arc.
    #[serde(default = "wide_deg")]
    pub wide_deg: f64,
    /// Distance of a cliff sensor from the robot's centre; the default is the body's radius.
    pub forward_m: Option<f64>,
}

const fn wide_deg() -> f64 {
    60.0
}
