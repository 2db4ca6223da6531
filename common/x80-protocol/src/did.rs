//! DID: what the data of a frame mean.

/// Position of one channel.
pub const POSITION: u8 = 3;
/// Position of six channels.
pub const POSITION_ALL: u8 = 4;
/// PWM of one channel.
pub const PWM: u8 = 5;
/// PWM of six channels.
pub const PWM_ALL: u8 = 6;
/// A parameter.
pub const PARAMETER: u8 = 7;
/// Velocity of one channel.
pub const VELOCITY: u8 = 26;
/// Velocity of six channels.
pub const VELOCITY_ALL: u8 = 27;
/// Enable or suspend motors.
pub const ENABLE: u8 = 30;
/// Motor sensors: wheel counts and speeds.
pub const MOTOR: u8 = 123;
/// Custom sensors: AD channels.
pub const CUSTOM: u8 = 124;
/// Standard sensors: ultrasonic and the rest.
pub const STANDARD: u8 = 125;
/// All sensor streams at once.
pub const ALL_SENSORS: u8 = 127;
/// Ping and acknowledge.
pub const SYSTEM: u8 = 255;
