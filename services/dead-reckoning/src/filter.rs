//! Error-state filter of pose, wheel errors and gyro bias, from wheels, fixes and gyro.
//!
//! [`Filter`] is the estimate at one tick. [`History`] holds the estimate of 2 s ago, and ticks and
//! fixes since. A late fix applies at its own time: the estimate is recomputed from there.

use std::{collections::VecDeque, f64::consts::TAU, fmt, time::Duration};

use common::{
    clock::MissionTime,
    geometry::symmetric,
    kinematics::{Pose2, Twist},
    mission::Integration,
    samples::{FixRefusal, FixSample, TurnSample},
};
use glam::DVec2;
use nalgebra::{Const, DimMin, SMatrix, SVector};
use serde::{Deserialize, Serialize};

use crate::{
    covariance::{BIAS, Error, ErrorModel, Matrix, PARTS, Transition, upper},
    gyro::Gyro,
    tick::Tick,
};

/// Age limit of fixes.
const OLDEST: Duration = Duration::from_secs(2);
/// At a high rate they span less than [`OLDEST`].
const MOST_TICKS: usize = 64;
const MOST_FIXES: usize = 64;
/// Squared Mahalanobis distances beyond which fixes are refused: one good one in a thousand, for 2
/// and 3 degrees of freedom.
pub(crate) const GATES: [f64; 2] = [13.8, 16.3];
/// Least variances of x, y and heading, m^2 and rad^2: 5 mm and a tenth of a degree.
const LEAST_VARIANCES: [f64; 3] = [25e-6, 25e-6, 3e-6];
/// Deviations, metres and radians, above which a scan matcher's fix may lean on the wheels. The
/// matcher holds its match at their pose with these, and overstates the match's own uncertainty
/// several times.
const LEANS: [f64; 2] = [0.1, 0.05];
/// Steps that widen the pose until a contradicting match fits: the pushed or slipping robot moved
/// unseen by its wheels. Each step adds [`LEAST_VARIANCES`] times a power of this factor, up to
/// 0.2 m and 4 degrees; at the gate that is the 0.5 m within which the matcher searches.
const WIDENS: f64 = 4.0;
const MOST_WIDENINGS: i32 = 5;
/// Gyro scale error, a share.
pub(crate) const GYRO_SCALE: f64 = 0.005;

const JOINT: usize = PARTS + 1;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Motions {
    pub errors: ErrorModel,
    pub integration: Integration,
}

