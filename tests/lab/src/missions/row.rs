//! Result of one mission.

use std::collections::BTreeMap;

use mission_control::outcome::Outcome as Reported;
use serde::{Deserialize, Serialize};
use summary::Summary;

use super::{Setting, results::Key, statistics::Spread, trial::Trial};

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// The robot is at the target without contact.
    Success,
    Collision,
    Timeout,
    WrongPlace,
    /// The robot gave up although a path to the target exists.
    Unreachable,
    Aborted,
}

pub const OUTCOMES: [&str; 6] =
    ["success", "collision", "timeout", "wrong_place", "unreachable", "aborted"];

/// Lengths are metres, times mission seconds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    pub world: String,
    pub seed: u64,
    pub setting: String,
    pub planner: String,
    pub outcome: Outcome,
    pub reason: String,
    pub time_s: f64,
    pub path_m: f64,
    pub straight_m: f64,
    pub shortest_m: f64,
    /// K of the paper: path divided by straight distance.
    pub k: f64,
    /// Success weighted by path length: shortest / max(path, shortest), 0 without success.
    pub spl: f64,
    /// BARN score; none without an optimal time.
    pub barn_score: Option<f64>,
    pub min_clearance_m: Option<f64>,
    /// MRPB's metrics, see [`Summary`]: share of time near obstacles, path smoothness, velocity
    /// smoothness.
    pub p_o: Option<f64>,
    pub f_ps_m2: Option<f64>,
    pub f_vs_m_s2: Option<f64>,
    /// Final distance from the estimated to the true position.
    pub pose_error_m: Option<f64>,
    pub true_distance_m: Option<f64>,
    pub safety_events: u64,
    pub sonar_unavailable_share: Option<f64>,
    /// Maximum minus minimum commanded speed of either wheel.
    pub wheel_range_rad_s: Option<f64>,
    pub look_s: f64,
    /// Speed of the faster wheel in the tick before the contact.
    pub contact_speed_m_s: Option<f64>,
    /// Causes and counts by which the failsafe stopped a departed robot, or slowed it to half
    /// speed.
    #[serde(default)]
    pub stops: String,
    #[serde(default)]
    pub slowed: String,
}

/// Speed of the faster wheel at a contact above which the robot is at fault; otherwise it was run
/// into.
const AT_FAULT_M_S: f64 = 0.05;

/// Multiples of the optimal time for the best and the worst score.
const BARN_CLIP: [f64; 2] = [2.0, 8.0];
const BARN_SPEED_M_S: f64 = 2.0;

impl Row {
    pub fn new(trial: &Trial, seed: u64, setting: &Setting, summary: &Summary) -> Self {
        let Trial { rules, shortest_m, .. } = *trial;
        let straight_m = trial.mission.straight_m();
        let started_s = summary.departed_s.filter(|_| rules.clock_after_departure);
        let time_s = (summary.mission_time_s - started_s.unwrap_or_default()).max(0.0);
        let late = rules.most_s.is_some_and(|most_s| time_s > most_s);
        let arrived = summary.true_distance_m.is_some_and(|it| it <= rules.success_within_m);
        let outcome = match summary.outcome {
            Reported::Collision => Outcome::Collision,
            Reported::Timeout => Outcome::Timeout,
            Reported::Unreachable => Outcome::Unreachable,
            Reported::Waited | Reported::Aborted | Reported::CouldNotBeStopped => Outcome::Aborted,
            _ if !arrived => Outcome::WrongPlace,
            _ if late => Outcome::Timeout,
            _ => Outcome::Success,
        };
        let if_success = |score: f64| if outcome == Outcome::Success { score } else { 0.0 };
        let optimal_s = rules.optimal_time_s.unwrap_or(shortest_m / BARN_SPEED_M_S);
        let [least_s, most_s] = BARN_CLIP.map(|times| times * optimal_s);
        let path_m = summary.path_length_m;
        Self {
            world: trial.mission.name.clone(),
            seed,
            setting: setting.name.clone(),
            planner: setting.planner.clone(),
            outcome,
            reason: summary.reason.clone(),
            time_s,
            path_m,
            straight_m,
            shortest_m,
            k: path_m / straight_m,
            spl: if_success(shortest_m / path_m.max(shortest_m)),
            barn_score: rules.scored.then(|| if_success(optimal_s / time_s.clamp(least_s, most_s))),
            min_clearance_m: summary.min_clearance_m,
            p_o: summary.p_o,
            f_ps_m2: summary.f_ps_m2,
            f_vs_m_s2: summary.f_vs_m_s2,
            pose_error_m: summary.pose_error_m,
            true_distance_m: summary.true_distance_m,
            safety_events: summary.safety_events,
            sonar_unavailable_share: summary.sonar_unavailable_share,
            wheel_range_rad_s: summary.wheel_range_rad_s,
            look_s: summary.look_s,
            contact_speed_m_s: summary.contact_speed_m_s,
            stops: causes(&summary.stops),
            slowed: causes(&summary.slowed),
        }
    }

