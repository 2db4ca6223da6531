use common::{ground_truth::GroundTruthTick, mission::Mission, samples::PoseSample};
use glam::DVec2;
use serde::{Deserialize, Serialize};

/// Maximum true distance from the target after an arrival in simulation, metres, as in other
/// benchmarks. A wider mission tolerance replaces it.
pub const RIGHT_PLACE_M: f64 = 0.5;

pub(crate) const fn allowed_m(mission: &Mission) -> f64 {
    RIGHT_PLACE_M.max(mission.arrival_tolerance_m)
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Within the tolerance of the target by its own pose, and in simulation by the ground truth.
    Reached,
    /// The ground truth contradicts the reported arrival.
    WrongPlace,
    /// The pose covariance on arrival exceeds what the mission allows.
    ReachedUnsure,
    /// The robot stalled, and no recovery step was left.
    Unreachable,
    /// Timeout of the mission; `timed_out` for a target.
    #[serde(alias = "timed_out")]
    Timeout,
    Collision,
    /// The run ended while the robot waited for its first target, followed a beacon, or was driven
    /// by hand.
    Waited,
    /// The run was stopped by hand, or something failed.
    #[default]
    Aborted,
    /// The encoders report motion after every stop method of the protocol.
    CouldNotBeStopped,
}

impl Outcome {
    pub const fn exit_code(self) -> u8 {
        match self {
            Self::Reached | Self::Waited => 0,
            Self::Unreachable => 3,
            Self::Timeout => 4,
            Self::Collision => 5,
            Self::Aborted => 6,
            Self::WrongPlace => 9,
            Self::CouldNotBeStopped => 10,
            Self::ReachedUnsure => 11,
        }
    }

    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Reached => "reached",
            Self::WrongPlace => "wrong_place",
            Self::ReachedUnsure => "reached_unsure",
            Self::Unreachable => "unreachable",
            Self::Timeout => "timeout",
            Self::Collision => "collision",
            Self::Waited => "waited",
            Self::Aborted => "aborted",
            Self::CouldNotBeStopped => "could_not_be_stopped",
        }
    }
}

#[derive(Clone, PartialEq, Eq)]
pub(crate) enum Wheels {
    AtRest,
    /// Silence, and its reason.
    Unknown(String),
    Turning,
}

#[derive(Debug)]
pub struct Ending {
    pub outcome: Outcome,
    pub reason: String,
    /// Failsafe-table row that ended the mission.
    pub cause: Option<&'static str>,
    /// Whether the run ended as requested: at the target, or by hand.
    pub asked_for: bool,
}

impl Ending {
    pub(crate) fn failed(outcome: Outcome, reason: impl Into<String>) -> Self {
        Self { outcome, reason: reason.into(), cause: None, asked_for: false }
    }

    /// Checks an arrival against the ground truth `ended` and the own pose `at_rest`.
    ///
    /// A contradiction gives the wrong place; a pose error that may exceed the tolerance gives
    /// unsure.
    pub(crate) fn checked(
        self,
        mission: &Mission,
        target: DVec2,
        ended: Option<&GroundTruthTick>,
        at_rest: Option<&PoseSample>,
    ) -> Self {
        if self.outcome != Outcome::Reached {
            return self;
        }
        let allowed_m = allowed_m(mission);
        let by_truth_m = ended.map(|ended| (ended.x - target.x).hypot(ended.y - target.y));
        let at_rest_m = at_rest.map(|pose| target.distance(pose.pose().position));
        let too_far = |distance_m: &f64| *distance_m > allowed_m;
        let said = &self.reason;
        let (outcome, contradicted) = if let Some(distance_m) = by_truth_m.filter(too_far) {
            let by_truth = format!(
                "{said} by its own pose; by the ground truth it is {distance_m:.2} m from the target, more than {allowed_m} m"
            );
            (Outcome::WrongPlace, by_truth)
        } else if let Some(distance_m) = at_rest_m.filter(too_far) {
            let rest = format!(
                "{said}; it came to rest {distance_m:.2} m from the target, more than {allowed_m} m"
            );
            (Outcome::WrongPlace, rest)
        } else if let Some(pose) = at_rest.filter(|pose| !pose.is_sure(mission)) {
            let (within_m, sure_m) = (pose.position_within_m(), mission.sure_within_m);
            let unsure = format!(
                "{said}; its pose is known to within {within_m:.2} m (2 standard deviations), more than {sure_m} m"
            );
            (Outcome::ReachedUnsure, unsure)
        } else {
            return self;
        };
        Self::failed(outcome, contradicted)
    }

