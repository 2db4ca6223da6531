//! Measurements of the robot's place and turn by sensors outside it: their sources are consumers of the bus.

use serde::{Deserialize, Serialize};

use super::Name;
use crate::bus::ZeroCopySend;

payloads! {
    /// Topic `fix`: where a source outside saw the robot, for example a camera or a satellite receiver.
    #[derive(Serialize, Deserialize)]
    "firsthand.Fix" FixSample {
        /// Mission time at which it was measured, nanoseconds. It may be up to 2 s old.
        capture_ns: u64,
        /// The name of the source.
        source: Name,
        /// Metres in the mission frame.
        x_m: f64,
        /// Metres in the mission frame.
        y_m: f64,
        /// Radians counter-clockwise from x; NaN for none.
        heading_rad: f64,
        /// Covariance of the error of (x, y, theta): xx, xy, x theta, yy, y theta, theta theta; m^2, m rad, rad^2. The entries of
        /// theta are not read without a heading.
        covariance: [f64; 6],
        /// Variances of the error that all fixes of this source have in common, of x as of y and of theta, m^2 and rad^2, such as that
        /// of a map that the source made itself. They are in the covariance too. No number of fixes makes the pose surer.
        shared: [f64; 2],
    }

    /// Topic `turn`: how far a gyro turned since its last sample.
    #[derive(Serialize, Deserialize)]
    "firsthand.Turn" TurnSample {
        /// Mission time at which the increment ends, nanoseconds.
        capture_ns: u64,
        /// The number of the increment: one more than that of the increment at whose end it begins.
        sequence: u64,
        /// Radians counter-clockwise.
        turn_rad: f64,
        /// The variance of its error, rad^2.
        variance_rad2: f64,
    }
}

wire_enum! {
    /// Why dead reckoning did not use a fix.
    FixRefusal, unknown = None, text = words {
        /// The fix was used, or none came.
        None = 0 "none",
        /// The fix was measured more than 2 s ago, or before the oldest tick that dead reckoning still holds.
        Late = 1 "a fix is refused: it is more than 2 s old; publish it sooner",
        /// The fix was measured more than a tick after the newest one.
        Future = 2 "a fix is refused: its capture time is in the future; give mission time",
        /// A number of the fix is not finite.
        NotFinite = 3 "a fix is refused: it has a number that is not finite",
        /// The covariance of the fix is not positive, or states an error under 5 mm.
        Covariance = 4 "a fix is refused: its covariance is not positive or states less than 5 mm",
        /// The fix contradicts the pose.
        Far = 5 "a fix is refused: it contradicts the pose",
        /// Too many fixes of the same 2 s came before it.
        TooMany = 6 "a fix is refused: too many came in 2 s; publish fewer",
    }
}
