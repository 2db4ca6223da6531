//! Summary of a run: outcome and numbers, from the ground truth and a [`Hearer`]'s samples.

mod hearer;
mod totals;
mod trails;

use std::{collections::BTreeMap, fmt};

use common::{
    ground_truth::GroundTruthTick, latency::Histogram, mission::Mission, samples::PoseSample,
};
use serde::{Deserialize, Serialize};

pub use self::{hearer::Hearer, trails::Trail};

use mission_control::{
    Finished,
    outcome::Outcome,
    target_list::{TargetOutcome, TargetResult},
};

/// Quantiles of a duration, microseconds; `None` without measurements.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Quantiles {
    pub p50: Option<f64>,
    pub p99: Option<f64>,
    pub max: Option<f64>,
}

impl From<&Histogram> for Quantiles {
    fn from(histogram: &Histogram) -> Self {
        Self {
            p50: histogram.quantile_us(0.5),
            p99: histogram.quantile_us(0.99),
            max: histogram.quantile_us(1.0),
        }
    }
}

/// Last line of `run --json`. Distances are in metres. Unknown values, such as a real robot's
/// ground truth, are `None` (null).
#[derive(Debug, Default, Serialize, Deserialize)]
pub struct Summary {
    pub outcome: Outcome,
    pub reason: String,
    /// Failsafe-table row that ended the mission (`firsthand table failsafe`).
    pub cause: Option<String>,
    /// Robot time from the first motion order to the end, including lost links.
    pub mission_time_s: f64,
    pub path_length_m: f64,
    pub straight_m: f64,
    pub min_clearance_m: Option<f64>,
    /// Share of the time with the body's surface within [`SAFE_M`] of an obstacle: p_o of MRPB (J.
    /// Wen et al., ICRA 2021), (2).
    pub p_o: Option<f64>,
    /// Sum of the squared displacement changes between ticks: f_ps of MRPB, (5). Depends on the
    /// tick rate.
    pub f_ps_m2: Option<f64>,
    /// Mean |dv/dt|: f_vs of MRPB, (6).
    pub f_vs_m_s2: Option<f64>,
    pub collisions: Option<u64>,
    /// Rim speed of the faster wheel in the tick before the first contact, m/s; 0 if a robot at
    /// rest was hit.
    #[serde(default)]
    pub contact_speed_m_s: Option<f64>,
    pub pose_error_m: Option<f64>,
    /// RMS pose error by the covariance of the last pose.
    pub pose_error_expected_m: Option<f64>,
    /// Two standard deviations of that position along the worst axis. An arrival is sure within
    /// `sure_within_m`.
    #[serde(default)]
    pub pose_within_m: Option<f64>,
    pub true_distance_m: Option<f64>,
    /// True time at which the robot had moved 0.1 m.
    pub departed_s: Option<f64>,
    /// Longest time that a wheel turned after the last received command.
    pub stopping_time_s: Option<f64>,
    pub safety_events: u64,
    pub full_solves: u64,
    pub looks: u64,
    pub look_s: f64,
    /// Share of ticks without a front sonar distance, by the ground truth.
    pub sonar_unavailable_share: Option<f64>,
    /// Range of both wheels' commanded speeds, rad/s, under the last supervisor.
    pub wheel_range_rad_s: Option<f64>,
    pub ticks: u64,
    pub restarts: BTreeMap<String, u32>,
    /// Stops, or slow-downs to half speed, of a moving robot by failsafe cause, under the last
    /// supervisor.
    #[serde(default)]
    pub stops: BTreeMap<String, u32>,
    #[serde(default)]
    pub slowed: BTreeMap<String, u32>,
    /// Resumes of the run. Clearance, solves and latencies are then those of the last part, and the
    /// path is the believed one.
    pub resumes: u32,
    /// Generations of the planner started because of stalls.
    pub replans: u32,
    pub resets: u64,
    #[serde(default)]
    pub targets: Vec<TargetResult>,
    /// Time from the datagram in to the datagram out.
    pub tick_latency_us: Quantiles,
    pub full_solve_us: Quantiles,
}

const DEPARTED_M: f64 = 0.1;
/// Distance d_safe of MRPB, metres; nominal, because MRPB leaves it to its user.
pub const SAFE_M: f64 = 0.3;

