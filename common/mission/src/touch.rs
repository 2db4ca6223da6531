//! Bumpers and cliff sensors, which report contact without distance: rows of `[[robot.touch]]`.

use serde::{Deserialize, Serialize};

pub const MOST_TOUCHES: usize = 16;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TouchKind {
    /// Pressure on an arc of the body's edge.
    Bumper,
    /// Missing floor below a point of the body.
    Cliff,
}

rows! {
    TouchRow {
        name: String,
        kind: TouchKind,
        /// Counter-clockwise from the robot's axis.
        bearing_deg: f64,
        #[serde(default = "wide_deg")]
        wide_deg: f64,
        forward_m: Option<f64>,
    }
}

const fn wide_deg() -> f64 {
    60.0
}
