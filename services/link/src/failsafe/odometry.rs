//! Odometry monitor: checks that the encoders follow the commands.
//!
//! A frame interval is evidence if the wheel's command, at [`LEAST_M_S`] or more, kept its sign for
//! the settling time of the response. The wheel must roll [`LEAST_SHARE`] of what the base's
//! acceleration has reached of the newest two commands; real wheels roll 0.75 to 0.8. In intervals
//! over two periods, commands may have been lost.
//!
//! Each wheel and their difference are checked, because swapped wheels turn the robot the wrong
//! way. Evidence against one adds up; evidence for it counts down at most twice as fast. Opposite
//! motion counts twice, once a wheel could have reversed. At [`SUSPECTED_AFTER_S`] the robot must
//! stand. Until it does, [`super::response_fit`] looks for a response that explains the motion.
//!
//! A commanded wheel without counts is suspected after [`STILL_AFTER_S`], because a controller whose
//! pose turns the wrong way changes direction too often for the other evidence. With a held motor's
//! current the wheel counts as held instead ([`super::contact`]).
//!
//! Motion is uncommanded if a wheel or the difference exceeds every recent command by
//! [`LEAST_TURN_M_S`] plus a quarter of the wheels' speed, for [`UNTOLD_AFTER_S`].
//!
//! Single impossible counts are dropped ([`super::restart`]); [`MOST_JUMPS`] within
//! [`JUMPS_WITHIN`] are suspect too.

use std::time::Duration;

use common::{
    clock::MissionTime,
    driver::counts::WheelCounts,
    mission::{Mission, ModelledSpeed, Response},
    samples::{Cause, DoubtsSample, Order},
};

use super::{
    base_response::is_longer,
    contact::{Contacts, HELD_AFTER_S},
    modelled_wheels::{Axle, ModelledWheels},
    monitor::{Condition, Counts, Moment, Monitor, Observation},
    response_fit::{ResponseFit, Suspected, channels},
    wheel_shares::WheelShares,
};

/// Slowest judged rim speed, m/s.
const LEAST_M_S: f64 = 0.03;
const LEAST_TURN_M_S: f64 = 0.1;
/// Least judged difference as a share of the mean speed. Two motors differ by some hundredths.
const LEAST_TURN_SHARE: f64 = 0.25;
const LEAST_SHARE: f64 = 0.25;
const ROLLS_SHARE: f64 = 0.5;
/// Seconds of evidence that raise a suspicion. A radio that delivers frames loses commands for less
/// time.
pub(crate) const SUSPECTED_AFTER_S: f64 = 0.55;
/// Seconds without counts that raise a suspicion.
pub(crate) const STILL_AFTER_S: f64 = 1.0;
/// Seconds of uncommanded motion that raise a suspicion.
const UNTOLD_AFTER_S: f64 = 1.0;
/// Time before a suspicion that holds its evidence, and after it within which a base stops.
const JUDGED: Duration = Duration::from_millis(1500);
pub(crate) const MOST_JUMPS: usize = 3;
pub(crate) const JUMPS_WITHIN: Duration = Duration::from_secs(2);
/// Time without jumps that ends a jump suspicion.
pub(crate) const CALM: Duration = Duration::from_secs(2);
/// Jump suspicions that end by themselves.
const MOST_RECOVERIES: u32 = 2;
/// Stopping-distance ratios of an unchanged response. A new one makes planner and controller forget
/// unanswered commands.
const UNCHANGED: std::ops::Range<f64> = 0.67..1.2;
const LOOK_EVERY: Duration = Duration::from_millis(500);
pub(crate) const GIVEN_UP_AFTER: Duration = Duration::from_secs(10);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Suspicion {
    /// Also the driven wheel of a car.
    Left,
    Right,
    /// Both wheels roll: they are swapped, or one is misread.
    Turn,
    Jumps,
    Untold,
}

impl Suspicion {
    pub const fn words(self) -> &'static str {
        match self {
            Self::Left => {
                "the left wheel was told to turn and its counts do not follow; check its encoder, its motor, and robot.left"
            }
            Self::Right => {
                "the right wheel was told to turn and its counts do not follow; check its encoder, its motor, and robot.right"
            }
            Self::Turn => {
                "the robot was told to turn and its counts do not follow; check whether robot.left and robot.right are swapped"
            }
            Self::Jumps => "the counts jump farther than the wheels can turn; check the encoders",
            Self::Untold => {
                "the wheels turn without a command; check whether another program commands the robot, or something pushes it"
            }
        }
    }
}

