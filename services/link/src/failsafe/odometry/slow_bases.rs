//! Tests of slow and late bases with an unstated response, and of encoders that die on them.

use super::*;
use crate::testing::*;

const SEEDS: u64 = 2;
const COUNTS_PER_M: f64 = 7162.0;
const MISSION: &str = "[robot]
protocol = 'json'
wheel_radius_m = 0.08
track_m = TRACK
radius_m = 0.2
top_speed_m_s = 0.6
counts_per_turn = 3600.0
rate_hz = 10
[[robot.sensor]]
name = 'front'
kind = 'cone'
forward_m = 0.2
bearing_deg = 0";

/// Accelerations, m/s^2; `turn` is that of each wheel, if limited apart.
#[derive(Clone, Copy, Debug)]
struct Base {
    delay_s: f64,
    acceleration: f64,
    turn: Option<f64>,
    track_m: f64,
}

/// Drives a base for 40 s, ahead and turning to both sides, and stops it while suspected. Frames
/// and commands are up to 40 ms late. The left encoder dies at `dies_s`.
/// Returns when the last suspicion began (true) or ended (false), seconds.
fn drive(base: Base, seed: u64, dies_s: f64) -> Option<(f64, bool)> {
    let text = MISSION.replace("TRACK", &base.track_m.to_string());
    let mut odometry = Odometry::new(&mission(&text));
    let mut state = seed;
    let mut random = || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / f64::from(1 << 24)
    };
    for _ in 0..9 {
        random();
    }
    let Base { delay_s, acceleration, turn, .. } = base;
    let mut limited = [acceleration, turn.unwrap_or(acceleration)]
        .map(|most| ModelledSpeed::new(delay_s, most * COUNTS_PER_M));
    let (mut rolled, mut command, mut changes_s) = ([0.0; 2], [0.0; 2], 0.0);
    let (mut last, mut found) = (None, 0);
    for tick in 1..400 {
        let now = f64::from(tick) * 0.1 + 0.04 * random();
        let [one, other] = limited.each_mut().map(|speed| speed.go_on(now));
        let [left, right] = if turn.is_some() { [one - other, one + other] } else { [one, other] };
        rolled[1] += right;
        rolled[0] += if now < dies_s { left } else { 0.0 };
        odometry.plausible(rolled.map(on_wire), at(now));
        found += u32::from(odometry.found.take().is_some());
        let is_suspected = odometry.suspicion.is_some();
        if last.is_some_and(|(_, before)| before) != is_suspected {
            last = Some((now, is_suspected));
        }
        if now >= changes_s {
            changes_s = now + 0.2 + 1.3 * random();
            let speed = 0.1 + 0.4 * random();
            command = match (4.0 * random()) as u32 {
                0 | 1 => [speed, speed * (0.6 + 0.4 * random())],
                2 => [-0.4 * speed, 0.4 * speed],
                _ => [0.4 * speed, -0.4 * speed],
            };
        }
        let tells = if is_suspected { [0.0; 2] } else { command.map(|speed| speed * COUNTS_PER_M) };
        odometry.commanded(tells.map(|counts| counts as i16), at(now));
        let heard = now + 0.04 * random();
        let [left, right] = tells;
        let [ahead, aside] = [(left + right) / 2.0, (right - left) / 2.0];
        let asked = if turn.is_some() { [ahead, aside] } else { tells };
        for (speed, asked) in limited.iter_mut().zip(asked) {
            speed.command(heard, asked);
        }
    }
    assert!(found < 20, "{base:?} {seed}: {found} responses");
    last
}

fn bases() -> impl Iterator<Item = Base> {
    let delays = [0.0, 0.1, 0.25, 0.4].into_iter();
    delays.flat_map(|delay_s| {
        let base = |acceleration| Base { delay_s, acceleration, turn: None, track_m: 0.3 };
        [0.3, 0.6, 1.25, 3.0, 5.0].map(base)
    })
}

/// Returns bases that limit speed and turn separately, m/s^2 and rad/s^2.
fn bases_apart() -> impl Iterator<Item = Base> {
    let tracks = [0.16, 0.3].into_iter();
    tracks.flat_map(|track_m| {
        [[0.6, 1.2], [2.5, 3.2], [1.0, 2.0], [0.3, 4.0]].map(|[acceleration, turn]| Base {
            delay_s: 0.1,
            acceleration,
            turn: Some(turn * track_m / 2.0),
            track_m,
        })
    })
}

#[test]
fn no_slow_or_late_base_is_given_up_though_nobody_stated_it() {
    for base in bases().chain(bases_apart()) {
        for seed in 0..SEEDS {
            let last = drive(base, seed, f64::INFINITY);
            assert!(last.is_none_or(|(_, is_suspected)| !is_suspected), "{base:?} {seed}");
        }
    }
}

#[test]
fn an_encoder_that_dies_on_a_slow_base_is_suspected_for_good() {
    for base in bases() {
        for seed in 0..SEEDS {
            let last = drive(base, seed, 20.0);
            let in_time = last.is_some_and(|(at, is_suspected)| is_suspected && at < 24.0);
            assert!(in_time, "{base:?} {seed}: {last:?}");
        }
    }
}