    /// Returns whether the robot moved at its contact, or may have.
    pub fn is_at_fault(&self) -> bool {
        let moved = self.contact_speed_m_s.is_none_or(|speed| speed > AT_FAULT_M_S);
        self.outcome == Outcome::Collision && moved
    }

    pub fn is_success(&self) -> bool {
        self.outcome == Outcome::Success
    }

    pub fn key(&self) -> Key {
        (self.world.clone(), self.seed, self.setting.clone())
    }

    pub const fn outcome_name(&self) -> &'static str {
        OUTCOMES[self.outcome as usize]
    }

    pub fn number(&self, column: &str) -> Option<f64> {
        match column {
            "clearance_m" => self.min_clearance_m,
            "look_share" => Some(self.look_s / self.time_s.max(1e-9)),
            "sonar_unavailable" => self.sonar_unavailable_share,
            _ => serde_json::to_value(self).ok()?.get(column)?.as_f64(),
        }
    }
}

pub fn spread(rows: &[&Row], column: &str) -> Option<Spread> {
    let successes = rows.iter().filter(|row| row.is_success());
    Spread::of(successes.filter_map(|row| row.number(column)))
}

fn causes(times: &BTreeMap<String, u32>) -> String {
    let each: Vec<_> = times.iter().map(|(cause, times)| format!("{cause} {times}x")).collect();
    each.join(", ")
}

#[derive(Serialize, Deserialize)]
pub struct Latency {
    pub world: String,
    pub seed: u64,
    pub setting: String,
    /// Tick latency, datagram in to datagram out.
    pub tick_p50_us: Option<f64>,
    pub tick_p99_us: Option<f64>,
    pub tick_max_us: Option<f64>,
    pub full_solve_p50_us: Option<f64>,
    pub full_solve_p99_us: Option<f64>,
    pub full_solve_max_us: Option<f64>,
}

