//! Bumpers and cliff sensors, which report contact without distance: rows of `[[robot.touch]]`.

pub const MOST_TOUCHES: usize = 16;

words! {
    TouchKind {
        /// Pressure on an arc of the body's edge.
        Bumper,
        /// Missing floor below a point of the body.
        Cliff,
    }
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
