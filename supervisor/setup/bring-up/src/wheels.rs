//! Commands that each encoder follows, and the response of the base.

use std::iter::zip;

use calibration::response;
use common::mission::Mission;
use nalgebra::{Matrix2, Vector2};

use crate::{
    Finding,
    body::words,
    trace::{Told, Trace, between},
};

/// Time for a base of any response to follow a command, seconds.
const SETTLED_S: f64 = 1.0;
/// Minimum share of a command. A wheel below it is dead; another wheel's share below it is noise.
const LEAST_SHARE: f64 = 0.15;
/// Greatest difference of the two wheels' shares.
const ALIKE: f64 = 0.1;
/// Greatest deviation of the motor-frame rate from the stated one, a share.
const RATE_SHARE: f64 = 0.2;

pub(crate) fn rate(mission: &Mission, trace: &Trace) -> Finding {
    let stated = mission.robot.rate_hz;
    let (Some(first), Some(last)) = (trace.rolled.first(), trace.rolled.last()) else {
        return Finding::wrong("robot", "it reports nothing; check robot.address and its power");
    };
    let hz = (trace.rolled.len() - 1) as f64 / (last.0 - first.0).max(1e-3);
    let text = format!("it reports its wheels {hz:.1} times per second, {stated:.1} stated");
    if (hz / stated - 1.0).abs() <= RATE_SHARE {
        Finding::right("robot", text)
    } else {
        Finding::wrong("robot", text).with_key("robot.rate_hz", format!("{hz:.0}"))
    }
}

#[derive(Clone, Copy, PartialEq)]
pub(crate) struct Wheels {
    /// Rows are counting wheels, columns commanded wheels; left and right. `None` if the commands
    /// to turn and to drive were too short.
    counted: Option<Matrix2<f64>>,
}

/// Body motion by the wheels under their commands: angle, radians, and distance, metres.
pub(crate) type Motion = Vec<(f64, [f64; 2])>;

impl Wheels {
    /// Fits by least squares over all times at which the base has settled.
    pub(crate) fn of(trace: &Trace) -> Self {
        let (mut squares, mut products) = (Matrix2::zeros(), Matrix2::zeros());
        for leg in trace.legs().iter().filter(|leg| leg.told != Told::Stand) {
            let settled = leg.from_s + SETTLED_S.min(leg.seconds() / 2.0);
            let in_leg = trace.rolled.iter().filter(|(at, _)| (settled..leg.until_s).contains(at));
            for (before, now) in zip(in_leg.clone(), in_leg.skip(1)) {
                let Some(told) = between(&trace.sent, before.0) else { continue };
                // Closely spaced late frames, as on a busy machine, weigh less.
                let told = Vector2::from(told);
                squares += told * told.transpose() * (now.0 - before.0);
                products += (Vector2::from(now.1) - Vector2::from(before.1)) * told.transpose();
            }
        }
        // Only turns together with drives separate the wheels.
        let is_told = squares.determinant() > 1e-6 * squares[(0, 0)] * squares[(1, 1)];
        let inverse = squares.try_inverse().filter(|_| is_told);
        Self { counted: inverse.map(|inverse| products * inverse) }
    }

    /// Returns the wheel that each encoder follows. Each row, an encoder's, has 1 in the column of
    /// its wheel, or -1 if it counts backwards. A dead encoder has zeros.
    fn follows(&self) -> Matrix2<f64> {
        let counted = self.counted.unwrap_or_else(Matrix2::identity);
        Matrix2::from_fn(|row, column| {
            let (share, other) = (counted[(row, column)], counted[(row, 1 - column)]);
            let is_least = share.abs() < other.abs() || share.abs() == other.abs() && column == 1;
            if is_least || share.abs() < LEAST_SHARE { 0.0 } else { share.signum() }
        })
    }

