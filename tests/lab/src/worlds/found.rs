//! The result of a search for worlds.

use common::mission::MissionError;

use crate::missions::trial::{BodySize, Rules, Scene, Trial};

/// Trials, and the number of worlds that were left out.
#[derive(Debug, Default)]
pub struct Found {
    pub trials: Vec<Trial>,
    /// Worlds that the body could not cross.
    pub unsolvable: usize,
}

impl Found {
    /// Add the trial `world` in `scene`; if the body cannot cross the world, count it as left out.
    pub fn add(
        &mut self,
        world: String,
        scene: &Scene,
        rules: Rules,
        body: &BodySize,
    ) -> Result<(), MissionError> {
        let trial = Trial::new(world, scene, rules, body)?;
        self.add_solvable(trial);
        Ok(())
    }

    pub fn add_solvable(&mut self, trial: Option<Trial>) {
        match trial {
            Some(trial) => self.trials.push(trial),
            None => self.unsolvable += 1,
        }
    }

    pub fn spread(&mut self, count: usize) {
        let all = self.trials.len();
        if count < all {
            let mut index = 0;
            self.trials.retain(|_| {
                let before = index * count / all;
                index += 1;
                index * count / all > before
            });
        }
    }
}