impl Latency {
    pub fn new(row: &Row, summary: &Summary) -> Self {
        let (world, seed, setting) = row.key();
        let Summary { tick_latency_us: tick, full_solve_us: full, .. } = summary;
        Self {
            world,
            seed,
            setting,
            tick_p50_us: tick.p50,
            tick_p99_us: tick.p99,
            tick_max_us: tick.max,
            full_solve_p50_us: full.p50,
            full_solve_p99_us: full.p99,
            full_solve_max_us: full.max,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::missions::{results::Table, trial::Rules};
    use common::mission::Mission;
    use std::fs;

    fn judged(rules: Rules, summary: &Summary) -> Row {
        let mission = Mission::parse("target = [4, 0]", "test.toml").unwrap();
        let trial = Trial { mission, shortest_m: 4.0, rules, oncoming: None };
        let (name, planner) = ("a".to_owned(), "harmonic".to_owned());
        Row::new(&trial, 1, &Setting { name, planner, set: Vec::new() }, summary)
    }

    fn summary(outcome: Reported, true_distance_m: f64) -> Summary {
        Summary {
            outcome,
            mission_time_s: 30.0,
            path_length_m: 5.0,
            true_distance_m: Some(true_distance_m),
            departed_s: Some(6.0),
            ..Summary::default()
        }
    }

    fn arrived(rules: Rules) -> Row {
        judged(rules, &summary(Reported::Reached, 0.1))
    }

    #[test]
    fn success_is_what_the_ground_truth_says() {
        for (said, distance, outcome) in [
            (Reported::Reached, 0.4, Outcome::Success),
            (Reported::Reached, 0.6, Outcome::WrongPlace),
            (Reported::ReachedUnsure, 0.4, Outcome::Success),
            (Reported::ReachedUnsure, 0.6, Outcome::WrongPlace),
            (Reported::Collision, 0.1, Outcome::Collision),
            (Reported::Timeout, 0.1, Outcome::Timeout),
        ] {
            let row = judged(Rules::PLAIN, &summary(said, distance));
            assert_eq!(row.outcome, outcome, "{said:?} {distance}");
        }
    }

    #[test]
    fn a_robot_at_rest_is_run_into_and_one_in_motion_is_at_fault() {
        let is_at_fault = |contact_speed_m_s| {
            let summary = Summary { contact_speed_m_s, ..summary(Reported::Collision, 3.0) };
            judged(Rules::PLAIN, &summary).is_at_fault()
        };
        assert_eq!([Some(0.0), Some(0.5), None].map(is_at_fault), [false, true, true]);
        assert!(!arrived(Rules::PLAIN).is_at_fault());
    }

    #[test]
    fn metrics_are_those_of_their_definitions() {
        let won = arrived(Rules::PLAIN);
        assert_eq!((won.k, won.spl, won.barn_score), (1.25, 0.8, None));
        assert_eq!(judged(Rules::PLAIN, &summary(Reported::Timeout, 3.0)).spl, 0.0);
    }

    #[test]
    fn rows_from_before_a_column_was_added_are_read() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let open = || Table::<Row>::open(file.path().to_path_buf()).unwrap();
        let row = arrived(Rules::PLAIN);
        open().add(row.clone()).unwrap();
        let written = fs::read_to_string(file.path()).unwrap();
        let former = written.replacen(",p_o,f_ps_m2,f_vs_m_s2", "", 1).replacen(",,,", "", 1);
        assert_eq!(written.len() - former.len(), ",p_o,f_ps_m2,f_vs_m_s2,,,".len());
        fs::write(file.path(), former).unwrap();
        assert_eq!(open().rows, [row]);
    }

    #[test]
    fn the_barn_clock_starts_with_the_motion_and_the_score_is_between_an_eighth_and_a_half() {
        for (optimal_s, score) in [(6.0, 0.25), (1.0, 0.125), (20.0, 0.5)] {
            let row = arrived(Rules {
                optimal_time_s: Some(optimal_s),
                scored: true,
                clock_after_departure: true,
                ..Rules::PLAIN
            });
            assert_eq!((row.time_s, row.barn_score), (24.0, Some(score)), "{optimal_s} s");
        }
    }

    #[test]
    fn an_arrival_after_the_challenges_time_is_a_timeout_and_a_world_without_an_optimal_time_is_scored()
     {
        let judged = |most_s| {
            let row = arrived(Rules { most_s, scored: true, ..Rules::PLAIN });
            (row.outcome, row.barn_score)
        };
        // The shortest path of 4 m takes 2 s at 2 m/s, less than an eighth of the 30 s.
        assert_eq!(judged(Some(30.0)), (Outcome::Success, Some(0.125)));
        assert_eq!(judged(Some(29.0)), (Outcome::Timeout, Some(0.0)));
    }
}