impl Motions {
    pub(crate) fn along(&self, pose: Pose2, moved: Twist) -> Pose2 {
        match self.integration {
            Integration::Arc => pose.along_arc(moved.v, moved.omega),
            Integration::Euler => pose.along_euler(moved.v, moved.omega),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Fix {
    pub time: MissionTime,
    pub position: DVec2,
    pub heading: Option<f64>,
    pub covariance: [f64; 6],
    /// Variances shared by all fixes of the source: of x and of y, and of the heading.
    pub shared: [f64; 2],
}

impl TryFrom<&FixSample> for Fix {
    type Error = FixRefusal;

    fn try_from(sample: &FixSample) -> Result<Self, FixRefusal> {
        let FixSample { capture_ns, x_m, y_m, heading_rad, covariance, shared, .. } = *sample;
        let heading = (!heading_rad.is_nan()).then_some(heading_rad);
        let [xx, xy, xt, yy, yt, tt] = covariance;
        let numbers = [x_m, y_m, xx, xy, yy].into_iter().chain(shared);
        if !numbers.chain(heading.into_iter().flat_map(|it| [it, xt, yt, tt])).all(f64::is_finite) {
            return Err(FixRefusal::NotFinite);
        }
        let fix = Self {
            time: MissionTime(capture_ns),
            position: DVec2::new(x_m, y_m),
            heading,
            covariance: if heading.is_some() { covariance } else { [xx, xy, 0.0, yy, 0.0, 0.0] },
            shared: if heading.is_some() { shared } else { [shared[0], 0.0] },
        };
        // Positive: slightly less than the least eigenvalue is subtracted from the diagonal.
        let least = SVector::from(LEAST_VARIANCES);
        let spare = fix.noise() - SMatrix::from_diagonal(&(least * (1.0 - 1e-9)));
        let positive = match heading {
            Some(_) => spare.cholesky().is_some(),
            None => spare.fixed_view::<2, 2>(0, 0).into_owned().cholesky().is_some(),
        };
        assert!(!positive || fix.variance() > 0.0);
        assert!(fix.heading.is_some() || fix.covariance[5] == 0.0);
        if positive { Ok(fix) } else { Err(FixRefusal::Covariance) }
    }
}

impl Fix {
    fn laid(&self, frame: Pose2) -> Self {
        let turned = DVec2::from_angle(frame.heading);
        let DVec2 { x: cos, y: sin } = turned;
        let turn = SMatrix::<f64, 3, 3>::from([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]]);
        Self {
            position: frame.position + turned.rotate(self.position),
            heading: self.heading.map(|heading| heading + frame.heading),
            covariance: upper(turn * self.noise() * turn.transpose()),
            ..*self
        }
    }

    fn noise(&self) -> SMatrix<f64, 3, 3> {
        SMatrix::from(symmetric(self.covariance))
    }

    fn shares(&self) -> [f64; 3] {
        let [place, heading] = self.shared;
        [place, place, heading]
    }

    /// Returns whether a scan matcher gave the fix: no other kind shares a heading error.
    pub(crate) fn is_by_scan(&self) -> bool {
        self.shared[1] > 0.0
    }

    pub(crate) fn variance(&self) -> f64 {
        0.5 * (self.covariance[0] + self.covariance[3])
    }

    /// Returns whether a scan matcher's fix, the only kind with a shared heading error, locates the
    /// robot without the wheels.
    ///
    /// The matcher stays at the wheels' pose if a scan shows too little, and its unshared variance
    /// says so.
    pub(crate) fn is_apart_from_wheels(&self) -> bool {
        let [place, heading] = self.shared;
        let own = [2.0 * (self.variance() - place), self.covariance[5] - heading];
        own.iter().zip(LEANS).all(|(own, leans)| *own <= leans * leans)
    }
}

/// Wraps an angle to -pi..pi.
pub(crate) fn wrapped(turn: f64) -> f64 {
    turn - (turn / TAU).round() * TAU
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Filter {
    pub pose: Pose2,
    /// Errors of diameter ratio, track and distance.
    shares: [f64; 3],
    bias: f64,
    pub covariance: Matrix,
    anchor: Anchor,
}

/// Knowledge by a source other than the scan matcher: variances of x, y and heading after its
/// newest fix, and those that the matcher's fixes shared then. Later growth of the latter is drift.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Anchor {
    variances: Option<[f64; 3]>,
    shared: [f64; 3],
    /// Shared variances of the matcher's newest fix.
    newest: [f64; 3],
    /// Matcher's frame in the estimate's, which takes such corrections of the pose. Otherwise the
    /// matcher, which holds its old pose, would undo them.
    frame: Pose2,
}

impl Anchor {
    fn drift(&self, shared: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|part| (shared[part] - self.shared[part]).max(0.0))
    }

    /// Returns the least variances after `fix`, which corrected the estimate at `pose` by `error`.
    fn floor(&mut self, fix: &Fix, pose: Pose2, error: &Error, variances: [f64; 3]) -> [f64; 3] {
        let shared = fix.shares();
        if shared == [0.0; 3] {
            // Successive fixes only repeat what the matcher holds.
            let [xx, _, _, yy, _, tt] = fix.covariance;
            let own = [xx, yy, tt];
            let known = [0, 1, 2].map(|part| own[part].max(variances[part]));
            self.variances = Some(known);
            self.shared = self.newest;
            let arm = DVec2::from_angle(error[2]).rotate(self.frame.position - pose.position);
            self.frame.position = pose.position + DVec2::new(error[0], error[1]) + arm;
            self.frame.heading += error[2];
            return shared;
        }
        self.newest = shared;
        let Some(known) = self.variances else { return shared };
        let drift = self.drift(shared);
        [0, 1, 2].map(|part| shared[part].min(known[part] + drift[part]))
    }
}

impl Filter {
    pub(crate) fn new(pose: Pose2, covariance: Matrix) -> Self {
        Self { pose, covariance, ..Self::default() }
    }

    pub(crate) fn moved(&self, motions: &Motions, tick: &Tick) -> Twist {
        motions.errors.corrected(tick.moved(), self.shares)
    }

    fn advance(&mut self, motions: &Motions, tick: &Tick) {
        let moved = self.moved(motions, tick);
        let Transition { carried, noise } =
            motions.errors.transition(self.pose, moved, tick.seconds);
        let mut noise = noise + motions.errors.lost(tick.lost_m);
        if tick.gyro.is_some() {
            noise[(2, 2)] += motions.errors.counted(tick.moved());
        }
        let before = self.covariance;
        self.pose = motions.along(self.pose, moved);
        self.covariance = carried * before * carried.transpose() + noise;
        if let Some(gyro) = tick.gyro {
            // A gyro measures a difference of headings, so the earlier one joins the error.
            let mut both = SMatrix::<f64, JOINT, PARTS>::zeros();
            both.fixed_view_mut::<PARTS, PARTS>(0, 0).copy_from(&carried);
            both[(PARTS, 2)] = 1.0;
            let mut joint = both * before * both.transpose();
            let mut own = joint.fixed_view_mut::<PARTS, PARTS>(0, 0);
            own += noise;
            let mut seen = SMatrix::<f64, 1, JOINT>::zeros();
            seen[2] = 1.0;
            seen[BIAS] = tick.seconds;
            seen[PARTS] = -1.0;
            let expected = moved.omega + self.bias * tick.seconds;
            let scale = GYRO_SCALE * gyro.turn;
            let variance = SMatrix::from([gyro.variance + scale * scale]);
            let residual = SVector::from([gyro.turn - expected]);
            if let Some((error, joint)) = update(&joint, &seen, residual, variance, f64::INFINITY) {
                self.correct(&error.fixed_rows::<PARTS>(0).into_owned());
                self.covariance = joint.fixed_view::<PARTS, PARTS>(0, 0).into_owned();
            }
        }
    }

