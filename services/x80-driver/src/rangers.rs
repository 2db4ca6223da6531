//! Readings for the next tick, from several frames.

use common::{
    mission::{INFRARED_RANGERS, Mission, Sensor, SensorKind},
    samples::{InfraredSample, RangeReading, RangeStatus},
    wire::{CustomSensors, Echo, INFRARED_LIVE_AD, StandardSensors, infrared_m},
};

#[derive(Debug)]
pub(crate) struct Rangers {
    table: Vec<Sensor>,
    /// From the standard frame; the custom one has the other six.
    first_infrared: Option<u16>,
}

impl Rangers {
    pub(crate) fn new(mission: &Mission) -> Self {
        Self { table: mission.sensor_table(), first_infrared: None }
    }

    pub(crate) fn take_standard(&mut self, standard: &StandardSensors) -> Vec<RangeReading> {
        self.first_infrared = Some(standard.infrared);
        self.readings(SensorKind::Cone, &standard.ultrasonic.map(heard))
    }

    /// Returns None before a standard frame.
    pub(crate) fn take_custom(
        &self,
        custom: &CustomSensors,
    ) -> Option<(InfraredSample, Vec<RangeReading>)> {
        let mut raw_ad = [self.first_infrared?; INFRARED_RANGERS];
        raw_ad[1..].copy_from_slice(&custom.ad[2..]);
        let sample =
            InfraredSample { range_m: raw_ad.map(infrared_m), raw_ad, ..InfraredSample::default() };
        Some((sample, self.readings(SensorKind::Ray, &raw_ad.map(seen))))
    }

    fn readings(&self, kind: SensorKind, channels: &[RangeReading]) -> Vec<RangeReading> {
        let rows = (0..).zip(&self.table).filter(|(_, row)| row.kind == kind);
        let read = |(sensor, row): (u8, &Sensor)| {
            Some(RangeReading { sensor, ..*channels.get(usize::from(row.channel))? })
        };
        rows.filter_map(read).collect()
    }
}

fn heard(byte: u8) -> RangeReading {
    let echo = Echo::from_byte(byte);
    let status = match echo {
        None => RangeStatus::Invalid,
        Some(Echo::Touching) => RangeStatus::AtContact,
        Some(Echo::At(_)) => RangeStatus::Measured,
        Some(Echo::Nothing) => RangeStatus::Nothing,
    };
    let range_m = echo.and_then(Echo::metres).unwrap_or_default();
    RangeReading { range_m, raw: byte.into(), status: status.into(), ..RangeReading::default() }
}

fn seen(ad: u16) -> RangeReading {
    let range_m = infrared_m(ad);
    let (status, range_m) = match INFRARED_LIVE_AD.contains(&ad) {
        false => (RangeStatus::Invalid, 0.0),
        true if range_m >= infrared_m(0) => (RangeStatus::Nothing, 0.0),
        true => (RangeStatus::Measured, range_m),
    };
    RangeReading { range_m, raw: ad, status: status.into(), ..RangeReading::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rangers(extra: &str) -> Rangers {
        let text = format!("target = [3, 0]\n{extra}");
        Rangers::new(&Mission::parse(&text, "test.toml").unwrap())
    }

    fn is(reading: &RangeReading, status: RangeStatus, range_m: f64, raw: u16) -> bool {
        reading.status() == status && (reading.range_m - range_m).abs() < 1e-5 && reading.raw == raw
    }

    #[test]
    fn the_seven_infrared_rangers_come_from_two_frames() {
        let mut rangers = rangers("");
        let custom = CustomSensors { ad: [9, 9, 1000, 0, 4095, 0, 0, 300], io: 0 };
        assert_eq!(rangers.take_custom(&custom), None, "one is missing");
        rangers.take_standard(&StandardSensors { infrared: 1000, ..StandardSensors::default() });
        let (infrared, readings) = rangers.take_custom(&custom).unwrap();
        assert_eq!(infrared.raw_ad, [1000, 1000, 0, 4095, 0, 0, 300]);
        assert_eq!(infrared.range_m[2..4], [0.81, 0.09]);
        assert!((infrared.range_m[0] - 0.375_79).abs() < 1e-5);
        assert!(readings[0].sensor == 3 && is(&readings[0], RangeStatus::Measured, 0.375_79, 1000));
        assert!(readings[6].sensor == 9 && is(&readings[6], RangeStatus::Nothing, 0.0, 300));
    }

    #[test]
    fn a_dead_or_saturated_ranger_says_nothing() {
        for ad in [0, 100, 4_080, 4_095, u16::MAX] {
            assert_eq!(seen(ad).status(), RangeStatus::Invalid, "{ad}");
        }
    }

    #[test]
    fn every_sonar_byte_is_read_as_the_protocol_says() {
        use RangeStatus::{AtContact, Invalid, Measured, Nothing};
        let statuses = [0, 4, 5, 254, 255].map(|byte| heard(byte).status());
        assert_eq!(statuses, [Invalid, AtContact, Measured, Measured, Nothing]);
    }

    #[test]
    fn every_sonar_that_has_a_row_is_read() {
        let ultrasonic = [45, 80, 135, 0, 0, 0];
        let standard = StandardSensors { ultrasonic, ..StandardSensors::default() };
        let readings = rangers("").take_standard(&standard);
        assert_eq!(readings.len(), 3);
        for (row, cm) in [(0, 80), (1, 45), (2, 135)] {
            let measured = is(&readings[row], RangeStatus::Measured, f64::from(cm) / 100.0, cm);
            assert!(measured && usize::from(readings[row].sensor) == row, "{readings:?}");
        }
    }
}
