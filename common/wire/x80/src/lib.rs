//! X80 protocol: bytes to frames, frames to messages, and back.
//!
//! ```text
//! 5E 02 | RID | SN | DID | LEN | DATA[LEN] | CRC | 5E 0D
//! ```
//!
//! Numbers are little-endian, and bytes are not escaped. CRC is CRC-8/MAXIM-DOW over RID to the
//! last data byte. RID is the addressed device, DID the meaning of the data:
//!
//! | DID | host to robot ([`Command`]) | robot to host ([`Report`]) |
//! |---|---|---|
//! | 3 / 5 / 26 | position / PWM / velocity of one channel | |
//! | 4 / 6 / 27 | position / PWM / velocity of six channels at once | |
//! | 7 | a parameter | |
//! | 30 | enable motors | |
//! | 123 | start or stop the motor stream | wheel counts and speeds |
//! | 124 | start or stop the custom stream | eight AD channels |
//! | 125 | start or stop the standard stream | ultrasonic and the rest |
//! | 127 | start or stop all three | |
//! | 255 | ping, acknowledge | ping, acknowledge |
//!
//! The only sources are the vendor's manual and drivers in use. Messages are therefore sent in
//! their commonest form and accepted in all forms.
//!
//! ```
//! use x80_protocol::{Addressing, Command, Decoder, Report, SystemSignal};
//!
//! let mut bytes = Vec::new();
//! Command::velocity([Some(400), Some(-400)], Some(1000)).encode(Addressing::Numbered, &mut bytes);
//!
//! let mut decoder = Decoder::default();
//! decoder.push(&[0x5e, 0x02, 0x00, 0x00, 0xff, 0x01, 0x01, 0x48, 0x5e, 0x0d]);
//! while let Some(frame) = decoder.next_frame() {
//!     assert_eq!(Report::parse(&frame), Ok(Report::System(SystemSignal::Ack)));
//! }
//! ```

mod command;
mod crc;
mod decoder;
pub mod did;
mod frame;
mod report;
mod sensors;
mod units;

pub use command::{
    CHANNELS, Command, Feedback, Gains, Mode, Motion, Parameter, Quantity, Request, Stream, Targets,
};
pub use crc::crc8;
pub use decoder::{Decoder, DecoderTally};
pub use frame::{Addressing, Frame, MAX_FRAME_BYTES, MessageError, SystemSignal};
pub use report::Report;
pub use sensors::{
    COUNT_CYCLE, CustomSensors, Encoder, MotorSensors, StandardSensors, counts_between,
};
pub use units::{
    Echo, INFRARED_LIVE_AD, LOGIC_SCALE_V, MOTOR_SCALE_V, board_celsius, driver_celsius,
    infrared_ad, infrared_m, volts,
};

#[cfg(test)]
mod tests;
