//! A car under guidance: (15), (16), limited in speed, and never on the spot.

use common::{kinematics::Twist, samples::GuidanceStatus};

use super::{Alignment, Controller, LEAST_SPEED_M_S};

impl Controller {
    /// How a car moves under guidance of that status; none to stand, which it does where it would have to turn on the
    /// spot.
    pub(super) fn car_motion(
        &mut self,
        modulated: bool,
        status: GuidanceStatus,
        alignment: Alignment,
        distance: f64,
        limit: f64,
    ) -> Option<Twist> {
        if !matches!(status, GuidanceStatus::Along | GuidanceStatus::WayOut) {
            return None;
        }
        let least = LEAST_SPEED_M_S.min(self.speed);
        let omega = self.angular(alignment);
        let wanted = self.tangential(modulated, alignment, omega, distance);
        let wanted = wanted.max(least);
        // Written so that a limit that is no number stands.
        if limit >= least {
            let v = wanted.min(limit);
            // It goes slower along the same curve.
            let omega = omega * v / wanted;
            Some(Twist { v, omega })
        } else {
            None
        }
    }
}
