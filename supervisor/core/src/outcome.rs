//! How a run ended.

use serde::Serialize;

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Outcome {
    /// The robot is within the tolerance of the target.
    Reached,
    /// The robot stalls, and no recovery step is left.
    Unreachable,
    /// Mission time ran out.
    Timeout,
    /// The simulated robot touched something.
    Collision,
    /// Stopped by hand, or something failed.
    Aborted,
}

impl Outcome {
    /// Its name.
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Reached => "reached",
            Self::Unreachable => "unreachable",
            Self::Timeout => "timeout",
            Self::Collision => "collision",
            Self::Aborted => "aborted",
        }
    }
}

/// How a run ended, and why.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ending {
    /// How.
    pub outcome: Outcome,
    /// Why, in a few words.
    pub reason: String,
    /// Whether it is what the user asked for: the target reached, or a stop by hand.
    pub asked_for: bool,
}

impl Ending {
    /// An end that nobody asked for.
    pub(crate) fn failed(outcome: Outcome, reason: impl Into<String>) -> Self {
        Self {
            outcome,
            reason: reason.into(),
            asked_for: false,
        }
    }

    /// What the user asked for.
    pub(crate) fn asked_for(outcome: Outcome, reason: impl Into<String>) -> Self {
        Self {
            asked_for: true,
            ..Self::failed(outcome, reason)
        }
    }
}
