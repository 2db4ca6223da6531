//! Turns of ticks by a gyro, whose increments end at their own times, and late.

use std::collections::VecDeque;

use common::{clock::MissionTime, samples::TurnSample};
use serde::{Deserialize, Serialize};

use crate::tick::{GyroTurn, Tick};

/// Relative error of a divided increment, which neighbouring ticks cancel.
const UNEVEN: f64 = 0.1;

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Gyro {
    sequence: u64,
    end: MissionTime,
    /// Start of `turn`: end of a tick, or of the first increment after a gap.
    since: MissionTime,
    /// Turn to the newest increment's end, and variance; radians, rad^2.
    turn: f64,
    variance: f64,
}

impl Gyro {
    /// Takes an increment and completes ticks' turns; returns whether it did. Increments across a
    /// tick's end are divided evenly.
    pub(crate) fn take(
        gyro: &mut Option<Self>,
        increment: &TurnSample,
        ticks: &mut VecDeque<Tick>,
    ) -> bool {
        let TurnSample { capture_ns, sequence, turn_rad, variance_rad2, .. } = *increment;
        if !(turn_rad.is_finite() && variance_rad2.is_finite() && variance_rad2 >= 0.0) {
            *gyro = None;
            return false;
        }
        let end = MissionTime(capture_ns);
        let follows =
            |gyro: &Self| sequence.checked_sub(1) == Some(gyro.sequence) && gyro.end < end;
        let Some(before) = gyro.filter(follows) else {
            *gyro = Some(Self { sequence, end, since: end, turn: 0.0, variance: 0.0 });
            return false;
        };
        let seconds = |from: MissionTime, to: MissionTime| to.since(from).as_secs_f64();
        let whole = seconds(before.end, end);
        assert!(whole > 0.0);
        let mut rest = Self { sequence, end, ..before };
        let mut given = 0.0;
        let mut completed = false;
        for tick in ticks.iter_mut().filter(|tick| tick.time > before.end && tick.time <= end) {
            let share = seconds(before.end, tick.time) / whole;
            assert!((0.0..=1.0).contains(&share));
            let part = share - given;
            let divided = UNEVEN * share * (1.0 - share) * turn_rad;
            let turn = rest.turn + part * turn_rad;
            let variance = rest.variance + part * variance_rad2 + divided * divided;
            // Earlier turns include ticks that left the history.
            if (seconds(rest.since, tick.time) - tick.seconds).abs() < 1e-6 && tick.seconds > 0.0 {
                tick.gyro = Some(GyroTurn { turn, variance });
                completed = true;
            }
            rest.since = tick.time;
            rest.turn = 0.0;
            rest.variance = divided * divided;
            given = share;
        }
        rest.turn += (1.0 - given) * turn_rad;
        rest.variance += (1.0 - given) * variance_rad2;
        *gyro = Some(rest);
        completed
    }
}
