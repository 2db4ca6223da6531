//! DID: meaning of a frame's data.

pub const POSITION: u8 = 3;
pub const POSITION_ALL: u8 = 4;
pub const PWM: u8 = 5;
pub const PWM_ALL: u8 = 6;
pub const PARAMETER: u8 = 7;
pub const VELOCITY: u8 = 26;
pub const VELOCITY_ALL: u8 = 27;
pub const ENABLE: u8 = 30;
pub const MOTOR: u8 = 123;
/// AD channels.
pub const CUSTOM: u8 = 124;
/// Ultrasonic rangers and the rest.
pub const STANDARD: u8 = 125;
pub const ALL_SENSORS: u8 = 127;
pub const SYSTEM: u8 = 255;
