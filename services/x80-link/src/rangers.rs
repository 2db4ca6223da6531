//! The readings of the rangers for the next tick, collected from several frames.

use common::{
    infrared,
    mission::Mission,
    samples::{InfraredSample, RangeSample, RangeStatus},
    wire::{CustomSensors, Echo, StandardSensors, infrared_m},
};

/// The newest readings since the last tick.
#[derive(Clone, Debug)]
pub(crate) struct Rangers {
    sonar_index: usize,
    sonar: Option<u8>,
    /// The first infrared ranger comes in the standard frame, the other six in the custom one.
    first_infrared: Option<u16>,
    infrared: Option<[u16; infrared::RANGERS]>,
}

impl Rangers {
    pub(crate) fn new(mission: &Mission) -> Self {
        Self {
            sonar_index: usize::from(mission.sonar.index),
            sonar: None,
            first_infrared: None,
            infrared: None,
        }
    }

    pub(crate) fn take_standard(&mut self, standard: &StandardSensors) {
        self.sonar = standard.ultrasonic.get(self.sonar_index).copied();
        self.first_infrared = Some(standard.infrared);
    }

    /// Take a custom frame. Returns no sample until a standard frame has brought the first ranger's reading.
    pub(crate) fn take_custom(&mut self, custom: &CustomSensors) -> Option<InfraredSample> {
        let [_, _, second, third, fourth, fifth, sixth, seventh] = custom.ad;
        let first = self.first_infrared?;
        let raw_ad = [first, second, third, fourth, fifth, sixth, seventh];
        self.infrared = Some(raw_ad);
        Some(InfraredSample {
            range_m: raw_ad.map(infrared_m),
            raw_ad,
            ..InfraredSample::default()
        })
    }

    /// Take the readings for a tick. The next tick has none until new ones come.
    pub(crate) fn for_tick(&mut self) -> RangeSample {
        RangeSample {
            infrared_ad: self.infrared.take().unwrap_or_default(),
            ..reading(self.sonar.take())
        }
    }
}

/// The sample with the reading of a sonar byte.
fn reading(byte: Option<u8>) -> RangeSample {
    let (status, range_m) = match byte.map(Echo::from_byte) {
        None => (RangeStatus::Absent, None),
        Some(None) => (RangeStatus::Invalid, None),
        Some(Some(echo @ Echo::Touching)) => (RangeStatus::AtContact, echo.metres()),
        Some(Some(echo @ Echo::At(_))) => (RangeStatus::Measured, echo.metres()),
        Some(Some(Echo::Nothing)) => (RangeStatus::Nothing, None),
    };
    RangeSample {
        range_m: range_m.unwrap_or_default(),
        status: status.into(),
        raw_cm: byte.unwrap_or_default(),
        ..RangeSample::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn the_seven_infrared_rangers_come_from_two_frames() {
        let mut rangers =
            Rangers::new(&Mission::parse("target = [3, 0]", Path::new("test.toml")).unwrap());
        let custom = CustomSensors { ad: [9, 9, 1000, 0, 4095, 0, 0, 0], io: 0 };
        assert_eq!(rangers.take_custom(&custom), None, "one is missing");
        rangers.take_standard(&StandardSensors { infrared: 1000, ..StandardSensors::default() });
        let infrared = rangers.take_custom(&custom).unwrap();
        assert_eq!(infrared.raw_ad, [1000, 1000, 0, 4095, 0, 0, 0]);
        assert_eq!(infrared.range_m[2..4], [0.81, 0.09]);
        assert!((infrared.range_m[0] - 0.375_79).abs() < 1e-5);
    }

    #[test]
    fn every_sonar_byte_is_read_as_the_protocol_says() {
        let status = |byte| RangeStatus::from_byte(reading(Some(byte)).status);
        assert_eq!(status(0), RangeStatus::Invalid);
        assert_eq!(status(4), RangeStatus::AtContact);
        assert_eq!(status(5), RangeStatus::Measured);
        assert_eq!(status(254), RangeStatus::Measured);
        assert_eq!(status(255), RangeStatus::Nothing);
        assert_eq!(reading(None).status, u8::from(RangeStatus::Absent));
    }
}