/// Returns when counts become evidence about a command, seconds: once the wheel has settled, and
/// once it has reversed; an X80's at 7 Hz then has 0.6 of its speed.
fn settles(Response { delay_s, lag_s, .. }: Response) -> [f64; 2] {
    assert!(delay_s >= 0.0 && lag_s >= 0.0);
    [delay_s + 2.0 * lag_s + 0.02, delay_s + 0.375 * lag_s]
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Known {
    Unknown,
    /// No motion has contradicted the stated response.
    Stated,
    Found,
}

#[derive(Clone, Copy, Debug, Default)]
struct Evidence {
    asked: [f64; 2],
    since: MissionTime,
    against_s: f64,
    still_s: f64,
    /// At a high current.
    held_s: f64,
}

impl Evidence {
    fn ask(&mut self, counts_s: f64, now: MissionTime) {
        let [_, before] = self.asked;
        if counts_s * before <= 0.0 {
            self.since = now;
        }
        self.asked = [before, counts_s];
    }

    /// Weighs `counts` rolled in `gap_s`; `high` is a held motor's current. Commands below `least`
    /// counts/s are no evidence. Returns whether the wheel rolled as commanded.
    fn weigh(
        &mut self,
        (counts, gap_s): (f64, f64),
        least: f64,
        high: bool,
        [settled_s, turned_s]: [f64; 2],
        now: MissionTime,
    ) -> bool {
        let [before, newest] = self.asked;
        let asked = before.abs().min(newest.abs());
        let told_s = now.since(self.since).as_secs_f64() - gap_s;
        if asked < least || gap_s <= 0.0 {
            return false;
        }
        let share = counts * newest.signum() / (gap_s * asked);
        if high && share < LEAST_SHARE {
            // The motor pushes in vain. A body that pivots on the contact may even push its wheel
            // back.
            self.still_s = 0.0;
            if told_s >= settled_s {
                self.held_s += gap_s;
            }
            return false;
        }
        self.held_s = 0.0;
        self.still_s = if counts.abs() <= 1.0 { self.still_s + gap_s } else { 0.0 };
        let opposite = share <= -LEAST_SHARE;
        if told_s < if opposite { turned_s } else { settled_s } {
            return false;
        }
        let most = if opposite { 2.0 } else { 1.0 };
        let against = (1.0 - share / LEAST_SHARE).clamp(-2.0, most);
        self.against_s = (self.against_s + gap_s * against).max(0.0);
        share >= ROLLS_SHARE
    }
}

#[derive(Clone, Debug)]
pub struct Odometry {
    axle: Axle,
    response: Response,
    /// Whether it identifies the response while driving.
    pub(crate) searches: bool,
    known: Known,
    top_speed_m_s: f64,
    /// Commands as far as accelerations have reached them, counts/s.
    reached: ModelledWheels,
    fit: ResponseFit,
    pub(crate) shares: WheelShares,
    /// Response that explained a motion its predecessor did not, until reported.
    pub(crate) found: Option<Response>,
    /// Two periods.
    longest_gap: Duration,
    limit: Duration,
    commanded: Option<MissionTime>,
    frame: Option<(WheelCounts, MissionTime)>,
    /// Of the left and the right wheel, and of their difference.
    evidence: [Evidence; 3],
    untold_s: f64,
    pub(crate) contacts: Contacts,
    /// Newest first.
    jumps: [Option<MissionTime>; MOST_JUMPS],
    recoveries: u32,
    suspicion: Option<(Suspicion, MissionTime)>,
    /// Time of the last search for a delay.
    looked: MissionTime,
    ordered_to_drive: bool,
    /// Whether wheels that do not follow their commands are suspect.
    judges: bool,
    two_publishers: Option<(String, MissionTime)>,
}

impl Odometry {
    fn commanded(&mut self, counts: [i16; 2], now: MissionTime) {
        self.shares.told(counts, now.seconds());
        let limit = self.limit;
        let lapsed = |then: &MissionTime| now.since(*then) > limit;
        if let Some(then) = self.commanded.filter(lapsed) {
            self.ask([0.0; 2], MissionTime(then.0.saturating_add(limit.as_nanos() as u64)));
        }
        if self.commanded.is_none_or(|then| lapsed(&then)) {
            self.restart_evidence(now);
        }
        self.commanded = Some(now);
        let told = counts.map(f64::from);
        let reached = channels(self.ask(told, now));
        let told = channels(told);
        // A base may stop sooner than its response states.
        let [left, right, turn] = [0, 1, 2].map(|of| {
            let most = told[of].abs();
            if reached[of] * told[of] > 0.0 { reached[of].clamp(-most, most) } else { 0.0 }
        });
        let mean = (left.abs() + right.abs()) / 2.0;
        let tells = turn.abs() >= LEAST_TURN_SHARE * mean;
        let asked = [left, right, if tells { turn } else { 0.0 }];
        for (evidence, asked) in self.evidence.iter_mut().zip(asked).take(self.fit.judged()) {
            evidence.ask(asked, now);
        }
    }

    /// Returns the speeds that the base reaches, counts/s.
    fn ask(&mut self, counts: [f64; 2], now: MissionTime) -> [f64; 2] {
        self.fit.commanded(counts, now);
        self.reached.command(now.seconds(), counts);
        self.reached.go_on(now.seconds());
        self.reached.each(ModelledSpeed::speed)
    }

    fn adopt(&mut self, response: Response) {
        assert!(response.dead_time_s() >= 0.0 && response.acceleration_m_s2 > 0.0);
        self.response = response;
        self.found = Some(response);
        self.reached = ModelledWheels::new(self.axle, 0.0, &response);
        self.shares.adopt(response);
    }

    fn stops_within_m(&self, response: Response) -> f64 {
        response.way_to_stop_m(self.top_speed_m_s, response.dead_time_s())
    }

    fn plausible(&mut self, counts: impl Into<WheelCounts>, now: MissionTime) {
        let counts = counts.into();
        self.shares.rolled(counts, now.seconds());
        let calm = self.jumps[0].is_none_or(|jump| now.since(jump) >= CALM);
        if calm
            && self.recoveries < MOST_RECOVERIES
            && matches!(self.suspicion, Some((Suspicion::Jumps, _)))
        {
            self.recoveries += 1;
            self.suspicion = None;
            self.restart_evidence(now);
        }
        if let Some(wheel) = self.contacts.repeats(now)
            && self.evidence[..2].iter().all(|evidence| evidence.asked == [0.0; 2])
        {
            let suspicion = [Suspicion::Left, Suspicion::Right][wheel];
            self.suspicion.get_or_insert((suspicion, now));
        }
        let Some((before, then)) = self.frame.replace((counts, now)) else {
            return;
        };
        let gap = now.since(then);
        let turned = counts.since(before);
        self.fit.turned((gap <= self.longest_gap).then_some(turned), now);
        if gap > self.longest_gap || self.commanded.is_none_or(|at| now.since(at) > self.limit) {
            // Commands since the last frame may be lost or expired.
            self.restart_evidence(now);
            return;
        }
        let [left, right] = turned;
        let settles @ [settled_s, _] = settles(self.response);
        let gap_s = gap.as_secs_f64();
        let least = LEAST_M_S * self.axle.counts_per_m;
        let high = self.contacts.high();
        for (wheel, evidence) in self.evidence[..2].iter_mut().enumerate() {
            let rolled = (turned[wheel], gap_s);
            if evidence.weigh(rolled, least, high[wheel], settles, now) && high[wheel] {
                self.contacts.high_and_rolls_s[wheel] += gap_s;
            }
        }
        if high == [false; 2] {
            let least = LEAST_TURN_M_S * self.axle.counts_per_m;
            self.evidence[2].weigh((right - left, gap_s), least, false, settles, now);
            let from_s = now.seconds() - gap_s - settled_s - self.limit.as_secs_f64();
            let speeds = turned.map(|counts| counts / gap_s);
            let slows = (from_s, self.axle.limits(&self.response));
            let is_untold = self.fit.is_untold(speeds, slows, least);
            self.untold_s = (self.untold_s + if is_untold { gap_s } else { -gap_s }).max(0.0);
            assert!(gap_s <= self.longest_gap.as_secs_f64());
        }
        self.look_for_contact(now);
        let suspected = |(evidence, _): &(&Evidence, Suspicion)| {
            evidence.against_s >= SUSPECTED_AFTER_S || evidence.still_s >= STILL_AFTER_S
        };
        let all = [Suspicion::Left, Suspicion::Right, Suspicion::Turn];
        let suspicion = self.evidence.iter().zip(all).find(suspected);
        let untold = (self.untold_s >= UNTOLD_AFTER_S).then_some(Suspicion::Untold);
        if let Some(suspicion) = suspicion.map(|(_, suspicion)| suspicion).or(untold)
            && self.judges
        {
            self.suspicion.get_or_insert((suspicion, now));
        }
        self.look_for_explanation(now);
        self.look_for_delay(now);
    }

    /// Looks for added delay: late frames or commands look like a late base.
    fn look_for_delay(&mut self, now: MissionTime) {
        if self.suspicion.is_some() || !self.judges || now.since(self.looked) < LOOK_EVERY {
            return;
        }
        self.looked = now;
        let found = self.searched().or_else(|| self.fit.later(self.response));
        if let Some(found) = found {
            if self.known == Known::Unknown {
                self.known = Known::Found;
            }
            self.adopt(found);
            self.clear_evidence();
        }
    }

    /// Returns the response that driving reveals, if none is stated or the base stops later than
    /// stated.
    fn searched(&mut self) -> Option<Response> {
        if !self.searches {
            return None;
        }
        let believed = (self.known == Known::Stated).then_some(self.response);
        let found = self.fit.alike(believed, self.top_speed_m_s)?;
        let now_m = self.stops_within_m(self.response);
        if believed.is_some() {
            let contradicts = is_longer(found.stops_within_m, now_m);
            if contradicts {
                self.known = Known::Found;
            }
            return contradicts.then_some(found.slowest);
        }
        let change = self.stops_within_m(found.slowest) / now_m;
        let is_new = self.known == Known::Unknown || !UNCHANGED.contains(&change);
        (found.are_told_apart && is_new).then_some(found.slowest)
    }

    /// Ends a suspicion if a response explains the motion behind it.
    fn look_for_explanation(&mut self, now: MissionTime) {
        let Some((suspicion, since)) = self.suspicion else {
            return;
        };
        let channel = match suspicion {
            Suspicion::Left => 0,
            Suspicion::Right => 1,
            Suspicion::Turn | Suspicion::Untold => 2,
            Suspicion::Jumps => return,
        };
        if now.since(since) > JUDGED {
            return;
        }
        let suspected = Suspected { channel, from_s: since.seconds() - JUDGED.as_secs_f64() };
        if let Some(found) = self.fit.explain(self.response, suspected) {
            // A short interval tells less than the whole history, which the search uses.
            let is_news = self.known == Known::Stated
                || self.stops_within_m(found) > self.stops_within_m(self.response);
            if found != self.response && is_news {
                if self.searches && self.known == Known::Stated {
                    self.known = Known::Found;
                }
                self.adopt(found);
            }
            self.suspicion = None;
            self.clear_evidence();
        }
    }

    fn look_for_contact(&mut self, now: MissionTime) {
        let [left, right, _] = self.evidence.map(|evidence| evidence.held_s);
        if left.max(right) < HELD_AFTER_S {
            return;
        }
        let held = if self.axle.track_m.is_none() { [true; 2] } else { [left > 0.0, right > 0.0] };
        let [asked @ .., _] = self.evidence.map(|evidence| evidence.asked[1]);
        if self.contacts.begin(held, asked, now) {
            self.evidence.iter_mut().for_each(|evidence| evidence.held_s = 0.0);
        }
    }

    fn implausible(&mut self, now: MissionTime) {
        self.jumps.rotate_right(1);
        self.jumps[0] = Some(now);
        if self.jumps[MOST_JUMPS - 1].is_some_and(|first| now.since(first) <= JUMPS_WITHIN) {
            self.suspicion.get_or_insert((Suspicion::Jumps, now));
        }
    }

    fn reset(&mut self) {
        self.commanded = None;
        self.frame = None;
        self.shares.interrupt();
        self.clear_evidence();
        self.fit = ResponseFit::new(self.axle);
        self.contacts.reset();
        self.jumps = Default::default();
        self.recoveries = 0;
        self.suspicion = None;
    }

    fn clear_evidence(&mut self) {
        self.evidence = Default::default();
        self.untold_s = 0.0;
    }

    fn restart_evidence(&mut self, now: MissionTime) {
        for evidence in &mut self.evidence {
            evidence.since = now;
            evidence.still_s = 0.0;
            evidence.held_s = 0.0;
        }
    }
}

impl Monitor for Odometry {
    fn new(mission: &Mission) -> Self {
        let body = mission.body();
        let axle = Axle::from(&body);
        let response = mission.trusted_response();
        let has_scans = mission.robot.protocol().has_scans();
        Self {
            axle,
            response,
            searches: !mission.states_response() || has_scans && mission.brakes_by_response(),
            known: if mission.states_response() { Known::Stated } else { Known::Unknown },
            top_speed_m_s: body.top_speed_m_s,
            reached: ModelledWheels::new(axle, 0.0, &response),
            fit: ResponseFit::new(axle),
            shares: WheelShares::new(mission),
            found: None,
            longest_gap: Duration::from_secs_f64(2.0 / mission.robot.rate_hz),
            limit: Duration::from_secs_f64(mission.robot.command_limit_s),
            commanded: None,
            frame: None,
            evidence: Default::default(),
            untold_s: 0.0,
            contacts: Contacts::new(mission),
            jumps: Default::default(),
            recoveries: 0,
            suspicion: None,
            looked: MissionTime::default(),
            ordered_to_drive: false,
            judges: !mission.tests_wheels(),
            two_publishers: None,
        }
    }

    fn observe(&mut self, what: &Observation<'_>, now: Moment) {
        match *what {
            Observation::Directive(order, _) => self.ordered_to_drive = order == Order::Drive,
            Observation::Resumed => self.reset(),
            Observation::TwoPublishers(words) => {
                self.two_publishers = Some((words.to_owned(), now.time));
            }
            Observation::Commanded(counts) => self.commanded(counts, now.time),
            Observation::Currents(currents) => self.contacts.currents = currents,
            Observation::Motor(counts, Counts::Follow) => self.plausible(counts, now.time),
            Observation::Motor(_, Counts::Restarted { was_away: true }) => self.reset(),
            Observation::Motor(_, Counts::Implausible) => self.implausible(now.time),
            Observation::Motor(_, Counts::Restarted { .. } | Counts::Elsewhere) => {
                self.implausible(now.time);
                self.frame = None;
                self.shares.interrupt();
            }
            _ => {}
        }
    }

    fn condition(&self, cause: Cause, now: Moment) -> Condition {
        match (cause, self.suspicion, self.jumps[0]) {
            (Cause::WheelsHeld, ..) => self.contacts.condition(now.time),
            // The mission continues while the robot must not drive.
            (Cause::OdometryGivenUp, Some((_, since)), _) => {
                (self.ordered_to_drive && now.time.since(since) >= GIVEN_UP_AFTER).into()
            }
            (Cause::OdometryGivenUp, None, _) => false.into(),
            (_, Some(_), _) => Condition::Holds,
            (_, None, Some(jump)) => Condition::OverFor(now.time.since(jump)),
            (_, None, None) => false.into(),
        }
    }

    fn doubt(&self, doubts: &mut DoubtsSample) {
        [doubts.left_wheel, doubts.right_wheel, doubts.turn] = self
            .evidence
            .map(|it| (it.against_s / SUSPECTED_AFTER_S).max(it.still_s / STILL_AFTER_S));
        doubts.uncommanded = self.untold_s / UNTOLD_AFTER_S;
        doubts.jumps = self.jumps.iter().flatten().count() as f64 / MOST_JUMPS as f64;
    }

    fn explain(&self, cause: Cause, now: Moment) -> Option<String> {
        if cause == Cause::WheelsHeld {
            return self.contacts.explain();
        }
        let (suspicion, _) = self.suspicion?;
        if let Some((words, at)) = &self.two_publishers
            && now.time.since(*at) <= GIVEN_UP_AFTER
        {
            return Some(words.clone());
        }
        Some(suspicion.words().to_owned())
    }
}

#[cfg(test)]
mod slow_bases;
#[cfg(test)]
mod tests;