    fn at(&self, motions: &Motions, tick: &Tick, fix: &Fix) -> Pose2 {
        let ago = tick.time.0 as f64 - fix.time.0 as f64;
        let share = if tick.seconds > 0.0 { ago * 1e-9 / tick.seconds } else { 0.0 };
        let share = share.clamp(-1.0, 1.0);
        let moved = self.moved(motions, tick);
        self.pose.along_arc(-moved.v * share, -moved.omega * share)
    }

    fn take(&mut self, fix: &Fix, there: Pose2) -> bool {
        let is_laid = self.anchor.variances.is_some() && fix.is_by_scan();
        let laid = if is_laid { fix.laid(self.anchor.frame) } else { *fix };
        let taken = self.updated(&laid, there);
        if let Some((error, mut covariance)) = taken {
            let variances = [0, 1, 2].map(|part| covariance[(part, part)]);
            let floor = self.anchor.floor(fix, self.pose, &error, variances);
            self.correct(&error);
            for (part, least) in floor.into_iter().enumerate() {
                // More on the diagonal keeps the matrix positive.
                covariance[(part, part)] = covariance[(part, part)].max(least);
            }
            self.covariance = covariance;
        }
        taken.is_some()
    }

    fn updated(&self, fix: &Fix, there: Pose2) -> Option<(Error, Matrix)> {
        let lever = self.pose.position - there.position;
        let mut seen = SMatrix::<f64, 3, PARTS>::identity();
        seen[(0, 2)] = lever.y;
        seen[(1, 2)] = -lever.x;
        let [x, y] = (fix.position - there.position).to_array();
        let mut covariance = self.covariance;
        let noise = fix.noise();
        match fix.heading {
            Some(heading) => {
                let residual = SVector::from([x, y, wrapped(heading - there.heading)]);
                let widenings = if fix.is_by_scan() { MOST_WIDENINGS } else { 0 };
                (0..=widenings).find_map(|step| {
                    if step > 0 {
                        for (part, least) in LEAST_VARIANCES.into_iter().enumerate() {
                            covariance[(part, part)] += least * WIDENS.powi(step);
                        }
                    }
                    update(&covariance, &seen, residual, noise, GATES[1])
                })
            }
            None => {
                let noise = noise.fixed_view::<2, 2>(0, 0).into_owned();
                let seen = seen.fixed_rows::<2>(0).into_owned();
                update(&covariance, &seen, SVector::from([x, y]), noise, GATES[0])
            }
        }
    }

    fn correct(&mut self, error: &Error) {
        self.pose.position += DVec2::new(error[0], error[1]);
        self.pose.heading += error[2];
        const { assert!(BIAS == 3 + 3 && PARTS == BIAS + 1) };
        for (share, error) in self.shares.iter_mut().zip(&error.as_slice()[3..]) {
            *share += error;
        }
        self.bias += error[BIAS];
    }

    /// Moves the estimate to `pose` with these variances, for a restarted matcher. Wheel and gyro
    /// errors stay.
    pub(crate) fn moved_to(mut self, pose: Pose2, position: f64, heading: f64) -> Self {
        let covariance = &mut self.covariance;
        for (part, variance) in [position, position, heading].into_iter().enumerate() {
            covariance.row_mut(part).fill(0.0);
            covariance.column_mut(part).fill(0.0);
            covariance[(part, part)] = variance;
        }
        Self { pose, anchor: Anchor::default(), ..self }
    }
}

/// Computes a Kalman update in Joseph's form: correction and covariance. None if `residual` of the
/// part `seen` exceeds `gate`.
fn update<const N: usize, const M: usize>(
    covariance: &SMatrix<f64, N, N>,
    seen: &SMatrix<f64, M, N>,
    residual: SVector<f64, M>,
    noise: SMatrix<f64, M, M>,
    gate: f64,
) -> Option<(SVector<f64, N>, SMatrix<f64, N, N>)>
where
    Const<M>: DimMin<Const<M>, Output = Const<M>>,
{
    let spread = seen * covariance * seen.transpose() + noise;
    let inverse = spread.cholesky()?.inverse();
    if (residual.transpose() * inverse * residual)[0] > gate {
        return None;
    }
    let gain = covariance * seen.transpose() * inverse;
    let rest = SMatrix::<f64, N, N>::identity() - gain * seen;
    let after = rest * covariance * rest.transpose() + gain * noise * gain.transpose();
    Some((gain * residual, (after + after.transpose()) * 0.5))
}

#[derive(Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct History {
    /// Estimate before `ticks`.
    base: Filter,
    pub ticks: VecDeque<Tick>,
    /// Used fixes, by their ticks' times.
    fixes: VecDeque<(MissionTime, Fix)>,
    pub newest: Filter,
}

