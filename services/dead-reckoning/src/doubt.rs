//! Doubts that no fix settles: unequal wheels, travel that no command explains, and fixes that
//! contradicted the pose until it moved to them. They widen the published covariance only, because
//! a wider filter's gates would accept anything.

use common::{clock::MissionTime, found_response::if_there, samples::WheelSample};
use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{
    covariance::{BIAS_RAD_S, ErrorModel},
    filter::GYRO_SCALE,
    tick::{GyroTurn, Tick},
};

/// Least difference from 1 of a ratio that is off: in its deviations, and absolute.
///
/// Even wheels reached at most 0.89 of the greater limit in 240 missions of X80s and Kobukis, half
/// on a busy machine. An encoder that counts 4 % too little for half a mission reaches 1.05.
const DEVIATIONS: f64 = 2.5;
const LEAST_OFF: f64 = 0.018;
/// Reported position doubt, metres.
const TOLD_M: f64 = 0.1;
const WIDEST_M: f64 = 10.0;
/// Memory of the turns that are compared, seconds, and the squared deviations beyond which gyro and
/// wheels contradict each other: of one healthy comparison in 10,000.
const COMPARED_S: f64 = 10.0;
const CONTRADICTS: f64 = 15.1;

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Doubt {
    /// Rim travel since a fix independent of these wheels, metres.
    rolled_m: f64,
    /// Largest difference of the ratio from 1.
    uneven: f64,
    is_told: bool,
    /// Squared moves and turns by relocations, m^2 and rad^2.
    relocated: [f64; 2],
    /// Newest [`WheelSample::untold_m`].
    untold_m: [f64; 2],
    untold: Astray,
    #[serde(deserialize_with = "if_there")]
    turns: Turns,
}

/// Possible error of the pose since a fix that is independent of the wheels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Astray {
    turn_rad: f64,
    /// Beside the way, by the turn, and along it.
    aside_m: f64,
    along_m: f64,
}

impl Astray {
    fn roll(&mut self, rim_m: f64) {
        self.aside_m = (self.aside_m + self.turn_rad.abs() * rim_m).min(WIDEST_M);
    }

    /// Of position and heading, m^2 and rad^2.
    fn variances(&self) -> [f64; 2] {
        let Self { turn_rad, aside_m, along_m } = self;
        [aside_m * aside_m + along_m * along_m, turn_rad * turn_rad]
    }
}

/// Turns of the last ticks by gyro less those by wheels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Turns {
    /// Newest compared tick.
    until: MissionTime,
    apart_rad: f64,
    way_m: f64,
    variance: f64,
    /// Deviations that all ticks share: by unequal wheels, track, gyro scale and bias, rad.
    shared_rad: [f64; 4],
    /// Once gyro and wheels contradict each other: how far apart they lead.
    contradict: Option<Astray>,
}

impl Turns {
    fn add(&mut self, errors: &ErrorModel, tick: &Tick, gyro: GyroTurn) {
        let (slip, [ratio, track]) = errors.of_turn(tick.moved(), tick.seconds);
        let apart = gyro.turn - tick.turn;
        let left = (-tick.seconds / COMPARED_S).exp();
        self.until = tick.time;
        self.apart_rad = left * self.apart_rad + apart;
        self.way_m = left * self.way_m + tick.arc.abs();
        self.variance = left * left * self.variance + slip + gyro.variance;
        let shared = [ratio, track, GYRO_SCALE * gyro.turn, BIAS_RAD_S * tick.seconds];
        for (sum, more) in self.shared_rad.iter_mut().zip(shared) {
            *sum = left * *sum + more;
        }
        let shared: f64 = self.shared_rad.iter().map(|it| it * it).sum();
        let variance = self.variance + shared + errors.counted(tick.moved());
        match &mut self.contradict {
            Some(astray) => astray.turn_rad += apart,
            None if self.apart_rad.powi(2) > CONTRADICTS * variance => {
                // The turn came up on the compared way.
                let aside_m = self.apart_rad.abs() * self.way_m / 2.0;
                self.contradict = Some(Astray { turn_rad: self.apart_rad, aside_m, along_m: 0.0 });
            }
            None => {}
        }
    }
}