impl Summary {
    /// Summarises a finished run up to its decisive end.
    pub fn new(mission: &Mission, finished: &Finished, heard: &Hearer) -> Self {
        let Finished { ending, record, resumes, .. } = finished;
        let last_tick = finished.last_tick.or(record.newest_tick());
        let pose = last_tick.and_then(|tick| record.pose_at(tick));
        let guidance = last_tick.and_then(|tick| record.guidance_at(tick));
        let truth = &finished.truth[..];
        let ended = truth.last();
        let clearance = truth.iter().map(|tick| tick.clearance_m).reduce(f64::min);
        let restarts = finished.restarts.iter();
        let looks = last_tick.map(|tick| heard.looks.at(tick)).unwrap_or_default();
        Self {
            outcome: ending.outcome,
            reason: ending.reason.clone(),
            cause: ending.cause.map(str::to_owned),
            mission_time_s: finished.duration_s,
            path_length_m: match ended {
                Some(_) if *resumes == 0 => path_length(truth),
                _ => pose.map_or(0.0, |pose| pose.travelled_m),
            },
            straight_m: straight_m(mission, &finished.targets),
            min_clearance_m: clearance
                .filter(|&clearance| clearance < GroundTruthTick::NOTHING_NEAR),
            p_o: near_share(truth),
            f_ps_m2: path_smoothness(truth),
            f_vs_m_s2: velocity_smoothness(truth),
            collisions: ended.map(|tick| tick.contacts),
            contact_speed_m_s: contact_speed_m_s(truth, mission.body().track_m),
            pose_error_m: pose.and_then(|pose| {
                Some(truth.iter().rev().find(|tick| tick.is_of(pose)).or(ended)?.pose_error_m(pose))
            }),
            pose_error_expected_m: pose.map(PoseSample::position_rms_m),
            pose_within_m: pose.map(PoseSample::position_within_m),
            true_distance_m: ended.and_then(|tick| {
                let tried = |it: &&TargetResult| it.outcome != TargetOutcome::NotTried;
                let last = finished.targets.iter().rfind(tried)?;
                Some((tick.x - last.x_m).hypot(tick.y - last.y_m))
            }),
            departed_s: departed_s(mission, truth),
            stopping_time_s: ended.map(|tick| tick.stopping_time_s),
            safety_events: guidance.map_or(0, |guidance| guidance.safety_events),
            full_solves: heard.solves_until(guidance),
            looks: looks.looks,
            look_s: looks.ticks as f64 / mission.robot.rate_hz,
            sonar_unavailable_share: sonar_unavailable_share(truth),
            // A car has a steering angle in place of the second wheel.
            wheel_range_rad_s: last_tick
                .filter(|_| mission.body().steering.is_none())
                .and_then(|tick| heard.wheel_range_rad_s(tick)),
            ticks: last_tick.map_or(0, |tick| tick + 1),
            restarts: restarts.map(|(stage, times)| ((*stage).to_owned(), *times)).collect(),
            stops: heard.interruptions.stops(finished.in_ticks),
            slowed: heard.interruptions.slowed.clone(),
            resumes: *resumes,
            replans: finished.replans,
            resets: finished.resets,
            targets: finished.targets.clone(),
            tick_latency_us: (&heard.latency()).into(),
            full_solve_us: (&heard.full_solves).into(),
        }
    }

    pub fn captions(&self) -> Vec<String> {
        let metres = |value: Option<f64>| {
            value.map_or("unknown".to_owned(), |value| format!("{value:.3} m"))
        };
        let stalls = (self.replans > 0 || self.resets > 0).then(|| {
            format!("The robot stalled: replans {}, map resets {}", self.replans, self.resets)
        });
        let numbers = [
            format!(
                "Least true clearance {} · pose error at the end {} (by the robot within {}) · {} full solves",
                metres(self.min_clearance_m),
                metres(self.pose_error_m),
                metres(self.pose_within_m),
                self.full_solves,
            ),
            format!(
                "tick latency {} · {} ticks · {}{}",
                self.tick_latency_us,
                self.ticks,
                self.restarted(),
                self.stopping_time_s.map_or(String::new(), |seconds| format!(
                    " · at rest at most {seconds:.2} s after a last command"
                )),
            ),
        ];
        stalls.into_iter().chain(numbers).collect()
    }

    fn restarted(&self) -> String {
        let some: Vec<_> = self
            .restarts
            .iter()
            .filter(|(_, times)| **times > 0)
            .map(|(stage, times)| format!("{stage} restarted {times}×"))
            .collect();
        let all: Vec<_> = (self.resumes > 0)
            .then(|| format!("resumed {}×", self.resumes))
            .into_iter()
            .chain(some)
            .collect();
        if all.is_empty() { "no restarts".to_owned() } else { all.join(", ") }
    }
}

impl fmt::Display for Quantiles {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.p50, self.p99, self.max) {
            (Some(p50), Some(p99), Some(max)) => {
                write!(f, "{p50:.0} µs (median), {p99:.0} µs (99 %), {max:.0} µs (longest)")
            }
            _ => f.write_str("unknown"),
        }
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}: {}", self.outcome.as_str(), self.reason)?;
        write!(f, "{:.1} s, {:.2} m driven, ", self.mission_time_s, self.path_length_m)?;
        // A target at the start has a straight distance of 0.
        if self.straight_m > 0.0 {
            let ratio = self.path_length_m / self.straight_m;
            write!(f, "{ratio:.2} x the straight {:.2} m, ", self.straight_m)?;
        }
        writeln!(f, "hazards mapped {} times", self.safety_events)?;
        for caption in self.captions() {
            writeln!(f, "{caption}")?;
        }
        Ok(())
    }
}

