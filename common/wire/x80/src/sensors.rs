//! Contents of the three sensor frames.

/// Cycle of the counts, which run 0..32767 and wrap around.
pub const COUNT_CYCLE: u16 = 32_768;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Encoder {
    /// Cyclic below [`COUNT_CYCLE`], growing in the channel's positive direction.
    pub position: u16,
    pub speed: u16,
    pub positive: bool,
}

impl Encoder {
    pub fn velocity(&self) -> i32 {
        let speed = i32::from(self.speed);
        if self.positive { speed } else { -speed }
    }
}

/// Returns the shorter difference in the cycle; both counts are below [`COUNT_CYCLE`].
pub fn counts_between(old: u16, new: u16) -> i32 {
    let cycle = i32::from(COUNT_CYCLE);
    let ahead = (i32::from(new) - i32::from(old)).rem_euclid(cycle);
    let between = if ahead >= cycle / 2 { ahead - cycle } else { ahead };
    assert_eq!((i32::from(old) + between - i32::from(new)) % cycle, 0);
    between
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MotorSensors {
    /// AD counts of the six channels, like `currents`.
    pub pots: [u16; 6],
    pub currents: [u16; 6],
    /// Channels 0 and 1.
    pub encoders: [Encoder; 2],
}

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
    /// AD counts of the first ranger, for [`super::infrared_m`].
    pub infrared: u16,
    /// Last code from a remote control.
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

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CustomSensors {
    /// Infrared rangers 2 to 7 are on channels 2 to 7.
    pub ad: [u16; 8],
    pub io: u8,
}

/// Order of a frame's data, described once for reading and writing.
pub(super) trait Layout: Default {
    const BYTES: usize;

    /// Passes each byte to `byte`, which reads or replaces it.
    fn each_byte(&mut self, byte: &mut impl FnMut(&mut u8));

    /// Ignores further bytes.
    fn from_bytes(data: &[u8]) -> Option<Self> {
        let mut new = Self::default();
        let mut bytes = data.get(..Self::BYTES)?.iter();
        new.each_byte(&mut |byte| *byte = bytes.next().copied().unwrap_or_default());
        Some(new)
    }

    fn to_bytes(mut self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(Self::BYTES);
        self.each_byte(&mut |byte| bytes.push(*byte));
        assert!(bytes.len() <= Self::BYTES);
        bytes.resize(Self::BYTES, 0);
        bytes
    }
}

/// Passes the words in little-endian order.
fn each_word<'a>(words: impl IntoIterator<Item = &'a mut u16>, byte: &mut impl FnMut(&mut u8)) {
    for word in words {
        let mut bytes = word.to_le_bytes();
        bytes.iter_mut().for_each(&mut *byte);
        *word = u16::from_le_bytes(bytes);
    }
}

impl Layout for MotorSensors {
    const BYTES: usize = 33;

    fn each_byte(&mut self, byte: &mut impl FnMut(&mut u8)) {
        each_word(self.pots.iter_mut().chain(&mut self.currents), byte);
        for encoder in &mut self.encoders {
            each_word([&mut encoder.position, &mut encoder.speed], byte);
            encoder.position %= COUNT_CYCLE;
        }
        let [first, second] = self.encoders.map(|encoder| u8::from(encoder.positive));
        let mut directions = first | second << 1;
        byte(&mut directions);
        for (channel, encoder) in self.encoders.iter_mut().enumerate() {
            encoder.positive = directions >> channel & 1 == 1;
        }
    }
}

impl Layout for StandardSensors {
    const BYTES: usize = 40;

    fn each_byte(&mut self, byte: &mut impl FnMut(&mut u8)) {
        self.ultrasonic.iter_mut().for_each(&mut *byte);
        let further = self.tilt.iter_mut().chain(&mut self.overheat);
        each_word(self.human.iter_mut().chain(further), byte);
        each_word([&mut self.temperature, &mut self.infrared], byte);
        self.infrared_code.iter_mut().for_each(&mut *byte);
        each_word([&mut self.board_battery, &mut self.motor_battery], byte);
        each_word([&mut self.servo_battery, &mut self.reference], byte);
    }
}

impl Layout for CustomSensors {
    const BYTES: usize = 17;

    fn each_byte(&mut self, byte: &mut impl FnMut(&mut u8)) {
        each_word(&mut self.ad, byte);
        byte(&mut self.io);
    }
}
