use std::collections::BTreeMap;

/// Least baud rate of a board. The driver distinguishes rates from distances by size: a board
/// reports at most 17,241 cm, after a second without an echo.
pub const LEAST_BAUD: u32 = 19_200;

keys! {
    ArduinoBoard {
        baud: u32 = 57_600,
        /// Speeds are encoder counts per run of the loop.
        pid_rate_hz: f64 = 30.0,
        sonars: BTreeMap<String, u8>,
    }
}
