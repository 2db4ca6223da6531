//! How the simulated robot behaves: noise, lag, radio. Defaults are a good day in the laboratory.

use serde::{Deserialize, Serialize};

/// The simulated X80.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Simulation {
    /// The front sonar's physics.
    pub sonar: SonarPhysics,
}

#[allow(clippy::derivable_impls)]
impl Default for Simulation {
    fn default() -> Self {
        Self {
            sonar: SonarPhysics::default(),
        }
    }
}

/// An ultrasonic ranger's physics.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SonarPhysics {
    /// Half angle of the cone that answers, degrees.
    pub cone_deg: f64,
    /// Standard deviation of a range, metres.
    pub noise_m: f64,
    /// Further standard deviation per metre of range.
    pub noise_per_m: f64,
}

impl Default for SonarPhysics {
    fn default() -> Self {
        Self {
            cone_deg: 15.0,
            noise_m: 0.01,
            noise_per_m: 0.005,
        }
    }
}
