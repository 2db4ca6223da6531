//! Delay and acceleration of a base, from turns on the spot to and fro.
//!
//! A model of the response receives the commanded turn rates. The best parameters minimise the
//! residual between measured and modelled turns. Each turn with its return gives an estimate; their
//! spread is the deviation.

use std::ops::Range;

use common::{
    geometry::wrap_angle,
    mission::{Body, Response},
};

use crate::script::LEG_S;

const LONGEST_DELAY_S: f64 = 1.0;
const COARSE_S: f64 = 0.04;
const DELAY_STEP_S: f64 = 0.01;
/// Turn accelerations to try, rad/s^2: from the least up, each a tenth greater.
const LEAST: f64 = 0.2;
const RATIO: f64 = 1.1;
const ACCELERATIONS: i32 = 64;
/// Least share of the turned angles that the response explains.
const EXPLAINED: f64 = 0.95;
/// Fewest estimates for a deviation.
const FEWEST: usize = 3;
/// Time step of the model, seconds.
const STEP_S: f64 = 0.01;
/// Most steps within a pause between two headings.
const MOST_STEPS: f64 = 100.0;

/// Quantity by which model and base are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum By {
    /// Turns between frames, which separate delay and acceleration best. Late frames disturb them.
    Turns,
    /// Headings, which late frames hardly disturb.
    Headings,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    pub value: f64,
    pub sd: f64,
}

#[derive(Debug, PartialEq)]
pub struct Estimate {
    /// Delay, given the stated lag, seconds.
    pub delay_s: Measured,
    /// Acceleration of the rims, m/s^2; `None` if the turns show no limit.
    pub acceleration_m_s2: Option<Measured>,
}

/// Estimates the response of this body with its stated lag.
///
/// `commands` are times and turn rates, `headings` times and headings, possibly wrapped.
///
/// # Errors
/// Fails if the motion does not follow the commands; the text says where to look.
pub fn estimate(
    commands: &[(f64, f64)],
    headings: &[(f64, f64)],
    body: &Body,
    by: By,
) -> Result<Estimate, String> {
    let turns: Vec<f64> = commands
        .windows(2)
        .filter(|pair| pair[0].1 * pair[1].1 < 0.0)
        .map(|pair| pair[1].0)
        .collect();
    // Each window is a turn and its return; the first starts from rest.
    let mut fits: Vec<Fit> = turns
        .windows(3)
        .map(|ends| (ends[0], ends[2]))
        .filter_map(|window| Fit::best(commands, headings, (body, by), window))
        .filter(|fit| fit.explained >= EXPLAINED)
        .collect();
    // On a busy machine the robot stands still in some windows.
    fits.sort_by(|one, other| other.explained.total_cmp(&one.explained));
    fits.truncate(FEWEST.max(fits.len().div_ceil(2)));
    if fits.len() < FEWEST {
        return Err(format!(
            "no delay and acceleration explain {FEWEST} of its turns: it may stand still or slip, or its wheels are swapped or reversed; see the logs of the run"
        ));
    }
    let delay = measured(fits.iter().map(|fit| fit.delay_s));
    let limited = fits.iter().filter(|fit| fit.acceleration.is_finite()).count();
    let rims = |fit: &Fit| fit.acceleration * body.track_m / 2.0;
    Ok(Estimate {
        delay_s: Measured { sd: delay.sd.max(DELAY_STEP_S / 2.0), ..delay },
        acceleration_m_s2: (2 * limited > fits.len()).then(|| {
            let found = measured(fits.iter().filter(|fit| fit.acceleration.is_finite()).map(rims));
            // The accelerations tried are this coarse.
            Measured { sd: found.sd.max((RATIO - 1.0) / 2.0 * found.value), ..found }
        }),
    })
}

