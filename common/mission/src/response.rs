//! Response of a robot's base to commands: a delay, then a limited acceleration with a first-order
//! lag.

use std::collections::VecDeque;

use crate::kinematics::Twist;

keys! {
    /// Keys of `[robot.response]`; unwritten ones are the model's.
    #[derive(Copy)]
    ResponseKeys {
        delay_s: Option<f64>,
        lag_s: Option<f64>,
        acceleration_m_s2: Option<f64>,
        /// By default that of two wheels at a written [`ResponseKeys::acceleration_m_s2`].
        turn_acceleration_rad_s2: Option<f64>,
    }
}

impl ResponseKeys {
    /// Returns the response of a base with `track_m` between its wheels; `preset` is the model's.
    pub(crate) fn over(&self, preset: Response, track_m: f64) -> Response {
        let turn = self.acceleration_m_s2.map(|acceleration| 2.0 * acceleration / track_m);
        Response {
            delay_s: self.delay_s.unwrap_or(preset.delay_s),
            lag_s: self.lag_s.unwrap_or(preset.lag_s),
            acceleration_m_s2: self.acceleration_m_s2.unwrap_or(preset.acceleration_m_s2),
            turn_acceleration_rad_s2: self
                .turn_acceleration_rad_s2
                .or(turn)
                .unwrap_or(preset.turn_acceleration_rad_s2),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Response {
    /// Time from a command to its first effect in the odometry at the link, seconds. It includes
    /// network delay.
    pub delay_s: f64,
    pub lag_s: f64,
    /// Limit of acceleration and braking; infinite for a base that the lag alone describes.
    pub acceleration_m_s2: f64,
    pub turn_acceleration_rad_s2: f64,
}

impl Response {
    /// Nominal values of an X80, whose vendor gives no acceleration. Other models use its delay
    /// and lag, because no source states theirs.
    pub const X80: Self = Self {
        delay_s: 0.07,
        lag_s: 0.08,
        acceleration_m_s2: f64::INFINITY,
        turn_acceleration_rad_s2: f64::INFINITY,
    };

    /// Returns a conservative response for an unknown base; hardly any base is later and heavier.
    pub(crate) fn careful(track_m: f64) -> Self {
        let acceleration_m_s2 = 0.3;
        let turn_acceleration_rad_s2 = 2.0 * acceleration_m_s2 / track_m;
        Self { delay_s: 0.5, lag_s: 0.0, acceleration_m_s2, turn_acceleration_rad_s2 }
    }

    /// Returns the time for which the base continues as before, seconds; a lag counts with its time
    /// constant.
    pub fn dead_time_s(&self) -> f64 {
        self.delay_s + self.lag_s
    }

    /// Returns the stopping distance, metres, if braking starts `after_s` seconds after its cause.
    /// `after_s` includes [`Response::dead_time_s`].
    pub fn way_to_stop_m(&self, speed_m_s: f64, after_s: f64) -> f64 {
        speed_m_s * after_s + speed_m_s * speed_m_s / (2.0 * self.acceleration_m_s2)
    }

    /// Returns the greatest speed, m/s, that allows a stop within `room_m` metres: the inverse of
    /// [`Response::way_to_stop_m`].
    pub fn speed_to_stop_within(&self, room_m: f64, after_s: f64) -> f64 {
        if self.acceleration_m_s2.is_infinite() {
            return room_m / after_s;
        }
        // Root of v t + v^2 / 2a = d, in a form without cancellation.
        let brakes = 2.0 * room_m.max(0.0) / self.acceleration_m_s2;
        2.0 * room_m / (after_s + (after_s * after_s + brakes).sqrt())
    }

    /// Returns the greatest turn rate, rad/s, that allows a stop within `angle_rad`, excluding the
    /// dead time. Only a limited base needs the angle.
    pub fn turn_to_stop_within(&self, angle_rad: impl FnOnce() -> f64) -> f64 {
        if self.turn_acceleration_rad_s2.is_infinite() {
            return f64::INFINITY;
        }
        (2.0 * self.turn_acceleration_rad_s2 * angle_rad()).max(0.0).sqrt()
    }
}

/// Base with a limited acceleration of each wheel and of the turn. A base told to turn on the spot
/// therefore hardly brakes, and one at full acceleration keeps its turn rate.
#[derive(Clone, Copy, Debug)]
pub struct Base {
    pub response: Response,
    /// Distance of a wheel from the midpoint between both, metres.
    pub wheel_m: f64,
}

impl Base {
    pub const fn new(response: Response, track_m: f64) -> Self {
        Self { response, wheel_m: track_m / 2.0 }
    }

    pub const fn is_limited(&self) -> bool {
        self.response.acceleration_m_s2.is_finite()
    }

    /// Returns the twist `for_s` seconds after `now` while `wanted` acts.
    pub fn approach(&self, now: Twist, wanted: Twist, for_s: f64) -> Twist {
        if !self.is_limited() {
            return wanted;
        }
        let near = |now: f64, wanted: f64, most: f64| now + (wanted - now).clamp(-most, most);
        assert!(for_s >= 0.0 && self.wheel_m > 0.0);
        let most_rad_s = self.response.turn_acceleration_rad_s2 * for_s;
        let most_m_s = self.response.acceleration_m_s2 * for_s;
        let [left, right] = [-self.wheel_m, self.wheel_m]
            .map(|at| near(now.v + at * now.omega, wanted.v + at * wanted.omega, most_m_s));
        let omega = (right - left) / (2.0 * self.wheel_m);
        Twist { v: f64::midpoint(left, right), omega: near(now.omega, omega, most_rad_s) }
    }
}

/// Limit of the pending commands; beyond it the oldest acts at once.
const MOST_PENDING: usize = 256;

/// Speed, in any unit, that follows commands after a delay and at a limited rate. The lag counts as
/// part of the delay.
#[derive(Clone, Debug)]
pub struct ModelledSpeed {
    delay_s: f64,
    /// Per second.
    most_change: f64,
    /// With their times of effect.
    pending: VecDeque<(f64, f64)>,
    target: f64,
    speed: f64,
    at_s: f64,
}

impl ModelledSpeed {
    pub const fn new(delay_s: f64, most_change: f64) -> Self {
        assert!(delay_s >= 0.0 && most_change > 0.0);
        let pending = VecDeque::new();
        Self { delay_s, most_change, pending, target: 0.0, speed: 0.0, at_s: f64::NEG_INFINITY }
    }

    pub fn command(&mut self, at_s: f64, speed: f64) {
        if self.pending.len() == MOST_PENDING
            && let Some((_, oldest)) = self.pending.pop_front()
        {
            self.target = oldest;
        }
        self.pending.push_back((at_s + self.delay_s, speed));
        assert!(self.pending.len() <= MOST_PENDING);
    }

    pub const fn speed(&self) -> f64 {
        self.speed
    }

    /// Returns the pending commands, oldest first, with their times of effect.
    pub fn pending(&self) -> impl Iterator<Item = (f64, f64)> {
        self.pending.iter().copied()
    }

    /// Returns the remaining change of speed.
    pub fn left(&self) -> f64 {
        self.target - self.speed
    }

    /// Returns the distance since the last call.
    pub fn go_on(&mut self, until_s: f64) -> f64 {
        let mut way = 0.0;
        while let Some(&(acts_s, target)) = self.pending.front()
            && acts_s <= until_s
        {
            way += self.approach(acts_s - self.at_s);
            self.at_s = self.at_s.max(acts_s);
            self.target = target;
            self.pending.pop_front();
        }
        way += self.approach(until_s - self.at_s);
        self.at_s = self.at_s.max(until_s);
        way
    }

    fn approach(&mut self, for_s: f64) -> f64 {
        // Before the first call no time has passed.
        let for_s = if for_s.is_finite() { for_s.max(0.0) } else { 0.0 };
        let before = self.speed;
        let left = self.target - before;
        let changes_s = (left.abs() / self.most_change).min(for_s);
        assert!(changes_s >= 0.0 && for_s >= 0.0);
        self.speed = if changes_s < for_s || self.most_change.is_infinite() {
            self.target
        } else {
            before + self.most_change * changes_s * left.signum()
        };
        (before + self.speed) / 2.0 * changes_s + self.speed * (for_s - changes_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{close, mission};

    #[test]
    fn a_robot_stops_from_the_speed_that_is_allowed_within_the_room_that_there_is() {
        for acceleration_m_s2 in [0.3, 1.0, 20.0, f64::INFINITY] {
            let response = Response { acceleration_m_s2, ..Response::X80 };
            for (room, after) in [(0.05, 0.4), (0.6, 0.6), (3.0, 0.7)] {
                let speed = response.speed_to_stop_within(room, after);
                let way = response.way_to_stop_m(speed, after);
                assert!((way - room).abs() < 1e-9, "{acceleration_m_s2} {room}: {way}");
            }
        }
        assert_eq!(Response::X80.speed_to_stop_within(f64::INFINITY, 0.4), f64::INFINITY);
        let slow = Response { acceleration_m_s2: 0.3, ..Response::X80 };
        assert!(slow.speed_to_stop_within(0.0, 0.4) <= 0.0);
    }

    #[test]
    fn wheels_that_are_known_to_accelerate_slowly_turn_the_robot_slowly_too() {
        let keys = ResponseKeys { acceleration_m_s2: Some(0.6), ..ResponseKeys::default() };
        let response = keys.over(Response::X80, 0.3);
        assert_eq!((response.delay_s, response.turn_acceleration_rad_s2), (0.07, 4.0));
        let limited = Response { acceleration_m_s2: 1.0, ..Response::X80 };
        assert_eq!(ResponseKeys::default().over(limited, 0.3), limited);
    }

    #[test]
    fn a_base_of_which_nobody_stated_how_it_answers_is_trusted_little_and_an_x80_with_what_it_does()
    {
        let trusted = |text: &str| {
            let mission = mission(text);
            let Response { delay_s, acceleration_m_s2, .. } = mission.trusted_response();
            (mission.states_response(), delay_s, acceleration_m_s2)
        };
        assert_eq!(trusted(""), (true, 0.07, f64::INFINITY));
        assert_eq!(trusted("robot.protocol = 'json'"), (false, 0.5, 0.3));
        let json = |stated| format!("robot = {{ protocol = 'json', response = {{ {stated} }} }}");
        assert_eq!(trusted(&json("delay_s = 0.2")), (false, 0.2, 0.3));
        let both = "delay_s = 0.1, acceleration_m_s2 = 2.0";
        assert_eq!(trusted(&json(both)), (true, 0.1, 2.0));
    }

    #[test]
    fn a_modelled_speed_begins_after_the_delay_and_grows_and_falls_at_the_rate() {
        let mut speed = ModelledSpeed::new(0.4, 0.5);
        speed.go_on(0.0);
        speed.command(0.0, 0.3);
        assert_eq!((speed.go_on(0.4), speed.speed()), (0.0, 0.0));
        close(speed.go_on(0.8), 0.04);
        close(speed.speed(), 0.2);
        speed.command(0.8, -0.3);
        // It reaches 0.3 at 1.0 s, keeps it until 1.2 s, and is 0 at 1.8 s.
        close(speed.go_on(1.8), 0.05 + 0.06 + 0.09);
        close(speed.speed(), 0.0);
        let mut at_once = ModelledSpeed::new(0.0, f64::INFINITY);
        at_once.go_on(1.0);
        at_once.command(1.0, 0.5);
        assert_eq!((at_once.go_on(2.0), at_once.speed()), (0.5, 0.5));
    }

    #[test]
    fn a_base_that_is_told_to_turn_on_the_spot_brakes_no_more_than_its_wheels() {
        let response =
            Response { acceleration_m_s2: 0.3, turn_acceleration_rad_s2: 1.6, ..Response::X80 };
        let base = Base::new(response, 0.375);
        let (now, spot) = (Twist { v: 0.3, omega: 0.0 }, Twist { v: 0.0, omega: 2.0 });
        let turns = base.approach(now, spot, 0.5);
        assert!((turns.v - 0.2625).abs() < 1e-9 && turns.omega > 0.5, "{turns:?}");
        let stands = base.approach(now, Twist::default(), 0.5);
        assert!((stands.v - 0.15).abs() < 1e-9 && stands.omega == 0.0, "{stands:?}");
        let curve = Twist { v: 0.5, omega: 1.0 };
        let gains = base.approach(curve, Twist { v: 2.0, omega: 0.0 }, 0.5);
        assert!(gains.omega > 0.99, "both wheels gain speed: {gains:?}");
        assert_eq!(Base::new(Response::X80, 0.26).approach(curve, spot, 0.1), spot);
    }
}