impl fmt::Debug for History {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut shown = f.debug_struct("History");
        shown.field("pose", &self.newest.pose);
        shown.field("ticks", &self.ticks.len()).field("fixes", &self.fixes.len());
        shown.finish_non_exhaustive()
    }
}

impl History {
    pub(crate) fn new(start: Filter) -> Self {
        Self { base: start, newest: start, ..Self::default() }
    }

    pub(crate) fn restart(&mut self, estimate: Filter) {
        let last = self.ticks.back().map(|tick| Tick { time: tick.time, ..Tick::default() });
        *self = Self::new(estimate);
        self.ticks.extend(last);
    }

    pub(crate) fn advance(&mut self, motions: &Motions, tick: Tick) {
        self.ticks.push_back(tick);
        self.newest.advance(motions, &tick);
        let too_old = |oldest: &Tick| tick.time.since(oldest.time) > OLDEST;
        while self.ticks.len() > MOST_TICKS || self.ticks.front().is_some_and(too_old) {
            let Some(oldest) = self.ticks.pop_front() else { break };
            self.base.advance(motions, &oldest);
            while let Some((_, fix)) = self.fixes.pop_front_if(|(at, _)| *at <= oldest.time) {
                self.base.take(&fix, self.base.at(motions, &oldest, &fix));
            }
        }
        assert!(self.ticks.len() <= MOST_TICKS);
    }

    pub(crate) fn turn(
        &mut self,
        motions: &Motions,
        gyro: &mut Option<Gyro>,
        increments: &[TurnSample],
    ) {
        let mut changed = false;
        for increment in increments {
            changed |= Gyro::take(gyro, increment, &mut self.ticks);
        }
        if changed {
            self.newest = self.again(motions, |_, _, _| Ok(())).unwrap_or(self.newest);
        }
    }

    fn again(
        &self,
        motions: &Motions,
        mut at: impl FnMut(usize, &Tick, &mut Filter) -> Result<(), Refused>,
    ) -> Result<Filter, Refused> {
        let mut estimate = self.base;
        let mut fixes = self.fixes.iter().peekable();
        for (place, tick) in self.ticks.iter().enumerate() {
            estimate.advance(motions, tick);
            while let Some((_, fix)) = fixes.next_if(|(at, _)| *at <= tick.time) {
                let there = estimate.at(motions, tick, fix);
                // Leaves out a used fix that contradicts others.
                estimate.take(fix, there);
            }
            at(place, tick, &mut estimate)?;
        }
        Ok(estimate)
    }

    /// Takes a fix, or refuses it; if too far off, with the pose at its time.
    pub(crate) fn take(&mut self, motions: &Motions, fix: Fix) -> Result<(), Refused> {
        let not = |why| Err(Refused { why, there: None });
        let (Some(first), Some(last)) = (self.ticks.front(), self.ticks.back()) else {
            return not(FixRefusal::Late);
        };
        let first_s = first.time.seconds() - first.seconds;
        if last.time.since(fix.time) > OLDEST || fix.time.seconds() < first_s {
            return not(FixRefusal::Late);
        }
        if fix.time.seconds() > last.time.seconds() + last.seconds {
            return not(FixRefusal::Future);
        }
        if self.fixes.len() >= MOST_FIXES {
            return not(FixRefusal::TooMany);
        }
        let later = self.ticks.iter().position(|tick| tick.time >= fix.time);
        let at = later.unwrap_or(self.ticks.len() - 1);
        self.newest = self.again(motions, |place, tick, estimate| {
            let there = estimate.at(motions, tick, &fix);
            if place != at || estimate.take(&fix, there) {
                Ok(())
            } else {
                Err(Refused { why: FixRefusal::Far, there: Some(there) })
            }
        })?;
        let at = self.ticks[at].time;
        let place = self.fixes.partition_point(|(used, _)| *used <= at);
        self.fixes.insert(place, (at, fix));
        assert!(self.fixes.len() <= MOST_FIXES);
        Ok(())
    }
}

/// Has the pose at the time of the fix, if the fix contradicts it.
#[derive(Clone, Copy)]
pub(crate) struct Refused {
    pub why: FixRefusal,
    pub there: Option<Pose2>,
}
