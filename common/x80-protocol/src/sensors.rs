//! The contents of the three sensor frames.

use super::{
    did,
    frame::{MessageError, length},
};

/// Counts run 0..32767 and begin again.
pub const COUNT_CYCLE: u16 = 32_768;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Encoder {
    /// Cyclic below [`COUNT_CYCLE`], growing in the channel's positive direction.
    pub position: u16,
    pub speed: u16,
    pub positive: bool,
}

impl Encoder {
    /// Positive in the channel's positive direction.
    #[must_use]
    pub fn velocity(&self) -> i32 {
        let speed = i32::from(self.speed);
        if self.positive { speed } else { -speed }
    }

    /// The shorter way round the cycle, in the channel's positive direction.
    #[must_use]
    pub fn counts_since(&self, earlier: &Self) -> i32 {
        counts_between(earlier.position, self.position)
    }
}

/// The shorter way round the cycle, both below [`COUNT_CYCLE`].
#[must_use]
pub fn counts_between(old: u16, new: u16) -> i32 {
    let cycle = i32::from(COUNT_CYCLE);
    let ahead = (i32::from(new) - i32::from(old)).rem_euclid(cycle);
    if ahead >= cycle / 2 { ahead - cycle } else { ahead }
}

/// DID 123.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MotorSensors {
    /// AD counts of the six channels, as are `currents`.
    pub pots: [u16; 6],
    pub currents: [u16; 6],
    /// Channels 0 and 1.
    pub encoders: [Encoder; 2],
}

/// DID 125.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StandardSensors {
    /// Each is an [`super::Echo`].
    pub ultrasonic: [u8; 6],
    /// Two sensors, wakeup and motion each, AD counts.
    pub human: [u16; 4],
    /// X and y, AD counts.
    pub tilt: [u16; 2],
    /// Motor drivers, AD counts.
    pub overheat: [u16; 2],
    /// Board, AD counts.
    pub temperature: u16,
    /// The first ranger's AD counts for [`super::infrared_m`].
    pub infrared: u16,
    /// A remote control sent it last.
    pub infrared_code: [u8; 4],
    /// AD counts for [`super::volts`] with 9 V full scale.
    pub board_battery: u16,
    /// AD counts for [`super::volts`] with 24 V full scale.
    pub motor_battery: u16,
    /// AD counts for [`super::volts`] with 9 V full scale.
    pub servo_battery: u16,
    /// AD counts of the reference voltage.
    pub reference: u16,
}

/// DID 124.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CustomSensors {
    /// Infrared rangers 2 to 7 are on channels 2 to 7.
    pub ad: [u16; 8],
    pub io: u8,
}

const MOTOR_BYTES: usize = 33;
const STANDARD_BYTES: usize = 40;
const CUSTOM_BYTES: usize = 17;

/// Little-endian; missing ones read 0, because the length was checked.
struct Words<'a>(&'a [u8]);

impl Words<'_> {
    fn at(&self, offset: usize) -> u16 {
        match self.0.get(offset..offset + 2) {
            Some(&[low, high]) => u16::from_le_bytes([low, high]),
            _ => 0,
        }
    }

    fn array<const N: usize>(&self, offset: usize) -> [u16; N] {
        std::array::from_fn(|index| self.at(offset + 2 * index))
    }
}

fn put(bytes: &mut [u8], offset: usize, words: &[u16]) {
    for (slot, word) in bytes[offset..].chunks_exact_mut(2).zip(words) {
        slot.copy_from_slice(&word.to_le_bytes());
    }
}

impl MotorSensors {
    pub(super) fn from_bytes(data: &[u8]) -> Result<Self, MessageError> {
        if data.len() < MOTOR_BYTES {
            return Err(length(did::MOTOR, data, "33"));
        }
        let words = Words(data);
        let directions = data[32];
        let encoder = |channel: usize| Encoder {
            position: words.at(24 + 4 * channel) % COUNT_CYCLE,
            speed: words.at(26 + 4 * channel),
            positive: directions >> channel & 1 == 1,
        };
        Ok(Self {
            pots: words.array(0),
            currents: words.array(12),
            encoders: [encoder(0), encoder(1)],
        })
    }

    pub(super) fn to_bytes(self) -> [u8; MOTOR_BYTES] {
        let mut bytes = [0; MOTOR_BYTES];
        put(&mut bytes, 0, &self.pots);
        put(&mut bytes, 12, &self.currents);
        for (channel, encoder) in self.encoders.iter().enumerate() {
            put(&mut bytes, 24 + 4 * channel, &[encoder.position, encoder.speed]);
            bytes[32] |= u8::from(encoder.positive) << channel;
        }
        bytes
    }
}

impl StandardSensors {
    pub(super) fn from_bytes(data: &[u8]) -> Result<Self, MessageError> {
        if data.len() < STANDARD_BYTES {
            return Err(length(did::STANDARD, data, "40 or 41"));
        }
        let words = Words(data);
        Ok(Self {
            ultrasonic: std::array::from_fn(|index| data[index]),
            human: words.array(6),
            tilt: words.array(14),
            overheat: words.array(18),
            temperature: words.at(22),
            infrared: words.at(24),
            infrared_code: std::array::from_fn(|index| data[26 + index]),
            board_battery: words.at(30),
            motor_battery: words.at(32),
            servo_battery: words.at(34),
            reference: words.at(36),
        })
    }

    pub(super) fn to_bytes(self) -> [u8; STANDARD_BYTES] {
        let mut bytes = [0; STANDARD_BYTES];
        bytes[..6].copy_from_slice(&self.ultrasonic);
        put(&mut bytes, 6, &self.human);
        put(&mut bytes, 14, &self.tilt);
        put(&mut bytes, 18, &self.overheat);
        put(&mut bytes, 22, &[self.temperature, self.infrared]);
        bytes[26..30].copy_from_slice(&self.infrared_code);
        let supplies = [self.board_battery, self.motor_battery, self.servo_battery, self.reference];
        put(&mut bytes, 30, &supplies);
        bytes
    }
}

impl CustomSensors {
    pub(super) fn from_bytes(data: &[u8]) -> Result<Self, MessageError> {
        if data.len() < CUSTOM_BYTES {
            return Err(length(did::CUSTOM, data, "17"));
        }
        Ok(Self { ad: Words(data).array(0), io: data[16] })
    }

    pub(super) fn to_bytes(self) -> [u8; CUSTOM_BYTES] {
        let mut bytes = [0; CUSTOM_BYTES];
        put(&mut bytes, 0, &self.ad);
        bytes[16] = self.io;
        bytes
    }
}