/// Returns the median of non-empty `values` and its standard deviation, from their median
/// deviation.
fn measured(values: impl Iterator<Item = f64>) -> Measured {
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        f64::midpoint(values[(values.len() - 1) / 2], values[values.len() / 2])
    };
    let values: Vec<f64> = values.collect();
    let count = values.len() as f64;
    let value = median(values.clone());
    let distance = median(values.iter().map(|it| (it - value).abs()).collect());
    Measured { value, sd: 1.48 * distance / count.sqrt() }
}

struct Fit {
    delay_s: f64,
    acceleration: f64,
    explained: f64,
}

impl Fit {
    /// Returns the response that best explains the turns of a window of time; `None` without turns.
    fn best(
        commands: &[(f64, f64)],
        headings: &[(f64, f64)],
        (body, by): (&Body, By),
        window: (f64, f64),
    ) -> Option<Self> {
        let Response { lag_s, acceleration_m_s2, turn_acceleration_rad_s2, .. } = body.response;
        let stated = turn_acceleration_rad_s2.min(acceleration_m_s2 / (body.track_m / 2.0));
        let fit = |delay_s: f64, acceleration| {
            let delay_s = delay_s.max(0.0);
            let model = [delay_s, lag_s, acceleration];
            let (explained, factor) = explains(model, commands, headings, window, by)?;
            // A base that turns at half the rate reaches it in half the time.
            Some(Self { delay_s, acceleration: factor * acceleration, explained })
        };
        let best = |delays: Range<i32>, from_s: f64, step_s: f64| {
            let at = |step: i32| from_s + f64::from(step) * step_s;
            let limited = |step| {
                (0..ACCELERATIONS).filter_map(move |power| fit(at(step), LEAST * RATIO.powi(power)))
            };
            let better = |one: &Self, other: &Self| one.explained.total_cmp(&other.explained);
            let limited = delays.clone().flat_map(limited).max_by(better)?;
            // No limit, or for headings the stated one, wins if it explains as much.
            let mut simple = (by == By::Headings)
                .then_some(stated)
                .into_iter()
                .chain([f64::INFINITY])
                .filter_map(|acceleration| {
                    delays.clone().filter_map(|step| fit(at(step), acceleration)).max_by(better)
                });
            // Loss of explained share that counts as none.
            let loss = if by == By::Turns { 1e-3 } else { 1e-4 };
            let as_much = |it: &Self| it.explained >= limited.explained - loss;
            Some(simple.find(as_much).unwrap_or(limited))
        };
        const { assert!(4.0 * DELAY_STEP_S >= COARSE_S && COARSE_S < LONGEST_DELAY_S) };
        let coarse = best(0..(LONGEST_DELAY_S / COARSE_S) as i32, 0.0, COARSE_S)?;
        best(-4..5, coarse.delay_s, DELAY_STEP_S)
    }
}

/// Returns the squared correlation and ratio of measured and modelled turns within `window`. Link or
/// base may turn slower than commanded.
///
/// The model of a base is a delay, and a lag of limited acceleration.
fn explains(
    [delay_s, lag_s, acceleration]: [f64; 3],
    commands: &[(f64, f64)],
    headings: &[(f64, f64)],
    window: (f64, f64),
    by: By,
) -> Option<(f64, f64)> {
    // The model starts at rest, and needs time to forget that.
    let begins = window.0 - delay_s - 2.0 * LEG_S;
    let mut waiting = commands.iter().skip_while(|(at, _)| *at < begins).peekable();
    let share = if lag_s > 0.0 { 1.0 - (-STEP_S / lag_s).exp() } else { 1.0 };
    let most = acceleration * STEP_S;
    let (mut target, mut speed, mut turned) = (0.0, 0.0, [0.0; 2]);
    let mut seen = Vec::new();
    for pair in headings.windows(2).filter(|pair| (begins..window.1).contains(&pair[1].0)) {
        let [(from, heading), (until, then)] = [pair[0], pair[1]];
        if by == By::Turns {
            turned = [0.0; 2];
        }
        let steps = ((until - from) / STEP_S).round().clamp(1.0, MOST_STEPS);
        for step in 1..=steps as u32 {
            let now = from + (until - from) * f64::from(step) / steps;
            while let Some((_, rate)) = waiting.next_if(|(at, _)| at + delay_s <= now) {
                target = *rate;
            }
            speed += ((target - speed) * share).clamp(-most, most);
            turned[0] += speed * (until - from) / steps;
        }
        turned[1] += wrap_angle(then - heading);
        if until >= window.0 {
            seen.push(turned);
        }
    }
    let [model, both, turned] = spread(&seen);
    (model > 0.0 && turned > 0.0 && both > 0.0)
        .then(|| (both * both / (model * turned), both / model))
}