pub fn departed_s(mission: &Mission, truth: &[GroundTruthTick]) -> Option<f64> {
    let start = mission.start.at;
    let has_left = |tick: &&GroundTruthTick| start.distance(tick.pose().position) >= DEPARTED_M;
    truth.iter().find(has_left).map(|tick| tick.time_s)
}

/// Returns the length of the straight lines from the start over the targets, without replaced ones,
/// metres.
fn straight_m(mission: &Mission, targets: &[TargetResult]) -> f64 {
    let mut here = mission.start.at.to_array();
    targets
        .iter()
        .filter(|target| target.outcome != TargetOutcome::Replaced)
        .map(|target| {
            let [x, y] = std::mem::replace(&mut here, [target.x_m, target.y_m]);
            (target.x_m - x).hypot(target.y_m - y)
        })
        .sum()
}

/// Uses square roots, identical on every processor, unlike the C library's `hypot`.
pub fn path_length(truth: &[GroundTruthTick]) -> f64 {
    truth.windows(2).map(|pair| pair[0].pose().position.distance(pair[1].pose().position)).sum()
}

fn contact_speed_m_s(truth: &[GroundTruthTick], track_m: f64) -> Option<f64> {
    let first = truth.iter().position(|tick| tick.contacts > 0)?;
    Some(truth.get(first.checked_sub(1)?)?.rim_m_s(track_m))
}

fn near_share(truth: &[GroundTruthTick]) -> Option<f64> {
    let [first, .., last] = truth else { return None };
    let near = truth.windows(2).filter(|pair| pair[1].clearance_m <= SAFE_M);
    // The sum of no numbers is -0.
    let near_s = near.fold(0.0, |sum, pair| sum + (pair[1].time_s - pair[0].time_s));
    Some(near_s / (last.time_s - first.time_s))
}

fn path_smoothness(truth: &[GroundTruthTick]) -> Option<f64> {
    let squared = |three: &[GroundTruthTick]| {
        let [before, here, after] = [0, 1, 2].map(|at| three[at].pose().position);
        (after - 2.0 * here + before).length_squared()
    };
    (truth.len() > 2).then(|| truth.windows(3).map(squared).sum())
}

fn velocity_smoothness(truth: &[GroundTruthTick]) -> Option<f64> {
    let changes = truth
        .windows(2)
        .map(|pair| (pair[1].v - pair[0].v).abs() / (pair[1].time_s - pair[0].time_s));
    (truth.len() > 1).then(|| changes.sum::<f64>() / (truth.len() - 1) as f64)
}

/// Returns the share of ticks whose front sonar byte is 255 (nothing in range) or 0 (invalid).
fn sonar_unavailable_share(truth: &[GroundTruthTick]) -> Option<f64> {
    let unavailable = truth.iter().filter(|tick| matches!(tick.sonar_cm, 0 | 255));
    (!truth.is_empty()).then(|| unavailable.count() as f64 / truth.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sonar_is_unavailable_where_its_byte_is_no_distance() {
        let tick = |sonar_cm| GroundTruthTick { sonar_cm, ..GroundTruthTick::default() };
        assert_eq!(sonar_unavailable_share(&[]), None);
        let truth = [255, 0, 255, 254, 4].map(tick);
        assert_eq!(sonar_unavailable_share(&truth), Some(0.6));
    }

    #[test]
    fn the_speed_at_a_contact_is_the_faster_wheels_in_the_tick_before() {
        let tick =
            |contacts, v, omega| GroundTruthTick { contacts, v, omega, ..Default::default() };
        let truth = [tick(0, 0.0, 0.0), tick(0, -0.3, 1.0), tick(1, 0.0, 0.0)];
        assert_eq!(contact_speed_m_s(&truth, 0.4), Some(0.5));
        assert_eq!(contact_speed_m_s(&truth[..2], 0.4), None);
    }

    #[test]
    fn the_metrics_of_mrpb_are_those_of_its_definitions() {
        // The robot drives one metre ahead, two more, and one to the left, at the times 0, 1, 2 and
        // 4 s.
        let tick = |time_s, x, y, v, clearance_m| GroundTruthTick {
            time_s,
            x,
            y,
            v,
            clearance_m,
            ..GroundTruthTick::default()
        };
        let truth = [
            tick(0.0, 0.0, 0.0, 0.0, 9.0),
            tick(1.0, 1.0, 0.0, 1.0, 0.2),
            tick(2.0, 3.0, 0.0, 3.0, 0.4),
            tick(4.0, 3.0, 1.0, 1.0, 0.3),
        ];
        assert_eq!(near_share(&truth), Some(0.75));
        assert_eq!(path_smoothness(&truth), Some(1.0 + 5.0));
        assert_eq!(velocity_smoothness(&truth), Some((1.0 + 2.0 + 1.0) / 3.0));
        assert_eq!([near_share(&[]), path_smoothness(&[]), velocity_smoothness(&[])], [None; 3]);
    }
}
