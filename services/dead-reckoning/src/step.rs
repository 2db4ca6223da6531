//! Pose from counts of two wheels (20), or of a car's wheel and steering (3), corrected by fixes
//! and a gyro. The pose is an integral that nothing can recompute, so the checkpoint holds its
//! state.

use common::{
    bus::Topic,
    clock::MissionTime,
    driver::counts::WheelCounts,
    found_response::if_there,
    kinematics::{Drive, Pose2, Twist},
    mission::{Body, Mission},
    samples::{CountsSample, FixRefusal, PlaceSample, PoseSample, WheelSample},
    stage::{Answer, Answering, ForeignState},
    topics::{POSE, WHEELS},
    wire::{COUNT_CYCLE, counts_between},
    wiring::Persists,
};
use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{
    covariance::{self, ErrorModel},
    disagreement::{Cause, DOUBT, Disagreement},
    doubt::Doubt,
    filter::{Filter, Fix, History, Motions, Refused, wrapped},
    gyro::Gyro,
    relocation::{Contradictions, MOST_RELOCATIONS},
    sources::Sources,
    tick::Tick,
};

/// Bound on the encoded state, bytes: under 14,000 with 64 ticks and 64 fixes.
pub const STATE_BYTES: usize = 16_384;
/// Largest plausible multiple of a wheel's top speed; restarted counters mostly exceed it.
const PLAUSIBLE: f64 = 2.0;
/// Time added to the tick for that limit, seconds: timestamps jitter by about a tick.
const SLACK_S: f64 = 0.3;

/// Least share of a tick to compute a speed over; frames may come bunched.
const LEAST_SHARE_OF_A_TICK: f64 = 0.5;

/// Motion after the last command, seconds: delay and lag of the speed loop.
const COASTS_S: f64 = 0.2;

/// Least power cycle, seconds; a killed link is back in 0.1 s.
const BOOTS_IN_S: f64 = 2.0;

/// Largest correction per tick, metres and radians, so that the map around the robot does not tear.
const MOST_CORRECTION: (f64, f64) = (0.02, std::f64::consts::PI / 180.0);

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Follows the estimate smoothly.
    pose: Pose2,
    odometry: Pose2,
    history: History,
    travelled: f64,
    last: Option<Last>,
    gyro: Option<Gyro>,
    contradictions: Contradictions,
    relocations: u64,
    fixes: u64,
    fixes_refused: u64,
    refusal: u8,
    /// Unwrapped counts of a robot without a counter. Older recordings have none.
    #[serde(deserialize_with = "if_there")]
    counts: Option<CountsSample>,
    #[serde(deserialize_with = "if_there")]
    disagreement: Disagreement,
    #[serde(deserialize_with = "if_there")]
    doubt: Doubt,
    /// Newest place set by an operator.
    #[serde(deserialize_with = "if_there")]
    placed: u64,
}

