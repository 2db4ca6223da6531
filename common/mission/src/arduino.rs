use std::collections::BTreeMap;

/// The driver knows the number that says the rate by its size: a board waits for an echo for a second at most, and
/// says 17,241 cm then.
pub const LEAST_BAUD: u32 = 19_200;

keys! {
    ArduinoBoard {
        /// Bits a second.
        baud: u32 = 57_600,
        /// The rate of the speed loop. Speeds are said in encoder counts from one run of the loop to the next.
        pid_rate_hz: f64 = 30.0,
        /// The pins of its sonars by the names of their rows.
        sonars: BTreeMap<String, u8>,
    }
}

impl ArduinoBoard {
    pub(crate) fn is_default(&self) -> bool {
        *self == Self::default()
    }
}
