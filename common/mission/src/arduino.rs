use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// The driver knows the number that says the rate by its size: a board waits for an echo for a second at most, and
/// says 17,241 cm then.
pub const LEAST_BAUD: u32 = 19_200;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ArduinoBoard {
    /// Bits a second.
    pub baud: u32,
    /// The rate of the speed loop. Speeds are said in encoder counts from one run of the loop to the next.
    pub pid_rate_hz: f64,
    /// The pins of its sonars by the names of their rows.
    pub sonars: BTreeMap<String, u8>,
}

impl Default for ArduinoBoard {
    fn default() -> Self {
        Self { baud: 57_600, pid_rate_hz: 30.0, sonars: BTreeMap::new() }
    }
}

impl ArduinoBoard {
    pub(crate) fn is_default(&self) -> bool {
        *self == Self::default()
    }
}
