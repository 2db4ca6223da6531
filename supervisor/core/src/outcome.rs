//! How a run ended.

use serde::Serialize;

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Outcome {
    /// The target, within the tolerance.
    Reached,
    /// No way to the target, whatever was forgotten and planned anew.
    Unreachable,
    /// Mission time ran out.
    Timeout,
    /// The simulated robot touched something.
    Collision,
    /// Told to stop, or something failed.
    Aborted,
}

impl Outcome {
    /// The word for it.
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
#[derive(Clone, Debug)]
pub struct Ending {
    /// How.
    pub outcome: Outcome,
    /// Why, in a few words.
    pub reason: String,
    /// Whether it is what its user asked for: the target reached, or a stop by hand.
    pub asked_for: bool,
}