    /// Adds the encoder state at the stages' stop.
    pub(crate) fn with(self, wheels: Wheels) -> Self {
        match wheels {
            Wheels::AtRest => self,
            Wheels::Unknown(why) => {
                let reason = format!("{}; whether it rests is unknown: {why}", self.reason);
                Self { reason, ..self }
            }
            Wheels::Turning => {
                let reason =
                    format!("{}; the robot still moves after every stop method", self.reason);
                Self { cause: self.cause, ..Self::failed(Outcome::CouldNotBeStopped, reason) }
            }
        }
    }

    pub(crate) fn asked_for(outcome: Outcome, reason: impl Into<String>) -> Self {
        Self { asked_for: true, ..Self::failed(outcome, reason) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;

    /// Returns the outcome of an ending that says this, of a robot with this covariance [xx, xy, yy]
    /// that truly ended at `ended`.
    fn outcome(
        said: Outcome,
        set: &str,
        covariance: Option<[f64; 3]>,
        ended: Option<f64>,
    ) -> Outcome {
        let mission = testing::mission(&format!("target = [3, 0]\n{set}"));
        let ended = ended.map(|x| GroundTruthTick { x, ..GroundTruthTick::default() });
        let pose = covariance.map(|[xx, xy, yy]| PoseSample {
            x_m: 2.9,
            covariance: [xx, xy, 0.0, yy, 0.0, 0.0],
            ..PoseSample::default()
        });
        let ending = Ending::asked_for(said, "0.10 m from the target");
        let checked = ending.checked(&mission, mission.target, ended.as_ref(), pose.as_ref());
        let is_doubted = matches!(checked.outcome, Outcome::WrongPlace | Outcome::ReachedUnsure);
        assert_eq!(checked.asked_for, !is_doubted);
        checked.outcome
    }

    #[test]
    fn an_ending_of_a_robot_that_is_silent_says_why() {
        let ending = Ending::asked_for(Outcome::Reached, "").with(Wheels::Unknown("why".into()));
        assert!(ending.asked_for && ending.reason.ends_with("why"), "{ending:?}");
    }

    #[test]
    fn reached_is_the_word_of_the_ground_truth_too_and_unsure_where_the_pose_is_not_known_to_two_deviations()
     {
        use Outcome::{Aborted, Reached, ReachedUnsure, WrongPlace};
        for (said, set, covariance, ended, want) in [
            (Reached, "", None, Some(2.6), Reached),
            (Reached, "", None, Some(2.4), WrongPlace),
            (Reached, "arrival_tolerance_m = 0.8", None, Some(2.3), Reached),
            // A real robot.
            (Reached, "", None, None, Reached),
            (Aborted, "", None, Some(0.0), Aborted),
            (Reached, "sure_within_m = 0.3", Some([0.04, 0.0, 0.0]), None, ReachedUnsure),
            (Reached, "", Some([0.3, 0.0, 0.3]), Some(3.0), ReachedUnsure),
            (Reached, "", Some([0.3, 0.0, 0.3]), Some(2.0), WrongPlace),
            (Aborted, "", Some([9.0, 0.0, 9.0]), None, Aborted),
        ] {
            assert_eq!(
                outcome(said, set, covariance, ended),
                want,
                "{said:?} {set} {covariance:?}"
            );
        }
        for (deviation, want) in [(0.249_f64, Reached), (0.251, ReachedUnsure)] {
            let line = deviation.powi(2);
            for covariance in [[0.0, 0.0, line], [line / 2.0; 3], [line, 0.0, line]] {
                assert_eq!(outcome(Reached, "", Some(covariance), None), want, "{covariance:?}");
            }
        }
    }
}
