//! Runs of silence: a ranger sometimes hears nothing for several readings.

use common::mission::SonarPhysics;

use crate::noise::{Noise, Source};

/// Chain of two states per ranger, heard and silent, with a step per tick (E. N. Gilbert, "Capacity
/// of a burst-noise channel", 1960).
pub struct Silence {
    /// Probability of hearing the next reading.
    end: f64,
    /// Probability of falling silent.
    begin: f64,
    /// Rangers in a run of silence.
    pub silent: [bool; 6],
    noise: Noise,
}

impl Silence {
    /// Draws no random number if the share is 0.
    pub fn new(physics: &SonarPhysics, period_s: f64, seed: u64) -> Self {
        let share = physics.silence_share;
        let end = (period_s / physics.silence_mean_s).min(1.0);
        let mut noise = Noise::new(seed, Source::Silence);
        Self {
            end,
            begin: end * share / (1.0 - share),
            silent: std::array::from_fn(|_| noise.chance(share)),
            noise,
        }
    }

    pub fn step(&mut self) -> [bool; 6] {
        if self.begin > 0.0 {
            for silent in &mut self.silent {
                let changes = if *silent { self.end } else { self.begin };
                *silent ^= self.noise.chance(changes);
            }
        }
        self.silent
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::near;
    use common::mission::Realism;

    #[test]
    fn silences_come_in_runs_of_the_mean_and_share_that_are_given() {
        let physics = SonarPhysics {
            silence_share: 0.1,
            silence_mean_s: 0.7,
            ..SonarPhysics::preset(Realism::Laboratory)
        };
        let mut silence = Silence::new(&physics, 0.14, 3);
        let readings = 100_000;
        let (mut silent, mut runs, mut before) = (0, 0, [false; 6]);
        for _ in 0..readings {
            let now = silence.step();
            for (now, before) in now.iter().zip(before) {
                silent += u32::from(*now);
                runs += u32::from(*now && !before);
            }
            before = now;
        }
        let share = f64::from(silent) / (6.0 * f64::from(readings));
        let mean_s = 0.14 * f64::from(silent) / f64::from(runs);
        near(share, 0.1, 0.005);
        near(mean_s, 0.7, 0.03);
    }
}
