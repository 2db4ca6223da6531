//! Bring-up: a comparison of a new robot's behaviour with its mission.
//!
//! The planner stage of [`calibration`] drives the procedure. [`findings`] compares its recorded
//! [`Trace`] with the mission. Each [`Finding`] is a verdict about one part, with the mission keys
//! to change or the part to repair.
//!
//! Counts and commands show encoder faults. Lasers, rangers and the gyro observe the body, which
//! shows faults of motors, mountings and sizes.

mod body;
mod rangers;
mod scans;
pub mod seen;
pub mod trace;
mod wheels;

use common::mission::Mission;
use glam::DVec2;

use scans::Placed;
pub use trace::Trace;

#[derive(Debug)]
pub struct Finding {
    /// Name of the part for users: "wheels", "laser".
    pub part: String,
    pub verdict: Verdict,
    pub text: String,
    /// Mission keys, and the values found.
    pub keys: Vec<(String, String)>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    Right,
    Wrong,
    Unknown,
}

impl Verdict {
    pub const fn word(self) -> &'static str {
        match self {
            Self::Right => "right",
            Self::Wrong => "WRONG",
            Self::Unknown => "not known",
        }
    }
}

impl Finding {
    pub(crate) fn new(part: &str, verdict: Verdict, text: impl Into<String>) -> Self {
        Self { part: part.into(), verdict, text: text.into(), keys: Vec::new() }
    }

    pub(crate) fn right(part: &str, text: impl Into<String>) -> Self {
        Self::new(part, Verdict::Right, text)
    }

    pub(crate) fn wrong(part: &str, text: impl Into<String>) -> Self {
        Self::new(part, Verdict::Wrong, text)
    }

    pub(crate) fn unknown(part: &str, text: impl Into<String>) -> Self {
        Self::new(part, Verdict::Unknown, text)
    }

    pub(crate) fn with_key(mut self, key: impl Into<String>, value: impl Into<String>) -> Self {
        self.keys.push((key.into(), value.into()));
        self
    }
}

/// Returns the findings about the robot of `mission`, and the ends of laser beams, or else of
/// echoes.
///
/// The ends are in metres from the robot's first place, x ahead. With `lifted` wheels the body is
/// ignored.
pub fn findings(mission: &Mission, trace: &Trace, lifted: bool) -> (Vec<Finding>, Vec<DVec2>) {
    let mut found = vec![wheels::rate(mission, trace)];
    if !trace.begins_at_rest() {
        found.push(Finding::unknown(
            "recording",
            "the recording began too late; repeat this on a machine with less load",
        ));
        return (found, Vec::new());
    }
    let wheels = wheels::Wheels::of(trace);
    let track_m = mission.body().track_m * mission.robot.odometry.track_scale;
    let motion = wheels.motion(trace, track_m);
    let response = wheels::response(mission, trace, &motion);
    if lifted {
        found.extend(rangers::liveliness(mission, trace, false));
        found.extend([wheels.finding(None), response]);
        return (found, Vec::new());
    }
    let placed = scans::place(mission, trace, &motion);
    let gyro_scale = rangers::gyro_scale(trace, &motion);
    let sure = placed.as_ref().filter(|placed| placed.is_sure());
    let moves = match sure {
        Some(placed) => placed.moves(gyro_scale),
        None => rangers::moves(mission, trace, &motion),
    };
    found.extend(rangers::liveliness(mission, trace, !moves.exchanged));
    found.extend([wheels.finding(moves.motors()), response]);
    let motors = moves.finding(mission, wheels.is_as_told());
    let are_right = motors.is_none();
    found.extend(motors);
    found.extend(scans::findings(mission, trace, placed.as_ref(), &moves, gyro_scale.is_some()));
    found.extend(rangers::gyro_finding(mission, gyro_scale, sure, &moves));
    if are_right || sure.is_some() {
        found.extend(rangers::findings(mission, trace, &motion, sure, &moves));
    }
    let echoes = || rangers::echoes(mission, trace, &motion);
    (found, placed.map_or_else(echoes, |placed| placed.points))
}

#[cfg(test)]
mod tests;
