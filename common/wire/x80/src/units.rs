use std::ops::RangeInclusive;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Echo {
    /// Bytes 1..4: at most 4 cm.
    Touching,
    /// Bytes 5..254, centimetres.
    At(u8),
    /// Byte 255: nothing within 2.55 m.
    Nothing,
}

impl Echo {
    /// Returns `None` for 0, which is no reading.
    pub const fn from_byte(byte: u8) -> Option<Self> {
        match byte {
            0 => None,
            1..=4 => Some(Self::Touching),
            5..=254 => Some(Self::At(byte)),
            255 => Some(Self::Nothing),
        }
    }

    /// Returns whole centimetres, 4 to 255.
    pub fn byte_at(range: f64) -> u8 {
        (range * 100.0).round().clamp(4.0, 255.0) as u8
    }

    /// Returns 0.04 when touching, and `None` without an echo.
    pub fn metres(self) -> Option<f64> {
        match self {
            Self::Touching => Some(0.04),
            Self::At(cm) => Some(f64::from(cm) / 100.0),
            Self::Nothing => None,
        }
    }
}

const INFRARED_M: (f64, f64) = (0.09, 0.81);

/// Counts of a powered and connected ranger: 0.2 V with nothing in view, up to 3.0 V at the peak of
/// its curve. Others mean a dead or saturated ranger.
pub const INFRARED_LIVE_AD: RangeInclusive<u16> = 268..=4_060;

/// Converts to metres, clamped to 0.09..0.81; 0.81 may also mean nothing in reach.
pub fn infrared_m(ad: u16) -> f64 {
    let volts_over = f64::from(ad) * 3.0 / 4028.0 - 0.17;
    if volts_over <= 0.0 {
        return INFRARED_M.1;
    }
    (0.216 / volts_over).clamp(INFRARED_M.0, INFRARED_M.1)
}

/// Inverts [`infrared_m`].
pub fn infrared_ad(range: f64) -> u16 {
    let range = range.clamp(INFRARED_M.0, INFRARED_M.1);
    let ad = ((0.216 / range + 0.17) * 4028.0 / 3.0).round() as u16;
    debug_assert!(range.is_nan() || (infrared_m(ad) - range).abs() < 0.002);
    ad
}

/// Board and servos, for [`volts`].
pub const LOGIC_SCALE_V: f64 = 9.0;
/// Motors, for [`volts`].
pub const MOTOR_SCALE_V: f64 = 24.0;

/// Converts `ad` counts, which reach 4095 at `full_scale` volts.
pub fn volts(ad: u16, full_scale: f64) -> f64 {
    f64::from(ad) / 4095.0 * full_scale
}

/// Applies the formula in the vendor's manual.
pub fn board_celsius(ad: u16) -> f64 {
    (f64::from(ad) - 1256.0) / 34.8
}

/// Applies the formula in the vendor's manual for its overheat sensors; at least one project doubts
/// it.
pub fn driver_celsius(ad: u16) -> f64 {
    100.0 - (f64::from(ad) - 980.0) / 11.6
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_is_a_byte_of_whole_centimetres_between_the_ends_of_the_scale() {
        let ranges = [0.01, 1.234, 9.0, f64::INFINITY];
        assert_eq!(ranges.map(Echo::byte_at), [4, 123, 255, 255]);
    }
}
