//! Monitor for a base with an unstated response, or one that answers later or brakes more slowly
//! than stated.
//!
//! Ticks carry the found response to planner and controller. Speed limits count on the stated one,
//! so the robot drives at half speed until a command follows from such a tick. It stays slow with
//! the paper's method and with another planner, where the response cannot limit the speed.

use common::{
    clock::MissionTime,
    mission::{Body, Mission, Response},
    samples::{BaseResponseSample, Cause},
};

use super::{
    monitor::{Condition, Moment, Monitor, Observation},
    response_fit::{ACCELERATION_RATIO, DEAD_TIME_STEP_S},
};

/// Factor and metres over the stated stopping distance that contradict it. The fit is no more
/// exact.
const LONGER_SHARE: f64 = 1.3;
const LONGER_M: f64 = 0.02;

pub(super) fn is_longer(stops_within_m: f64, stated_m: f64) -> bool {
    stops_within_m > LONGER_SHARE * stated_m + LONGER_M
}

#[derive(Clone, Debug)]
pub struct BaseResponse {
    /// Trusted response if none is stated.
    stated: Response,
    is_stated: bool,
    top_speed_m_s: f64,
    brakes_by_response: bool,
    /// Newest response that stops later than stated, or the newest if none is stated.
    found: Option<Response>,
    /// Time of the first tick that carries the found response.
    told_from: MissionTime,
    is_followed: bool,
}

impl BaseResponse {
    fn stops_within_m(&self, response: Response) -> f64 {
        response.way_to_stop_m(self.top_speed_m_s, response.dead_time_s())
    }

    /// Returns the found response, at the slow end of its grid step.
    pub(crate) fn sample(&self) -> Option<BaseResponseSample> {
        let found = self.found.filter(|_| self.brakes_by_response)?;
        Some(BaseResponseSample {
            dead_time_s: found.dead_time_s() + DEAD_TIME_STEP_S / 2.0,
            acceleration_m_s2: found.acceleration_m_s2 / ACCELERATION_RATIO.sqrt(),
            ..BaseResponseSample::default()
        })
    }

    pub(crate) fn words(&self) -> Option<String> {
        let found = self.found?;
        let Response { delay_s, acceleration_m_s2, .. } = found;
        let answers = format!(
            "the base answers after {:.2} s and accelerates at {acceleration_m_s2:.2} m/s^2",
            found.dead_time_s()
        );
        if !self.is_stated {
            return Some(format!(
                "{answers}, or stops sooner, but robot.response is not stated; run `firsthand calibrate --response` and copy its result to [robot.response] (until then each run measures it again)"
            ));
        }
        let stated = self.stated;
        let until_then = if self.brakes_by_response {
            "until then each run measures it again"
        } else {
            "until then it drives at half speed, because it stops later than stated"
        };
        Some(format!(
            "{answers}, but {:.2} s and {} m/s^2 are stated; find what delays commands or frames, or give delay_s = {delay_s:.2} and acceleration_m_s2 = {acceleration_m_s2:.2} in [robot.response] ({until_then})",
            stated.dead_time_s(),
            stated.acceleration_m_s2,
        ))
    }
}

impl Monitor for BaseResponse {
    fn new(mission: &Mission) -> Self {
        let Body { response, top_speed_m_s, .. } = mission.body();
        let brakes_by_response = mission.brakes_by_response();
        Self {
            stated: if brakes_by_response { mission.trusted_response() } else { response },
            is_stated: mission.states_response(),
            top_speed_m_s,
            brakes_by_response,
            found: None,
            told_from: MissionTime::default(),
            is_followed: false,
        }
    }

    fn observe(&mut self, what: &Observation<'_>, now: Moment) {
        match *what {
            Observation::Responds(response) => {
                assert!(response.dead_time_s() >= 0.0 && response.acceleration_m_s2 > 0.0);
                let stated_m = self.stops_within_m(self.stated);
                let is_slower = is_longer(self.stops_within_m(response), stated_m);
                if is_slower || !self.is_stated {
                    self.found = Some(response);
                    self.told_from = now.time;
                    self.is_followed = !is_slower;
                }
            }
            Observation::Command(command) => {
                self.is_followed |= self.brakes_by_response && command.pose_ns >= self.told_from.0;
            }
            _ => {}
        }
    }

    fn condition(&self, _: Cause, _: Moment) -> Condition {
        (self.found.is_some() && !self.is_followed).into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::mission;

    #[test]
    fn a_slow_base_is_told_from_one_that_nobody_stated() {
        for (robot, said) in [("", "are stated"), ("robot.protocol = 'json'", "is not stated")] {
            let mission = mission(robot);
            let mut base = BaseResponse::new(&mission);
            let response = Response { delay_s: 2.0, ..mission.trusted_response() };
            base.observe(&Observation::Responds(response), Moment::default());
            assert!(base.words().unwrap().contains(said), "{robot}");
        }
    }
}
