use super::{
    did,
    frame::{Addressing, Frame, MessageError, SystemSignal},
    sensors::{CustomSensors, Layout as _, MotorSensors, StandardSensors},
};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Report {
    /// DID 123.
    Motor(MotorSensors),
    /// DID 124.
    Custom(CustomSensors),
    /// DID 125.
    Standard(StandardSensors),
    System(SystemSignal),
}

impl Report {
    pub fn encode(&self, addressing: Addressing, out: &mut Vec<u8>) {
        let (did, data) = match self {
            Self::Motor(sensors) => (did::MOTOR, sensors.to_bytes()),
            Self::Custom(sensors) => (did::CUSTOM, sensors.to_bytes()),
            Self::Standard(sensors) => (did::STANDARD, sensors.to_bytes()),
            Self::System(signal) => (did::SYSTEM, vec![*signal as u8]),
        };
        debug_assert!(Self::parse(&Frame { rid: 0, sn: 0, did, data: &data }).is_ok());
        Frame { rid: addressing.host(), sn: 0, did, data: &data }.encode(out);
    }

    /// # Errors
    /// If the DID is unknown, the frame too short, or a byte has no meaning.
    pub fn parse(&Frame { did, data, .. }: &Frame<'_>) -> Result<Self, MessageError> {
        let report = match did {
            did::MOTOR => MotorSensors::from_bytes(data).map(Self::Motor),
            did::CUSTOM => CustomSensors::from_bytes(data).map(Self::Custom),
            did::STANDARD => StandardSensors::from_bytes(data).map(Self::Standard),
            did::SYSTEM => SystemSignal::parse(data).map(Self::System),
            _ => None,
        };
        report.ok_or(MessageError { did })
    }
}