impl State {
    pub fn newest(&self) -> Option<(u64, MissionTime)> {
        self.last.map(|last| (last.tick, last.time))
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Last {
    tick: u64,
    time: MissionTime,
    left: u16,
    right: u16,
    /// Link's generation, and restarts known to it.
    generation: u32,
    restarts: u32,
    v: f64,
    omega: f64,
}

#[derive(Debug, Default)]
pub struct Reckoned {
    pub pose: PoseSample,
    /// Whether the counts restarted or made an impossible jump. The pose stays, and its covariance
    /// grows by the possible motion.
    pub rejected: bool,
    /// Whether the pose moved to agreeing fixes that contradicted it.
    pub relocated: bool,
    pub placed: bool,
    /// Reason of a refusal; none if repeated.
    pub refused: Option<FixRefusal>,
    pub(crate) disagree: Option<Cause>,
    /// Doubt of the wheels, once.
    pub(crate) doubted: Option<String>,
}

/// Dead reckoning by (20) and (21).
#[derive(Debug)]
pub struct DeadReckoning {
    body: Body,
    wheel_scales: [f64; 2],
    distance_scale: f64,
    motions: Motions,
    period_s: f64,
    /// Longest motion after the last tick, seconds.
    turns_on_s: f64,
    state: State,
}

impl Answering for DeadReckoning {
    type State = State;
    type In = WheelSample;
    type Out = PoseSample;
    type Further = Sources;
    const NAME: &'static str = "dead-reckoning";
    const INPUT: &'static Topic<WheelSample> = &WHEELS;
    const OUTPUT: &'static Topic<PoseSample> = &POSE;
    const PERSISTS: Persists = Persists::State(STATE_BYTES);

    fn new(mission: &Mission) -> Self {
        let odometry = &mission.robot.odometry;
        let nominal = mission.body();
        let body = Body { track_m: nominal.track_m * odometry.track_scale, ..nominal };
        let start = mission.start_pose();
        let errors = ErrorModel::new(odometry, &body);
        let period_s = 1.0 / mission.robot.rate_hz;
        Self {
            body,
            wheel_scales: odometry.wheel_scales(),
            distance_scale: odometry.distance_scale,
            motions: Motions { errors, integration: mission.dead_reckoning.integration },
            period_s,
            turns_on_s: period_s + mission.robot.command_limit_s + COASTS_S,
            state: State {
                pose: start,
                odometry: start,
                history: History::new(Filter::new(start, errors.start())),
                ..State::default()
            },
        }
    }

    fn state(&self) -> &State {
        &self.state
    }

    fn restore(&mut self, state: State) -> Result<(), ForeignState> {
        self.state = state;
        Ok(())
    }

    fn has_answered(&self, wheels: &WheelSample) -> bool {
        self.state.newest().is_some_and(|(tick, _)| tick == wheels.stamp.tick)
    }

    fn answer(
        &mut self,
        wheels: &WheelSample,
        sources: &Sources,
        now: MissionTime,
    ) -> Answer<PoseSample> {
        let first = self.state.newest().is_none();
        let Reckoned { pose, rejected, relocated, placed, refused, disagree, doubted } =
            self.reckon(wheels, sources, now);
        let warning = match (disagree, refused) {
            (Some(cause), _) => Some(cause.words().into()),
            _ if doubted.is_some() => doubted.map(Into::into),
            _ if placed => Some("an operator set the pose".into()),
            _ if rejected => {
                Some("the encoder counts restarted or jumped; the pose stays unchanged".into())
            }
            _ if relocated => {
                Some("consistent fixes contradict the pose; the pose moves to them".into())
            }
            (None, refused) => refused.map(|why| why.words().into()),
        };
        Answer { sample: pose, saves_first: first || rejected || relocated || placed, warning }
    }
}

impl DeadReckoning {
    /// Integrates up to a wheel sample. A repeated tick gives the same pose.
    pub fn reckon(
        &mut self,
        wheels: &WheelSample,
        Sources { fixes, turns, counts, place }: &Sources,
        now: MissionTime,
    ) -> Reckoned {
        let mut motion = Twist::default();
        let mut rejected = false;
        let mut elapsed = 0.0;
        let mut tick = Tick { time: now, ..Tick::default() };
        let is_its = |counts: &&CountsSample| counts.stamp.tick == wheels.stamp.tick;
        let endless = counts.iter().rfind(is_its);
        let counts = WheelCounts::of(wheels, endless);
        if let Some(last) = self.state.last {
            if last.tick == wheels.stamp.tick {
                return Reckoned { pose: self.sample(), ..Reckoned::default() };
            }
            elapsed = now.since(last.time).as_secs_f64();
            let counted = self.moved(last, counts, wheels, elapsed);
            rejected = counted.is_none();
            let Twist { v: arc, omega: turn } = counted.unwrap_or_default();
            assert!(elapsed >= 0.0);
            let lost_m = if rejected { self.lost_m(last, counts, wheels, elapsed) } else { 0.0 };
            tick = Tick { seconds: elapsed, arc, turn, lost_m, ..tick };
            motion = self.state.history.newest.moved(&self.motions, &tick);
        }
        let state = &mut self.state;
        for pose in [&mut state.pose, &mut state.odometry] {
            *pose = self.motions.along(*pose, motion);
        }
        state.travelled += motion.v.abs();
        let rim_m = motion.v.abs() + motion.omega.abs() * self.body.track_m / 2.0;
        let doubted = state.doubt.roll(wheels, rim_m, self.body.track_m);
        state.history.advance(&self.motions, tick);
        state.history.turn(&self.motions, &mut state.gyro, turns);
        let contradict = state.doubt.compare(&self.motions.errors, state.history.ticks.iter());
        let doubted = doubted.or(contradict);
        let place = place.filter(|place| place.number > self.state.placed);
        if let Some(place) = &place {
            self.place(place);
        }
        let mut relocated = false;
        let mut by_scan = false;
        let mut refused = None;
        let mut disagree = None;
        for sample in fixes {
            let fix = Fix::try_from(sample);
            let taken = self.take_fix(fix);
            by_scan |= taken == Taken::UsedScan;
            if let Ok(fix) = fix {
                let State { disagreement, history, .. } = &mut self.state;
                let found = disagreement.compare(&fix, &history.ticks, self.body.track_m);
                disagree = found.or(disagree);
            }
            relocated |= taken == Taken::Relocated;
            let why = match taken {
                Taken::Refused(why) => why,
                Taken::Used | Taken::UsedScan | Taken::Relocated => FixRefusal::None,
            };
            let new = why != FixRefusal::None && u8::from(why) != self.state.refusal;
            refused = if new { Some(why) } else { refused };
            self.state.refusal = why.into();
        }
        let placed = place.is_some();
        // Matches show the surfaces that the map shows, so following them at once tears nothing.
        self.follow(relocated || placed || by_scan);
        let Twist { v, omega } = self.speeds(motion, elapsed);
        self.state.counts = endless.copied();
        self.state.last = Some(Last {
            tick: wheels.stamp.tick,
            time: now,
            left: wheels.left_counts,
            right: wheels.right_counts,
            generation: wheels.stamp.generation,
            restarts: wheels.restarts,
            v,
            omega,
        });
        Reckoned { pose: self.sample(), rejected, relocated, placed, refused, disagree, doubted }
    }

    /// Sets the estimate as an operator says; wheel and gyro errors stay.
    fn place(&mut self, place: &PlaceSample) {
        let state = &mut self.state;
        let estimate = &state.history.newest;
        let turn = wrapped(place.heading_rad - estimate.pose.heading);
        let position = DVec2::new(place.x_m, place.y_m);
        let pose = Pose2 { position, heading: estimate.pose.heading + turn };
        let [along, turned] = [place.sigma_m, place.sigma_rad].map(|sigma| sigma * sigma);
        assert!(place.number > state.placed);
        state.history.restart(estimate.moved_to(pose, along, turned));
        state.contradictions = Contradictions::default();
        state.doubt.place();
        state.placed = place.number;
    }

    pub(crate) fn place_of(mission: &Mission, state: State) -> PlaceSample {
        let reckoning = Self { state, ..Answering::new(mission) };
        let PoseSample { x_m, y_m, heading_rad, covariance: [xx, _, _, yy, _, tt], .. } =
            reckoning.sample();
        PlaceSample {
            number: 1,
            x_m,
            y_m,
            heading_rad,
            sigma_m: f64::midpoint(xx, yy).sqrt(),
            sigma_rad: tt.sqrt(),
            ..PlaceSample::default()
        }
    }

    fn take_fix(&mut self, fix: Result<Fix, FixRefusal>) -> Taken {
        let state = &mut self.state;
        let taken = fix.map_err(|why| Refused { why, there: None });
        let taken = taken.and_then(|fix| state.history.take(&self.motions, fix).map(|()| fix));
        let Refused { why, there } = match taken {
            Ok(used) => {
                state.fixes += 1;
                state.contradictions.settle(&used);
                if !used.is_by_scan() || used.is_apart_from_wheels() {
                    state.doubt.place_by_others();
                }
                return if used.is_by_scan() { Taken::UsedScan } else { Taken::Used };
            }
            Err(refused) => refused,
        };
        state.fixes_refused += 1;
        let estimate = &state.history.newest;
        if let (Ok(fix), Some(there)) = (fix, there)
            && let Some(elsewhere) = state.contradictions.add(there, &fix, estimate)
        {
            if state.relocations >= MOST_RELOCATIONS {
                return Taken::Refused(FixRefusal::Contradicts);
            }
            let from = estimate.pose;
            let to = elsewhere.pose;
            state.doubt.relocate(to.position - from.position, wrapped(to.heading - from.heading));
            state.history.restart(elsewhere);
            state.relocations += 1;
            return Taken::Relocated;
        }
        Taken::Refused(why)
    }

    /// Moves the pose towards the estimate, fully if `relocated`.
    fn follow(&mut self, relocated: bool) {
        let estimate = self.state.history.newest.pose;
        let pose = &mut self.state.pose;
        let way = estimate.position - pose.position;
        let turn = estimate.heading - pose.heading;
        let (most_m, most_rad) = MOST_CORRECTION;
        pose.position = if relocated || way.length() <= most_m {
            estimate.position
        } else {
            pose.position + way.clamp_length_max(most_m)
        };
        pose.heading = if relocated || turn.abs() <= most_rad {
            estimate.heading
        } else {
            pose.heading + turn.clamp(-most_rad, most_rad)
        };
    }

    /// Returns the longest way behind counts that are left out. The step may be motion whose frames
    /// came late, all at once.
    fn lost_m(&self, last: Last, counts: WheelCounts, wheels: &WheelSample, elapsed: f64) -> f64 {
        let [left, right] = counts.since(self.counts_at(last));
        let step_m = left.abs().max(right.abs()) * self.body.metres_per_count();
        // Without ticks there are no commands, so the wheels of most robots soon rest.
        let kept_on = self.is_ambiguous(last, counts, wheels, elapsed);
        let turned_s = if kept_on { elapsed } else { self.turns_on_s };
        let [possible_m, most_m] = [elapsed, turned_s].map(|s| self.body.top_speed_m_s * s);
        step_m.max(possible_m).min(most_m)
    }

    /// Returns whether counters may have wrapped: the robot still turns its wheels, so it may have
    /// kept its speed.
    fn is_ambiguous(
        &self,
        last: Last,
        counts: WheelCounts,
        wheels: &WheelSample,
        elapsed: f64,
    ) -> bool {
        let [left, right] = [wheels.left_counts_per_s, wheels.right_counts_per_s];
        let now = f64::from(left.unsigned_abs().max(right.unsigned_abs()));
        let before_m_s = last.v.abs() + last.omega.abs() * self.body.track_m / 2.0;
        let fastest = now.max(before_m_s / self.body.metres_per_count());
        let is_cyclic = matches!(counts, WheelCounts::Cyclic(_));
        is_cyclic && now > 0.0 && fastest * elapsed >= f64::from(COUNT_CYCLE / 2)
    }

    fn counts_at(&self, last: Last) -> WheelCounts {
        self.state.counts.map_or(WheelCounts::Cyclic([last.left, last.right]), |it| {
            WheelCounts::Endless([it.left_counts, it.right_counts])
        })
    }

    /// Returns metres and radians; none if wheels cannot turn so.
    fn moved(
        &self,
        last: Last,
        counts: WheelCounts,
        wheels: &WheelSample,
        elapsed: f64,
    ) -> Option<Twist> {
        let before = self.counts_at(last);
        let [left, right] = counts.since(before);
        let per_count = std::f64::consts::TAU / self.body.counts_per_turn;
        let top = self.body.top_speed_m_s / self.body.metres_per_count();
        let limit = top * PLAUSIBLE * (elapsed + SLACK_S);
        assert!(limit > 0.0);
        // The link reports restarts within its generation; only between two links must the counts
        // show one. A robot that turned back through its start gives the same counts, but sooner.
        let restarted = if last.generation == wheels.stamp.generation {
            last.restarts != wheels.restarts
        } else {
            elapsed >= BOOTS_IN_S && counts.restarted_since(before)
        };
        if left.abs().max(right.abs()) > limit
            || restarted
            || self.is_ambiguous(last, counts, wheels, elapsed)
        {
            return None;
        }
        // (20) is linear: wheel angles give arc and turn as wheel speeds give v and omega.
        let wheel = left * per_count;
        Some(match self.body.drive() {
            Drive::Differential(drive) => {
                let [left_scale, right_scale] = self.wheel_scales;
                drive.twist([wheel * left_scale, right * per_count * right_scale])
            }
            Drive::Ackermann(drive) => {
                // The mean angle stands for the steering in between.
                let middle = f64::from(counts_between(0, last.right)) + right / 2.0;
                let angle = self.body.steering.map(|steering| steering.angle(middle));
                drive.twist([wheel * self.distance_scale, angle.unwrap_or_default()])
            }
        })
    }

    /// Returns m/s and rad/s, limited along the same curve.
    fn speeds(&self, moved: Twist, elapsed: f64) -> Twist {
        let time = elapsed.max(LEAST_SHARE_OF_A_TICK * self.period_s);
        assert!(time > 0.0);
        let v = moved.v / time;
        let omega = moved.omega / time;
        let wheel = match self.body.steering {
            Some(_) => v.abs(),
            None => v.abs() + omega.abs() * self.body.track_m / 2.0,
        };
        let share = (self.body.top_speed_m_s / wheel).min(1.0);
        assert!((0.0..=1.0).contains(&share));
        Twist { v: v * share, omega: omega * share }
    }

    fn sample(&self) -> PoseSample {
        let State { pose, odometry, history, last, .. } = &self.state;
        let Pose2 { position, heading } = *pose;
        let Last { left, right, v, omega, .. } = last.unwrap_or_default();
        let estimate = &history.newest;
        // The error is the estimate's, plus the offset to it.
        let [x, y] = (estimate.pose.position - position).to_array();
        let turn = estimate.pose.heading - heading;
        let way = [x * x, x * y, x * turn, y * y, y * turn, turn * turn];
        let mut covariance = covariance::of_pose(&estimate.covariance);
        covariance.iter_mut().zip(way).for_each(|(entry, more)| *entry += more);
        let [mut place, mut heading_doubt] = self.state.doubt.variances(self.body.track_m);
        if self.state.disagreement.is_named() {
            place += DOUBT[0];
            heading_doubt += DOUBT[1];
        }
        covariance[0] += place;
        covariance[3] += place;
        covariance[5] += heading_doubt;
        let turned = heading - odometry.heading;
        let origin = position - DVec2::from_angle(turned).rotate(odometry.position);
        PoseSample {
            x_m: position.x,
            y_m: position.y,
            heading_rad: heading,
            v_m_s: v,
            omega_rad_s: omega,
            travelled_m: self.state.travelled,
            covariance,
            left_counts: left,
            right_counts: right,
            map_from_odom: [origin.x, origin.y, turned],
            relocations: self.state.relocations + self.state.placed,
            fixes: self.state.fixes,
            fixes_refused: self.state.fixes_refused,
            refusal: self.state.refusal,
            ..PoseSample::default()
        }
    }
}

#[derive(PartialEq)]
enum Taken {
    Used,
    /// A scan matcher's fix.
    UsedScan,
    Refused(FixRefusal),
    Relocated,
}

#[cfg(test)]
mod source_tests;
#[cfg(test)]
mod tests;
