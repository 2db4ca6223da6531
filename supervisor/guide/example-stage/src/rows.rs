//! What the page adds to `common`: the payload, and the row of the table of topics.
//!
//! Why `unsafe` is allowed here: as in `common::samples`, deriving `ZeroCopySend` writes an `unsafe impl` for a
//! `repr(C)` struct of plain numbers.
#![allow(unsafe_code)]

use common::{
    bus::{Topic, ZeroCopySend},
    samples::{Stamp, Stamped},
    topics::{Limits, Logged, Rate, Spec},
};

/// Topic `distance`: how far the robot has driven.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("firsthand.Distance")]
#[repr(C)]
pub struct DistanceSample {
    /// Which sample.
    pub stamp: Stamp,
    /// Length of the path driven so far, metres.
    pub driven_m: f64,
    /// Mission time in which the robot moved, seconds.
    pub moving_s: f64,
}

impl Stamped for DistanceSample {
    fn stamp(&self) -> &Stamp {
        &self.stamp
    }
    fn stamp_mut(&mut self) -> &mut Stamp {
        &mut self.stamp
    }
}

common::bus::layouts! {
    DistanceSample { stamp driven_m moving_s }
}

/// Metres driven and seconds in motion.
pub static DISTANCE: Topic<DistanceSample> = Topic::new(&Spec {
    name: "distance",
    writer: "odometer",
    rate: Rate::EachTick,
    limits: Limits::SMALL,
    logged: Logged::Yes,
    meaning: "Metres driven and seconds in motion.",
});
