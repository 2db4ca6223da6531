//! Common parts of messages. Poses are planar.

use crate::msg::{
    self, Duration, Header, Point, PoseStamped, Quaternion, Time, Transform, Vector3,
};

/// Greatest deviation of a rotation quaternion's length from 1.
const UNIT_WITHIN: f64 = 0.1;

/// x, y and heading, metres and radians.
pub type Pose = [f64; 3];

impl Quaternion {
    fn of(heading: f64) -> Self {
        let (z, w) = (heading / 2.0).sin_cos();
        Self { z, w, ..Self::default() }
    }

    /// Returns the heading, radians.
    pub fn heading(&self) -> Option<f64> {
        let Self { x, y, z, w } = self;
        let length = [x, y, z, w].iter().map(|part| *part * *part).sum::<f64>().sqrt();
        let is_rotation = (length - 1.0).abs() <= UNIT_WITHIN;
        is_rotation.then(|| (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z)))
    }
}

impl msg::Pose {
    pub fn at(&self) -> [f64; 2] {
        [self.position.x, self.position.y]
    }
}

impl From<Pose> for msg::Pose {
    fn from([x, y, heading]: Pose) -> Self {
        Self { position: Point { x, y, z: 0.0 }, orientation: Quaternion::of(heading) }
    }
}

impl From<Pose> for Transform {
    fn from([x, y, heading]: Pose) -> Self {
        Self { translation: Vector3 { x, y, z: 0.0 }, rotation: Quaternion::of(heading) }
    }
}

impl Time {
    /// Nanoseconds.
    pub fn ns(&self) -> i64 {
        i64::from(self.sec) * 1_000_000_000 + i64::from(self.nanosec)
    }
}

macro_rules! of_nanoseconds {
    ($($time:ident)*) => {$(
        impl From<u64> for $time {
            fn from(ns: u64) -> Self {
                let sec = i32::try_from(ns / 1_000_000_000).unwrap_or(i32::MAX);
                Self { sec, nanosec: (ns % 1_000_000_000) as u32 }
            }
        }
    )*};
}

of_nanoseconds! { Time Duration }

impl Header {
    /// Returns a header at this time, nanoseconds since 1970.
    pub fn at(ns: u64, frame: &str) -> Self {
        Self { stamp: ns.into(), frame_id: frame.to_owned() }
    }

    pub fn with(&self, pose: Pose) -> PoseStamped {
        PoseStamped { header: self.clone(), pose: pose.into() }
    }
}
