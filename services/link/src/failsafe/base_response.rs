//! A base that answers later, or brakes more slowly, than stated: whatever allows it a speed counts on the stated response.

use common::{
    mission::{Body, Mission, Response},
    samples::Cause,
};

use super::monitor::{Condition, Moment, Monitor, Observation};

/// A way to stop that is longer by this share and by so many metres is not as stated: what was found is no more exact.
const LONGER_SHARE: f64 = 1.3;
const LONGER_M: f64 = 0.02;

#[derive(Clone, Debug)]
pub struct BaseResponse {
    stated: Response,
    top_speed_m_s: f64,
    found: Option<Response>,
}

impl BaseResponse {
    fn stops_within_m(&self, response: Response) -> f64 {
        response.way_to_stop_m(self.top_speed_m_s, response.dead_time_s())
    }
}

impl Monitor for BaseResponse {
    fn new(mission: &Mission) -> Self {
        let Body { response: stated, top_speed_m_s, .. } = mission.body();
        Self { stated, top_speed_m_s, found: None }
    }

    fn observe(&mut self, what: &Observation<'_>, _: Moment) {
        if let Observation::Responds(response) = *what {
            self.found = Some(response);
        }
    }

    fn condition(&self, _: Cause, _: Moment) -> Condition {
        let most_m = LONGER_SHARE * self.stops_within_m(self.stated) + LONGER_M;
        self.found.is_some_and(|found| self.stops_within_m(found) > most_m).into()
    }

    fn explain(&self, _: Cause, _: Moment) -> Option<String> {
        let Response { delay_s, acceleration_m_s2, .. } = self.found?;
        let stated = self.stated;
        Some(format!(
            "the base answers after {:.2} s and accelerates at {acceleration_m_s2} m/s^2, and {:.2} s and {} m/s^2 are stated: give delay_s = {delay_s:.2} and acceleration_m_s2 = {acceleration_m_s2} in [robot.response]; until then it drives at half speed, because it stops later than stated",
            self.found?.dead_time_s(),
            stated.dead_time_s(),
            stated.acceleration_m_s2,
        ))
    }
}
