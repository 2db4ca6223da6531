//! CRC-8/MAXIM-DOW: reflected polynomial 0x8C, initial value 0, no final xor.

use std::{array, sync::LazyLock};

static TABLE: LazyLock<[u8; 256]> = LazyLock::new(|| {
    let shifted = |crc: u8| if crc & 1 == 1 { (crc >> 1) ^ 0x8c } else { crc >> 1 };
    array::from_fn(|byte| (0..8).fold(byte as u8, |crc, _| shifted(crc)))
});

/// Computes the CRC; in a frame, `bytes` are RID to the last data byte.
pub fn crc8(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |crc, byte| TABLE[usize::from(crc ^ byte)])
}