/// Returns the centred sums of squares and products: first values, both, second values.
pub fn spread(points: &[[f64; 2]]) -> [f64; 3] {
    let mean = [0, 1].map(|of| points.iter().map(|it| it[of]).sum::<f64>() / points.len() as f64);
    [(0, 0), (0, 1), (1, 1)].map(|(one, other)| {
        points.iter().map(|it| (it[one] - mean[one]) * (it[other] - mean[other])).sum()
    })
}

pub fn keys(estimate: &Estimate, stated: Response) -> String {
    let Measured { value, sd } = estimate.delay_s;
    let acceleration = match estimate.acceleration_m_s2 {
        Some(Measured { value, sd }) => {
            format!("acceleration_m_s2 = {value:.2}  # +- {sd:.2}\n")
        }
        None => "# no acceleration limit was measured\n".to_owned(),
    };
    format!(
        "[robot.response]\ndelay_s = {value:.3}  # +- {sd:.3}\nlag_s = {:.2}  # as stated\n{acceleration}",
        stated.lag_s
    )
}

#[cfg(test)]
mod tests {

    use common::mission::{Mission, ModelledSpeed};

    use super::*;

    /// Returns commands to and fro at 10 Hz, and the headings of a base without lag that follows
    /// `model`.
    fn turned(mut model: ModelledSpeed, factor: f64) -> [Vec<(f64, f64)>; 2] {
        let (mut commands, mut headings, mut heading) = (Vec::new(), Vec::new(), 0.0);
        for tick in 0..160 {
            let at = f64::from(tick) / 10.0;
            heading += model.go_on(at);
            headings.push((at, heading));
            let rate = if tick / 16 % 2 == 0 { 1.5 } else { -1.5 };
            model.command(at, factor * rate);
            commands.push((at, rate));
        }
        [commands, headings]
    }

    fn body() -> Body {
        let text = "target = [3, 0]\nrobot.response.lag_s = 0.0";
        Mission::parse(text, "m.toml").unwrap().body()
    }

    #[test]
    fn delay_and_acceleration_of_a_base_are_measured_from_its_turns() {
        for (dead_s, acceleration) in [(0.15, 2.0), (0.48, 4.0), (0.1, 20.0), (0.28, 1.0)] {
            let [commands, headings] = turned(ModelledSpeed::new(dead_s, acceleration), 0.8);
            for by in [By::Turns, By::Headings] {
                let found = estimate(&commands, &headings, &body(), by).unwrap();
                let off = found.delay_s.value - dead_s;
                assert!(off.abs() < 0.05, "{dead_s} {acceleration}: {found:?}");
                if acceleration < 10.0 {
                    let rims = found.acceleration_m_s2.unwrap().value;
                    let share = rims / (acceleration * body().track_m / 2.0);
                    assert!((0.85..1.15).contains(&share), "{dead_s} {acceleration}: {found:?}");
                }
            }
        }
    }

    #[test]
    fn a_robot_that_turns_the_wrong_way_or_not_at_all_has_no_response() {
        for factor in [-1.0, 0.0] {
            let [commands, headings] = turned(ModelledSpeed::new(0.1, 2.0), factor);
            assert!(estimate(&commands, &headings, &body(), By::Turns).is_err(), "{factor}");
        }
        assert!(estimate(&[], &[], &body(), By::Turns).is_err());
    }
}
