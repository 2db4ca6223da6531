//! Measurements of the robot's place and turn by sensors outside it: their sources are consumers of the bus.

use serde::{Deserialize, Serialize};

use super::Name;
use crate::bus::ZeroCopySend;

payloads! {
    /// A source outside is, for example, a camera or a satellite receiver.
    #[derive(Serialize, Deserialize)]
    "firsthand.Fix" FixSample {
        /// Mission time of the measurement, nanoseconds; at most 2 s ago.
        capture_ns: u64,
        source: Name,
        /// Metres in the mission frame.
        x_m: f64,
        y_m: f64,
        /// Radians counter-clockwise from x; NaN for none.
        heading_rad: f64,
        /// Covariance of the error of (x, y, theta): xx, xy, x theta, yy, y theta, theta theta; m^2, m rad, rad^2. Without a heading the
        /// entries of theta are not read.
        covariance: [f64; 6],
        /// Variances of the error that all fixes of this source share (a map that the source made itself), of x as of y and of theta,
        /// m^2 and rad^2; the covariance includes them. No number of fixes averages this error out.
        shared: [f64; 2],
    }

    /// Where an operator says that the standing robot is: the pose becomes this.
    #[derive(Serialize, Deserialize)]
    "firsthand.Place" PlaceSample {
        /// Counted from 1 in the run.
        number: u64,
        /// Metres in the mission frame.
        x_m: f64,
        y_m: f64,
        /// Radians counter-clockwise from x.
        heading_rad: f64,
        /// Standard deviations of x as of y, and of the heading.
        sigma_m: f64,
        sigma_rad: f64,
    }

    #[derive(Serialize, Deserialize)]
    "firsthand.Turn" TurnSample {
        /// Mission time at which the increment ends, nanoseconds.
        capture_ns: u64,
        /// One more than the number of the increment at whose end this one begins.
        sequence: u64,
        /// Radians counter-clockwise.
        turn_rad: f64,
        /// The variance of its error, rad^2.
        variance_rad2: f64,
    }
}

payloads! {
    /// Where a source outside heard or saw the thing that the robot follows.
    "firsthand.Beacon" BeaconSample {
        /// Mission time of the measurement, nanoseconds; at most 1 s ago.
        capture_ns: u64,
        source: Name,
        /// The middle of the thing, metres in the mission frame.
        x_m: f64,
        y_m: f64,
        /// Standard deviation of x as of y, metres.
        deviation_m: f64,
    }
}

wire_enum! {
    /// The reason why the supervisor did not use a sample of the beacon.
    BeaconRefusal, unknown = None, text = words {
        None = 0 "none",
        Late = 1 "it is more than 1 s old, or older than the one before; publish it sooner",
        /// More than a tick after now.
        Future = 2 "its capture time is in the future; give mission time",
        NotFinite = 3 "it has a number that is not finite, or a negative deviation",
        Doubtful = 4 "its deviation is more than 0.25 m",
        Outside = 5 "it is outside the perimeter",
    }
}

wire_enum! {
    /// The reason why dead reckoning did not use a fix.
    FixRefusal, unknown = None, text = words {
        None = 0 "none",
        /// It may also be older than the oldest tick that dead reckoning holds.
        Late = 1 "a fix is refused: it is more than 2 s old; publish it sooner",
        /// More than a tick after the newest one.
        Future = 2 "a fix is refused: its capture time is in the future; give mission time",
        NotFinite = 3 "a fix is refused: it has a number that is not finite",
        Covariance = 4 "a fix is refused: its covariance is not positive or states less than 5 mm",
        Far = 5 "a fix is refused: it contradicts the pose",
        TooMany = 6 "a fix is refused: too many came in 2 s; publish fewer",
        /// Fixes moved the robot as often as they may.
        Contradicts = 7 "a fix is refused: fixes have moved the robot twice, and contradict the pose again; look at their source",
    }
}
