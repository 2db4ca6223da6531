//! Turn of each tick from IMU messages.
//!
//! Rates are integrated by their stamps. A tick's odometry lies between two messages, so the newest
//! rate extrapolates to it. The next message corrects that error, because turns are differences of
//! angles.

use common::{
    driver::{
        Turn,
        gyro::{Compared, NOISE, Turns},
    },
    geometry::wrap_angle,
};

use crate::messages::{Imu, ImuTurn, NO_GROWTH, is_repeated};

/// Longest gap between messages, or to odometry, of a known turn.
const LONGEST_GAP_NS: i64 = 100_000_000;
/// Largest change of the rate until the tick, rad/s^2. Nominal.
const CHANGES_BY: f64 = 5.0;
#[derive(Clone, Debug, Default)]
pub(crate) struct Gyro {
    newest: Option<Newest>,
    /// Up to the newest message.
    turned: Turned,
    /// Up to the newest tick's odometry, if known.
    now: Option<Turned>,
    turns: Turns<Turned>,
    /// A gap before odometry was reported.
    is_missed: bool,
    compared: Compared,
}

#[derive(Clone, Copy, Debug)]
struct Newest {
    imu: Imu,
    rate: f64,
}

#[derive(Clone, Copy, Debug, Default)]
struct Turned {
    angle: f64,
    variance: f64,
    /// Variance after the newest message.
    ahead: f64,
}

impl Gyro {
    /// Takes a message; the error says why not.
    pub(crate) fn take(&mut self, imu: Imu) -> Result<(), String> {
        if self.newest.is_some_and(|newest| is_repeated(newest.imu.stamp_ns, imu.stamp_ns)) {
            return Err(NO_GROWTH.to_owned());
        }
        let turn = self.newest.and_then(|newest| turn(&newest.imu, &imu));
        let rate = match (imu.turn, turn) {
            (ImuTurn::Rate(rate, _), _) => rate,
            (ImuTurn::Heading(_), Some((_, rate, _))) => rate,
            (ImuTurn::Heading(_), None) => 0.0,
        };
        match turn {
            Some((angle, _, variance)) => {
                self.turned.angle += angle;
                self.turned.variance += variance;
            }
            // The last turn is unknown.
            None => {
                self.turns.interrupt();
                self.now = None;
            }
        }
        self.newest = Some(Newest { imu, rate });
        Ok(())
    }

    /// Begins a tick at this odometry, which turned `by_odometry` since the last. Returns a new
    /// fault of the gyro.
    pub(crate) fn odometry(&mut self, stamp_ns: i64, by_odometry: f64) -> Option<String> {
        let newest = self.newest?;
        let since_ns = stamp_ns - newest.imu.stamp_ns;
        let since_s = since_ns as f64 / 1e9;
        let before = self.now.take();
        if since_ns.abs() > LONGEST_GAP_NS {
            self.turns.interrupt();
            let is_new = !std::mem::replace(&mut self.is_missed, true);
            return is_new.then(|| {
                format!("the newest message is {since_s:.2} s older than odometry; publish it at 20 Hz or more with stamps of the same clock")
            });
        }
        self.is_missed = false;
        let unknown = 0.5 * CHANGES_BY * since_s * since_s;
        let now = Turned {
            angle: self.turned.angle + newest.rate * since_s,
            ahead: unknown * unknown,
            ..self.turned
        };
        self.now = Some(now);
        let why = self.compared.take(stamp_ns, [by_odometry, now.angle - before?.angle])?;
        Some(format!("{why}; publish rad/s about an axis that points up"))
    }

    pub(crate) fn for_tick(&mut self) -> Option<Turn> {
        let now = self.now.filter(|_| self.compared.agrees);
        let (sequence, before) = self.turns.until(now)?;
        let now = now?;
        let variance_rad2 = now.variance - before.variance + now.ahead + before.ahead;
        Some(Turn { sequence, turn_rad: now.angle - before.angle, variance_rad2 })
    }
}

/// Returns turn, radians, rate and variance between two messages. None across a gap, or between
/// different kinds.
fn turn(before: &Imu, now: &Imu) -> Option<(f64, f64, f64)> {
    let gap_ns = now.stamp_ns - before.stamp_ns;
    if !(1..=LONGEST_GAP_NS).contains(&gap_ns) {
        return None;
    }
    let gap_s = gap_ns as f64 / 1e9;
    let nominal = NOISE * NOISE * gap_s;
    match (before.turn, now.turn) {
        (ImuTurn::Rate(before, _), ImuTurn::Rate(rate, variance)) => {
            let stated = variance.unwrap_or_default() * gap_s * gap_s;
            Some((f64::midpoint(before, rate) * gap_s, rate, stated.max(nominal)))
        }
        (ImuTurn::Heading(before), ImuTurn::Heading(heading)) => {
            let turn = wrap_angle(heading - before);
            Some((turn, turn / gap_s, nominal))
        }
        _ => None,
    }
}
