//! The additions of the page to `common`: the payload, and the row of the table of topics.
//!
//! Why `unsafe` is allowed here: as in `common::samples`, deriving `ZeroCopySend` writes an `unsafe impl` for a
//! `repr(C)` struct of plain numbers.
#![allow(unsafe_code)]

use common::{
    bus::{Topic, ZeroCopySend},
    topics::{Limits, Logged, Rate, Spec},
};

common::payloads! {
    /// Topic `distance`: how far the robot has driven.
    "firsthand.Distance" DistanceSample {
        /// Length of the path driven so far, metres.
        driven_m: f64,
        /// Mission time in which the robot moved, seconds.
        moving_s: f64,
    }
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