impl Doubt {
    pub(crate) fn relocate(&mut self, way: DVec2, turn: f64) {
        let [place, heading] = &mut self.relocated;
        *place += way.length_squared();
        *heading += turn * turn;
    }

    pub(crate) fn place_by_others(&mut self) {
        self.rolled_m = 0.0;
        self.untold = Astray::default();
        self.turns = Turns { until: self.turns.until, ..Turns::default() };
    }

    pub(crate) fn place(&mut self) {
        self.relocated = [0.0; 2];
        self.place_by_others();
    }

    /// Compares the turns of new ticks by gyro and wheels. Returns a warning once.
    pub(crate) fn compare<'a>(
        &mut self,
        errors: &ErrorModel,
        ticks: impl Iterator<Item = &'a Tick>,
    ) -> Option<String> {
        let before = self.turns.contradict;
        for tick in ticks {
            if let Some(gyro) = tick.gyro.filter(|_| tick.time > self.turns.until) {
                self.turns.add(errors, tick, gyro);
            }
        }
        let is_new = before.is_none() && self.turns.contradict.is_some();
        is_new.then(|| {
            "gyro and wheels contradict each other, so the pose is uncertain; check the gyro's unit and bias, and whether the wheels slip".to_owned()
        })
    }

    /// Takes rim travel. Returns a warning once.
    pub(crate) fn roll(
        &mut self,
        wheels: &WheelSample,
        rim_m: f64,
        track_m: f64,
    ) -> Option<String> {
        assert!(rim_m >= 0.0 || rim_m.is_nan());
        self.rolled_m += rim_m;
        if let Some(astray) = &mut self.turns.contradict {
            astray.roll(rim_m);
        }
        let WheelSample { told_ratio, told_ratio_sd, untold_m, .. } = *wheels;
        // A new link begins at 0.
        let before = std::mem::replace(&mut self.untold_m, untold_m);
        if untold_m != [0.0; 2] {
            let [left, right] = [0, 1].map(|wheel| untold_m[wheel] - before[wheel]);
            self.untold.turn_rad += (right - left) / track_m;
            self.untold.along_m += f64::midpoint(left, right);
        }
        self.untold.roll(rim_m);
        let off = (told_ratio - 1.0).abs();
        if off > LEAST_OFF.max(DEVIATIONS * told_ratio_sd) {
            self.uneven = self.uneven.max(off);
        }
        let [uneven, untold] = [self.of_wheels(track_m)[0], self.untold.variances()[0]];
        let place = uneven.max(untold);
        if self.is_told || place < TOLD_M * TOLD_M {
            return None;
        }
        self.is_told = true;
        let seen = if uneven > untold {
            format!(
                "relative to the commands, the right wheel counts {told_ratio:.2} times as much as the left"
            )
        } else {
            "commands or ranges contradict the counts of the wheels".to_owned()
        };
        Some(format!(
            "{seen}, so the pose is uncertain by {:.1} m or more; check encoders and wheels",
            place.sqrt()
        ))
    }

    fn of_wheels(&self, track_m: f64) -> [f64; 2] {
        let turn = (self.uneven * self.rolled_m / track_m).min(std::f64::consts::PI);
        let aside = (turn * self.rolled_m / 2.0).min(WIDEST_M);
        [aside * aside, turn * turn]
    }

    /// Of position and heading, m^2 and rad^2.
    pub(crate) fn variances(&self, track_m: f64) -> [f64; 2] {
        let contradict = self.turns.contradict.unwrap_or_default().variances();
        let all = [self.of_wheels(track_m), self.relocated, self.untold.variances(), contradict];
        [0, 1].map(|part| all.iter().map(|of| of[part]).sum())
    }
}
