//! Parts of many messages. Poses are in the plane.

use crate::cdr::{Malformed, Reader, Writer};

/// A quaternion whose length differs from 1 by more than this is no rotation.
const UNIT_WITHIN: f64 = 0.1;

/// x, y and heading, metres and radians.
pub type Pose = [f64; 3];

/// The heading of (x, y, z, w), radians; none if the quaternion is no rotation.
pub fn heading([i, j, k, w]: [f64; 4]) -> Option<f64> {
    let length = [i, j, k, w].iter().map(|part| part * part).sum::<f64>().sqrt();
    let is_rotation = (length - 1.0).abs() <= UNIT_WITHIN;
    is_rotation.then(|| (2.0 * (w * k + i * j)).atan2(1.0 - 2.0 * (j * j + k * k)))
}

impl<'a> Reader<'a> {
    /// Nanoseconds; fails if the bytes end early.
    pub fn time(&mut self) -> Result<i64, Malformed> {
        Ok(i64::from(self.i32()?) * 1_000_000_000 + i64::from(self.u32()?))
    }

    /// The stamp, nanoseconds, and the frame of a `std_msgs/Header`; fails if the bytes end early.
    pub fn header(&mut self) -> Result<(i64, &'a str), Malformed> {
        Ok((self.time()?, self.text()?))
    }

    /// A `geometry_msgs/Pose`: x and y, and the heading if it has a rotation; fails if the bytes end early.
    pub fn pose(&mut self) -> Result<([f64; 2], Option<f64>), Malformed> {
        let [x, y, _] = self.f64s()?;
        Ok(([x, y], heading(self.f64s()?)))
    }
}

impl Writer {
    /// Nanoseconds since 1970.
    pub fn time(&mut self, ns: u64) -> &mut Self {
        let seconds = i32::try_from(ns / 1_000_000_000).unwrap_or(i32::MAX);
        self.i32(seconds).u32((ns % 1_000_000_000) as u32)
    }

    pub fn header(&mut self, ns: u64, frame: &str) -> &mut Self {
        self.time(ns).text(frame)
    }

    /// A `geometry_msgs/Pose`; a `Transform` is written alike.
    pub fn pose(&mut self, [x, y, heading]: Pose) -> &mut Self {
        let (z, w) = (heading / 2.0).sin_cos();
        self.f64s(&[x, y, 0.0, 0.0, 0.0, z, w])
    }
}
