//! From the angle that a robot says of its gyro to the turn of each tick.

use std::f64::consts::PI;

use common::{
    driver::{
        Turn,
        gyro::{Compared, NOISE, Turns},
    },
    mission::Body,
};

/// Share by which the scale of a cheap gyro may be off, such as the MPU-6050's.
const SCALE: f64 = 0.01;

#[derive(Clone, Debug, Default)]
pub(crate) struct Gyro {
    /// The newest angle of the gyro and those of the wheels, radians.
    newest: Option<(f64, [f64; 2])>,
    turns: Turns<f64>,
    now_ns: f64,
    compared: Compared,
}

impl Gyro {
    /// A report has this angle of the gyro, if any, and of the wheels. Returns a new fault of the gyro.
    pub(crate) fn take(
        &mut self,
        angle: Option<f64>,
        wheels: [f64; 2],
        body: &Body,
        period_ns: f64,
    ) -> Option<String> {
        self.now_ns += period_ns;
        let newest = angle.map(|angle| (angle, wheels));
        let before = std::mem::replace(&mut self.newest, newest);
        let ((angle, [left, right]), (angle_before, [left_before, right_before])) =
            newest.zip(before)?;
        let turned = angle - angle_before;
        if turned.abs() > PI {
            // It begins anew.
            self.turns.interrupt();
            return None;
        }
        let rolled = (right - right_before) - (left - left_before);
        let by_wheels = rolled * body.wheel_radius_m / body.track_m;
        let why = self.compared.take(self.now_ns as i64, [by_wheels, turned])?;
        Some(format!("gyro: {why}; say radians counter-clockwise"))
    }

    /// After a gap the turn only says where the next one begins.
    pub(crate) fn for_tick(&mut self, rate_hz: f64) -> Option<Turn> {
        let now = self.newest.filter(|_| self.compared.agrees()).map(|(angle, _)| angle);
        let (sequence, before) = self.turns.until(now)?;
        let turn_rad = now? - before;
        let variance_rad2 = NOISE * NOISE / rate_hz + (SCALE * turn_rad).powi(2);
        Some(Turn { sequence, turn_rad, variance_rad2 })
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use common::{driver::Base as _, mission::Mission};

    use crate::{Driver as _, Json};

    /// The turns of ticks, by their sequence and angle, and what was refused: each tick the robot turns by 0.1 rad by its wheels, and its
    /// gyro says so much.
    fn told(said: &[Option<f64>]) -> (Vec<(u64, f64)>, Option<String>) {
        let text = "target = [3, 0]\nrobot.protocol = 'json'";
        let mission = Mission::parse(text, Path::new("m.toml")).unwrap();
        let mut driver = Json::new(&mission);
        let body = mission.body();
        let (mut turns, mut refused) = (Vec::new(), None);
        for (tick, gyro) in said.iter().enumerate() {
            let side = 0.05 * tick as f64 * body.track_m / body.wheel_radius_m;
            let gyro = gyro.map_or(String::new(), |gyro| format!(",\"gyro\":{gyro}"));
            let line = format!("{{\"wheels\":[{},{side}],\"speeds\":[0,0]{gyro}}}\n", -side);
            refused = driver.hear(line.as_bytes()).refused.or(refused);
            let rounded = |turn: f64| (turn * 1e6).round() / 1e6;
            turns.extend(driver.turn_for_tick().map(|it| (it.sequence, rounded(it.turn_rad))));
        }
        (turns, refused)
    }

    #[test]
    fn the_turns_of_ticks_are_those_of_a_gyro_that_was_seen_to_agree_and_begin_anew_after_a_gap() {
        let said = [0.0, 0.11, 0.22, 0.33].map(Some);
        let gap = [None, Some(0.55), Some(0.66), Some(20.0), Some(20.11)];
        let (turns, refused) = told(&[&said[..], &gap].concat());
        let want = [(2, 0.0), (3, 0.11), (5, 0.0), (6, 0.11), (8, 0.0), (9, 0.11)];
        assert_eq!((&turns[..], refused), (&want[..], None));
    }

    #[test]
    fn a_gyro_in_degrees_or_clockwise_is_not_used_and_named() {
        for factor in [57.3, -1.0] {
            let said: Vec<_> =
                (0..8).map(|tick| Some(0.1 * factor * f64::from(tick) / 4.0)).collect();
            let (turns, refused) = told(&said);
            assert!(turns.is_empty(), "{turns:?}");
            assert!(refused.unwrap().contains("say radians counter-clockwise"));
        }
        let mission =
            Mission::parse("target = [3, 0]\nrobot.protocol = 'json'", Path::new("m")).unwrap();
        let heard = Json::new(&mission).hear(b"{\"gyro\":1}\n");
        assert!(heard.refused.unwrap().contains("say both"));
    }
}
