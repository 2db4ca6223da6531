//! What the body does against what its wheels count, as the laser or else the sonars see it: motors, and the sizes of wheels and track.

use common::mission::{Channel, Mission, Protocol};

use crate::Finding;

/// The body's motion over that of its wheels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Moves {
    /// It turns against the wheels.
    pub(crate) turns_back: bool,
    pub(crate) drives_back: bool,
    /// It drives where the wheels say that it turns, and turns where they say that it drives.
    pub(crate) exchanged: bool,
    /// True turn and way over the wheels'; none if nothing shows it.
    pub(crate) turn: Option<f64>,
    pub(crate) way: Option<f64>,
    /// True turn for each metre, radians.
    pub(crate) curl: f64,
}

/// Shares of way and turn, and of the diameters, that are told.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SizesTold {
    pub(crate) sizes: f64,
    pub(crate) ratio: f64,
}

impl Moves {
    /// Motors that are swapped or turn backwards; none if they are right.
    pub(crate) fn motors(&self, mission: &Mission) -> Option<Finding> {
        let [left, right] = [mission.robot.left, mission.robot.right];
        let not = |it: Channel| Channel { reversed: !it.reversed, ..it };
        let (text, mended) = match (self.exchanged, self.turns_back, self.drives_back) {
            (true, false, _) => (
                "told to drive, the body turns: the left wheel turns backwards",
                [not(left), right],
            ),
            (true, true, _) => (
                "told to drive, the body turns: the right wheel turns backwards",
                [left, not(right)],
            ),
            (_, true, true) => (
                "it turns and drives the other way: both motors turn backwards",
                [not(left), not(right)],
            ),
            (_, true, false) => {
                ("it turns the other way: the motors are swapped, left and right", [right, left])
            }
            (_, false, true) => (
                "it drives backwards when it is told to drive ahead: the motors are swapped and turn backwards, or front and rear sonar are swapped",
                [not(right), not(left)],
            ),
            _ => return None,
        };
        let mut finding = Finding::wrong("motors", text);
        if mission.robot.protocol() == Protocol::X80 {
            for (side, stated, mended) in [("left", left, mended[0]), ("right", right, mended[1])] {
                if mended.channel != stated.channel {
                    let key = format!("robot.{side}.channel");
                    finding = finding.with_key(key, mended.channel.to_string());
                }
                if mended.reversed != stated.reversed {
                    let key = format!("robot.{side}.reversed");
                    finding = finding.with_key(key, mended.reversed.to_string());
                }
            }
        }
        Some(finding)
    }

    /// Wheels and track that are not as stated.
    pub(crate) fn sizes(&self, mission: &Mission, told: SizesTold) -> Vec<Finding> {
        let mut found = Vec::new();
        let body = mission.body();
        let is_told = |share: &f64| (share - 1.0).abs() > told.sizes;
        // A turn alone does not tell the wheels' size from the track; large errors are those of the wheels.
        let way = self.way.or(self.turn);
        let other = way.filter(is_told);
        if let Some(way) = other {
            let text = format!("the body drives {:.0} % of what the wheels count", 100.0 * way);
            let (key, value) = match mission.robot.protocol() {
                Protocol::X80 | Protocol::Arduino => {
                    ("robot.counts_per_turn", format!("{:.0}", body.counts_per_turn / way))
                }
                Protocol::Json | Protocol::Ros2 => {
                    ("robot.wheel_radius_m", format!("{:.4}", body.wheel_radius_m * way))
                }
            };
            found.push(Finding::wrong("wheel size", text).with_key(key, value));
        }
        // The stated wheels stay where their error is not told.
        let track = self.turn.map(|turn| other.unwrap_or(1.0) / turn);
        if let Some(track) = track.filter(is_told) {
            let text = format!("the body turns {:.0} % of what the wheels count", 100.0 / track);
            let track_m = format!("{:.3}", body.track_m * track);
            found.push(Finding::wrong("track", text).with_key("robot.track_m", track_m));
        }
        let ratio = 1.0 + self.curl * body.track_m;
        if (ratio - 1.0).abs() > told.ratio {
            let text = format!(
                "it turns to one side when both wheels count the same: their diameters differ by {:.1} %",
                100.0 * (ratio - 1.0).abs()
            );
            let key = "robot.odometry.diameter_ratio";
            found.push(Finding::wrong("wheel ratio", text).with_key(key, format!("{ratio:.3}")));
        }
        found
    }
}
