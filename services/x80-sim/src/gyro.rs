//! Gyro: turned angle with noise, bias and scale error.

use common::{geometry::wrap_angle, mission::Mission};

use crate::noise::{Noise, Source};

pub struct Gyro {
    noise_rad_sqrt_s: f64,
    bias_rad_s: f64,
    scale: f64,
    noise: Noise,
    newest: Option<(f64, f64)>,
    pub angle: f64,
}

impl Gyro {
    /// Draws bias and scale, which belong to the robot, from the mission's seed; `seed` sets the
    /// noise.
    pub fn new(mission: &Mission, seed: u64) -> Self {
        let physics = mission.simulation.physics().gyro;
        let mut errors = Noise::of_nth(mission.seed, Source::Gyro, 1);
        Self {
            noise_rad_sqrt_s: physics.noise_deg_sqrt_s.to_radians(),
            bias_rad_s: errors.within(physics.bias_spread_deg_s).to_radians(),
            scale: 1.0 + errors.within(physics.scale_spread),
            noise: Noise::new(seed, Source::Gyro),
            newest: None,
            angle: 0.0,
        }
    }

    pub fn read(&mut self, time_s: f64, heading: f64) -> f64 {
        if let Some((before_s, before)) = self.newest.replace((time_s, heading)) {
            let passed_s = time_s - before_s;
            self.angle += self.scale * wrap_angle(heading - before)
                + self.bias_rad_s * passed_s
                + self.noise.normal(self.noise_rad_sqrt_s * passed_s.sqrt());
        }
        self.angle
    }
}

#[cfg(test)]
mod tests {

    use super::*;
    use crate::testing::mission;

    #[test]
    fn a_gyro_is_off_by_its_bias_and_scale_and_by_noise_that_grows_with_the_root_of_time() {
        let read = |seed: u64, [noise, bias, scale]: [f64; 3]| {
            let mission = mission(&format!(
                "seed = {seed}\n[simulation.gyro]\nnoise_deg_sqrt_s = {noise:?}\n\
                 bias_spread_deg_s = {bias:?}\nscale_spread = {scale:?}"
            ));
            let mut gyro = Gyro::new(&mission, seed);
            (0..=1000).for_each(|tick| {
                gyro.read(f64::from(tick) / 10.0, f64::from(tick) / 100.0);
            });
            gyro.angle - 10.0
        };
        assert!(read(1, [0.0; 3]).abs() < 1e-9);
        let mean_square =
            |errors| (1..=300).map(|seed| read(seed, errors).powi(2)).sum::<f64>() / 300.0;
        // 0.1 degrees per root second over 100 s. A uniform distribution's variance is a third of
        // its squared bound.
        let of = |degrees: f64| degrees.to_radians().powi(2);
        for (errors, want) in [
            ([0.1, 0.0, 0.0], of(1.0)),
            ([0.0, 0.1, 0.0], of(10.0) / 3.0),
            ([0.0, 0.0, 0.1], 1.0 / 3.0),
        ] {
            let got = mean_square(errors);
            assert!((0.8..1.2).contains(&(got / want)), "{errors:?}: {got} {want}");
        }
    }
}
