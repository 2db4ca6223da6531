//! Body motion seen by the laser, or else the sonars, against wheel counts: motors, sizes of wheels
//! and track.

use common::mission::{Mission, Protocol};
use nalgebra::{Matrix2, Vector2};

use crate::Finding;

/// Motion of the body relative to its wheels.
pub(crate) struct Moves {
    /// Whether it turns, or drives, in reverse; `None` if undetermined.
    pub turns_back: Option<bool>,
    pub drives_back: Option<bool>,
    pub exchanged: bool,
    /// True turn and distance, relative to the wheels'; `None` if undetermined.
    pub turn: Option<f64>,
    pub way: Option<f64>,
    /// True turn per metre, radians.
    pub curl: f64,
}

/// Minimum reported deviations of motion and diameters, shares.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SizesTold {
    pub sizes: f64,
    pub ratio: f64,
}

pub(crate) const MOTOR: &str = "motor turns";

/// Returns the motors that explain a motion. Each row, a wheel's, has 1 or -1 in the column of the
/// wheel whose command it follows.
pub(crate) fn motors(turns_back: bool, drives_back: bool, exchanged: bool) -> Matrix2<f64> {
    // Turn and drive are difference and sum of the rims' motions; applied twice, this doubles them.
    let sums = Matrix2::new(-1.0, 1.0, 1.0, 1.0);
    let sign = |back| if back { -1.0 } else { 1.0 };
    let signs = Matrix2::from_diagonal(&Vector2::new(sign(turns_back), sign(drives_back)));
    let goes = if exchanged { signs * Matrix2::new(0.0, 1.0, 1.0, 0.0) } else { signs };
    let motors = sums * goes * sums / 2.0;
    assert_eq!(motors * motors.transpose(), Matrix2::identity());
    motors
}

/// Describes motor or encoder faults: one `part` for each row that differs from the identity.
pub(crate) fn words(parts: Matrix2<f64>, part: &str) -> String {
    ["left", "right"]
        .into_iter()
        .enumerate()
        .filter_map(|(row, side)| {
            let what = match (parts[(row, row)], parts[(row, 1 - row)]) {
                (1.0, _) => return None,
                (0.0, 0.0) => "nothing",
                (_, 0.0) => "backwards",
                (_, 1.0) => "the other wheel",
                _ => "the other wheel backwards",
            };
            Some(format!("the {side} {part} {what}"))
        })
        .collect::<Vec<_>>()
        .join(" and ")
}

impl Moves {
    fn possible(&self) -> Vec<Matrix2<f64>> {
        let either = |known: Option<bool>| known.map_or(vec![false, true], |it| vec![it]);
        let drives = either(self.drives_back);
        let with = |turns| drives.iter().map(move |it| motors(turns, *it, self.exchanged));
        either(self.turns_back).into_iter().flat_map(with).collect()
    }

    pub(crate) fn motors(&self) -> Option<Matrix2<f64>> {
        let possible = self.possible();
        possible.first().copied().filter(|_| possible.len() == 1)
    }

    /// Returns the finding about swapped or reversed motors; `None` if they may be right. It has
    /// keys if the encoders are connected `alike`.
    pub(crate) fn finding(&self, mission: &Mission, alike: bool) -> Option<Finding> {
        let possible = self.possible();
        if possible.contains(&Matrix2::identity()) {
            return None;
        }
        let all: Vec<_> = possible.iter().map(|it| words(it.transpose(), MOTOR)).collect();
        let which = if all.len() > 1 { ": check which way the robot turns and drives" } else { "" };
        let told = if self.exchanged { "the body turns on a command to drive: " } else { "" };
        let mut finding = Finding::wrong("motors", format!("{told}{}{which}", all.join("; or ")));
        if let [motors] = possible[..]
            && alike
            && mission.robot.protocol() == Protocol::X80
        {
            let stated = [mission.robot.left, mission.robot.right];
            for (row, side) in ["left", "right"].into_iter().enumerate() {
                let goes_as = stated[usize::from(motors[(row, 0)] == 0.0)];
                let reversed = goes_as.reversed != (motors.row(row).sum() < 0.0);
                if goes_as.channel != stated[row].channel {
                    finding = finding
                        .with_key(format!("robot.{side}.channel"), goes_as.channel.to_string());
                }
                if reversed != stated[row].reversed {
                    finding =
                        finding.with_key(format!("robot.{side}.reversed"), reversed.to_string());
                }
            }
        }
        Some(finding)
    }

    pub(crate) fn sizes(&self, mission: &Mission, told: SizesTold) -> Vec<Finding> {
        let mut found = Vec::new();
        let (body, odometry) = (mission.body(), &mission.robot.odometry);
        // Sizes do not affect a robot's own odometry.
        let is_own = mission.robot.protocol() == Protocol::Ros2;
        let said = if is_own { "its odometry reports" } else { "the wheels count" };
        let is_told = |share: &f64| (share - 1.0).abs() > told.sizes;
        // A turn alone cannot separate wheel size from track; large errors count as the wheels'.
        let way = self.way.or(self.turn);
        let other = way.filter(is_told);
        if let Some(way) = other {
            let text = format!("the body drives {:.0} % of the distance that {said}", 100.0 * way);
            let (key, value) = match mission.robot.protocol() {
                Protocol::X80 | Protocol::Arduino => {
                    ("robot.counts_per_turn", format!("{:.0}", body.counts_per_turn / way))
                }
                Protocol::Json => {
                    ("robot.wheel_radius_m", format!("{:.4}", body.wheel_radius_m * way))
                }
                Protocol::Ros2 => (
                    "robot.odometry.distance_scale",
                    format!("{:.3}", odometry.distance_scale * way),
                ),
            };
            found.push(Finding::wrong("wheel size", text).with_key(key, value));
        }
        // Undetermined wheel errors count as none.
        let track = self.turn.map(|turn| other.unwrap_or(1.0) / turn);
        if let Some(track) = track.filter(is_told) {
            let text = format!("the body turns {:.0} % of the angle that {said}", 100.0 / track);
            let (key, stated) = if is_own {
                ("robot.odometry.track_scale", odometry.track_scale)
            } else {
                ("robot.track_m", body.track_m)
            };
            let finding = Finding::wrong("track", text);
            found.push(finding.with_key(key, format!("{:.3}", stated * track)));
        }
        let ratio = 1.0 + self.curl * body.track_m;
        if (ratio - 1.0).abs() > told.ratio {
            let text = format!(
                "it turns to one side when both wheels count the same: their diameters differ by {:.1} %",
                100.0 * (ratio - 1.0).abs()
            );
            let key = "robot.odometry.diameter_ratio";
            let finding = Finding::wrong("wheel ratio", text);
            // A laser mounted upside down may have seen it, so the side is unknown.
            found.push(match self.turns_back {
                None => finding,
                Some(_) => finding.with_key(key, format!("{:.3}", odometry.diameter_ratio * ratio)),
            });
        }
        found
    }
}
