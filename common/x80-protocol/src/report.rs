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
        let write = |did, data: &[u8], out: &mut Vec<u8>| {
            let rid = addressing.host();
            let frame = Frame { rid, sn: 0, did, data };
            frame.encode(out);
        };
        match self {
            Self::Motor(sensors) => write(did::MOTOR, &sensors.to_bytes(), out),
            Self::Custom(sensors) => write(did::CUSTOM, &sensors.to_bytes(), out),
            Self::Standard(sensors) => write(did::STANDARD, &sensors.to_bytes(), out),
            Self::System(signal) => write(did::SYSTEM, &[signal.byte()], out),
        }
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
