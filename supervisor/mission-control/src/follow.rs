//! Part of the loop that follows a beacon.

use crate::{
    error::Result,
    following::{Following, SILENT, kept_m},
    supervisor::Supervisor,
    target_list::{self, TargetOutcome},
};
use common::{
    clock::MissionTime,
    samples::{BeaconSample, FollowState, FollowingSample, RequestAnswer, RequestSample},
};

/// State of the beacon beside the saved [`Following`].
#[derive(Default)]
pub(crate) struct Beacon {
    /// Newest sample before following begins, or in lockstep one that waits for the answers to its
    /// tick.
    waiting: Option<BeaconSample>,
    /// Last tick before the next sample, in lockstep; makes runs repeatable.
    pub last_tick: u64,
    pub told: Option<FollowingSample>,
}

impl Supervisor<'_> {
    pub(crate) fn follow(&mut self, request: &RequestSample) -> RequestAnswer {
        let mission = &self.options.mission;
        let record = &self.record;
        if let Some(answer) = target_list::held_refusal(self.why_held()) {
            return answer;
        }
        if !mission.stay {
            return RequestAnswer::NotStaying;
        }
        let Some(distance_m) = kept_m(request.deviations[0], mission) else {
            return RequestAnswer::TooNear;
        };
        let pose = record.pose;
        let arrival = record.sure_arrival(mission);
        self.end_following(TargetOutcome::Followed);
        let now = self.pose_time();
        self.targets.follow(now.seconds(), arrival);
        let is_late = |it: &mut BeaconSample| now.since(MissionTime(it.capture_ns)) > SILENT;
        self.beacon.waiting.take_if(is_late);
        self.state.following = Some(Following::new(distance_m, now, pose.as_ref()));
        self.beacon.last_tick = self.record.newest_tick().unwrap_or_default();
        self.await_target();
        tracing::info!(distance_m, "the robot follows the beacon");
        self.tell_following();
        RequestAnswer::Taken
    }

    pub(crate) fn end_follow(&mut self) -> RequestAnswer {
        if self.end_following(TargetOutcome::Followed) {
            RequestAnswer::Taken
        } else {
            RequestAnswer::NotFollowing
        }
    }

    /// Ends the following, if any, and lets the robot wait. Returns whether it did.
    pub(crate) fn end_following(&mut self, outcome: TargetOutcome) -> bool {
        let Some(following) = self.state.following.take() else { return false };
        let (now, pose) = (self.pose_time(), self.record.pose);
        let followed = following.followed(now, pose.as_ref());
        self.targets.end_following((outcome, followed), following.place(), now.seconds());
        self.await_target();
        let sample = following.sample(now, pose.as_ref());
        tracing::info!(outcome = ?outcome, "{}", sample.result());
        self.beacon.told = Some(FollowingSample { state: FollowState::Ended.into(), ..sample });
        true
    }

    /// Takes the beacon's samples. Returns whether to publish.
    pub(crate) fn take_beacon(&mut self) -> Result<bool> {
        let mut changed = false;
        if self.state.following.is_none() {
            self.beacon.waiting = self.bus.beacon.newest()?.or(self.beacon.waiting);
            return Ok(false);
        }
        while let Some(beacon) = match self.beacon.waiting.take() {
            Some(beacon) => Some(beacon),
            None => self.bus.beacon.next_sample()?,
        } {
            if self.is_early(&beacon) {
                self.beacon.waiting = Some(beacon);
                break;
            }
            changed |= self.follow_to(&beacon);
        }
        let now = self.pose_time();
        if let Some(following) = &mut self.state.following
            && following.loses(now)
        {
            tracing::warn!("the robot lost its beacon and stops");
            changed = true;
        }
        self.tell_following();
        Ok(changed)
    }

    /// Returns whether, in lockstep, the stages have yet to answer the tick of `beacon`'s capture.
    fn is_early(&self, beacon: &BeaconSample) -> bool {
        let (Some(following), Some(captured)) =
            (&self.state.following, self.clock.tick_at(beacon.capture_ns))
        else {
            return false;
        };
        let record = &self.record;
        let newest = record.pose.map(|pose| pose.stamp.tick);
        let begins = newest.is_none() && following.is_new();
        // Samples of even later ticks lie in the future and are refused.
        let next = newest.map_or(0, |tick| tick + 1);
        !begins && captured <= next && record.published.tick < Some(captured)
    }

    fn follow_to(&mut self, beacon: &BeaconSample) -> bool {
        let now = self.pose_time();
        let mission = &self.options.mission;
        let Some(following) = &mut self.state.following else { return false };
        let was_lost = following.is_lost;
        let taken = following.take(beacon, now, mission);
        let record = &self.record;
        if let (Some(captured), Some(pose)) = (self.clock.tick_at(beacon.capture_ns), record.pose) {
            self.beacon.last_tick = self.beacon.last_tick.max(captured.min(pose.stamp.tick) + 1);
        }
        if let Err(refusal) = taken {
            let BeaconSample { x_m, y_m, deviation_m, .. } = *beacon;
            // A source may send thousands, so a repeated reason is logged once.
            if self.beacon.told.is_none_or(|told| told.refusal != u8::from(refusal)) {
                let why = refusal.words();
                tracing::warn!(x_m, y_m, deviation_m, "a beacon sample is refused: {why}");
            }
            self.tell_following();
            return false;
        }
        if was_lost {
            tracing::info!("the robot hears its beacon");
        }
        let here = record.pose.map_or(mission.start.at, |pose| {
            let rolls_m = pose.v_m_s * mission.trusted_response().dead_time_s();
            pose.pose().position + pose.pose().axis() * rolls_m
        });
        let current = (!self.targets.waits).then(|| self.targets.current.position());
        let arrived = record.arrival.is_some();
        let next = following.next_place(&record.grid, mission, (here, current), arrived);
        // In lockstep no tick follows an arrival until the target changes.
        let again = current.filter(|_| self.clock.in_ticks() && arrived);
        let Some(place) = next.or(again) else { return was_lost };
        self.targets.move_to(place, self.first_tick());
        self.on_new_target();
        true
    }

    fn tell_following(&mut self) {
        if let Some(following) = &self.state.following {
            let now = self.pose_time();
            self.beacon.told = Some(following.sample(now, self.record.pose.as_ref()));
        }
    }
}