    /// Returns the finding; `motors` has the wheels behind each command, if observed.
    pub(crate) fn finding(&self, motors: Option<Matrix2<f64>>) -> Finding {
        let Some(counted) = self.counted else {
            return Finding::unknown(
                "wheels",
                "it moved too briefly, perhaps with something within 0.2 m of its front; see the logs of the run, and give it more room",
            );
        };
        let [left, right] = [0, 1].map(|row| counted.row(row).amax());
        let follows = self.follows();
        // Encoders that agree with commands are wired like the motors.
        let (encoders, or_motors) = match motors {
            _ if self.is_as_told() => (follows, ""),
            Some(motors) => (follows * motors.transpose(), ""),
            None => (follows, ", or the motors do so"),
        };
        let wrong = words(encoders, "encoder counts");
        if !wrong.is_empty() {
            let by = "check motors, plugs and wires, or the robot's own program";
            return Finding::wrong("wheels", format!("{wrong}{or_motors}; {by}"));
        }
        let text =
            format!("they count {:.0} and {:.0} % of their commands", 100.0 * left, 100.0 * right);
        if (left / right - 1.0).abs() <= ALIKE {
            return Finding::right("wheels", text);
        }
        let why = "one encoder loses counts or one motor is weak, or the wheels' diameters differ (calibrate them)";
        Finding::wrong("wheels", format!("{text}: {why}"))
    }

    /// Returns whether each encoder counts its wheel's command.
    pub(crate) fn is_as_told(&self) -> bool {
        self.follows() == Matrix2::identity()
    }

    pub(crate) fn motion(&self, trace: &Trace, track_m: f64) -> Motion {
        let wheels = self.follows().transpose();
        let motion = |(at, counted): &(f64, [f64; 2])| {
            let [left, right]: [f64; 2] = (wheels * Vector2::from(*counted)).into();
            (*at, [(right - left) / track_m, (left + right) / 2.0])
        };
        trace.rolled.iter().map(motion).collect()
    }
}

/// Compares delay and acceleration of the base with the stated ones.
pub(crate) fn response(mission: &Mission, trace: &Trace, motion: &Motion) -> Finding {
    let body = mission.body();
    let turn = |(at, told): &(f64, [f64; 2])| (*at, (told[1] - told[0]) / body.track_m);
    let told: Vec<_> = trace.sent.iter().map(turn).collect();
    let turned: Vec<_> = motion.iter().map(|(at, [angle, _])| (*at, *angle)).collect();
    let found = match response::estimate(&told, &turned, &body, response::By::Headings) {
        Ok(found) => found,
        Err(why) => return Finding::unknown("response", why),
    };
    let stated = body.response;
    let (delay, limit) = (found.delay_s, found.acceleration_m_s2);
    let text = format!(
        "the base answers after {:.2} s ({:.2} stated); acceleration limit: {}",
        delay.value,
        stated.delay_s,
        limit.map_or_else(|| "none found".to_owned(), |it| format!("{:.2} m/s²", it.value)),
    );
    // A stated lag hides in the delay.
    let least_s = DELAY_FRAMES / mission.robot.rate_hz;
    let late = delay.value - stated.delay_s > least_s.max(4.0 * delay.sd);
    let turning = stated.turn_acceleration_rad_s2 * body.track_m / 2.0;
    let heavy = limit.is_some_and(|it| {
        let stated = stated.acceleration_m_s2.min(turning);
        it.value < STRONG_M_S2 && it.value + 4.0 * it.sd < WEAKER * stated
    });
    if !late && !heavy {
        return Finding::right("response", text);
    }
    let mut finding = Finding::wrong("response", text)
        .with_key("robot.response.delay_s", format!("{:.3}", delay.value));
    if let Some(limit) = limit {
        finding =
            finding.with_key("robot.response.acceleration_m_s2", format!("{:.2}", limit.value));
    }
    finding
}

/// Minimum reported excess of the delay, in motor-frame periods. A busy machine adds half of one.
const DELAY_FRAMES: f64 = 0.75;
/// Share of the stated acceleration below which one under [`STRONG_M_S2`] is reported.
const WEAKER: f64 = 0.8;
/// Acceleration beyond which turns on the spot show no limit.
const STRONG_M_S2: f64 = 3.0;
