//! Measurements of the robot's position and turn by external sensors, whose sources are consumers
//! of the bus.

use serde::{Deserialize, Serialize};

use super::Name;
use crate::{bus::ZeroCopySend, mission::wire_enum};

payloads! {
    /// Position fix of an external source, for example a camera or a satellite receiver.
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
        /// Covariance of the error of (x, y, theta): xx, xy, x theta, yy, y theta, theta theta;
        /// m^2, m rad, rad^2. Without a heading the entries of theta are ignored.
        covariance: [f64; 6],
        /// Variances of the error common to all fixes of this source, such as that of its map.
        /// They are those of x and y and of theta, m^2 and rad^2. The covariance includes them, and
        /// averaging fixes cannot reduce them.
        shared: [f64; 2],
    }

    /// Operator's statement of the standing robot's pose, which replaces the estimate.
    #[derive(Serialize, Deserialize)]
    "firsthand.Place" PlaceSample {
        /// Counted from 1 in the run.
        number: u64,
        /// Metres in the mission frame.
        x_m: f64,
        y_m: f64,
        /// Radians counter-clockwise from x.
        heading_rad: f64,
        /// Standard deviations of x and y, and of the heading.
        sigma_m: f64,
        sigma_rad: f64,
    }

    #[derive(Serialize, Deserialize)]
    "firsthand.Turn" TurnSample {
        /// Mission time at the end of the increment, nanoseconds.
        capture_ns: u64,
        /// Successor of the number of the increment at whose end this one begins.
        sequence: u64,
        /// Radians counter-clockwise.
        turn_rad: f64,
        /// Variance of its error, rad^2.
        variance_rad2: f64,
    }

    /// Position of the followed thing, from an external source.
    "firsthand.Beacon" BeaconSample {
        /// Mission time of the measurement, nanoseconds; at most 1 s ago.
        capture_ns: u64,
        source: Name,
        /// Centre of the thing, metres in the mission frame.
        x_m: f64,
        y_m: f64,
        /// Standard deviation of x and y, metres.
        deviation_m: f64,
    }
}

wire_enum! {
    /// Reason why the supervisor ignored a beacon sample.
    BeaconRefusal, unknown = None, text = words {
        None = 0 "none",
        Late = 1 "it is more than 1 s old, or older than the one before; publish it sooner",
        /// More than a tick ahead.
        Future = 2 "its capture time is in the future; give mission time",
        NotFinite = 3 "it has a number that is not finite, or a negative deviation",
        Doubtful = 4 "its deviation is more than 0.25 m",
        Outside = 5 "it is outside the perimeter",
    }
}

wire_enum! {
    /// Reason why dead reckoning ignored a fix.
    FixRefusal, unknown = None, text = words {
        None = 0 "none",
        /// It may also be older than the oldest tick in dead reckoning.
        Late = 1 "a fix is refused: it is more than 2 s old; publish it sooner",
        /// More than a tick after the newest one.
        Future = 2 "a fix is refused: its capture time is in the future; give mission time",
        NotFinite = 3 "a fix is refused: it has a number that is not finite",
        Covariance = 4 "a fix is refused: its covariance is not positive or states less than 5 mm",
        Far = 5 "a fix is refused: it contradicts the pose",
        TooMany = 6 "a fix is refused: too many came in 2 s; publish fewer",
        /// Fixes have moved the robot as often as permitted.
        Contradicts = 7 "a fix is refused: fixes have moved the robot twice and contradict the pose again; check their source",
    }
}
