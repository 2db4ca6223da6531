use super::{Checker, Result, all_within, point, refuse_if, within};
use crate::geometry::{Profile, Shapes};

/// Limit that catches mistakes in a file.
const MAX_POINTS: usize = 100_000;
const HIGHEST_M: f64 = 1000.0;

impl Checker {
    pub(super) fn shapes(&mut self, key: &'static str, shapes: &Shapes) -> Result {
        for drum in &shapes.drums {
            point(key, drum.at)?;
            within(key, drum.radius_m, 0.001..=1000.0, "m of drum radius")?;
            profile(key, drum.profile())?;
        }
        for wall in &shapes.walls {
            let count = wall.points.len();
            refuse_if(count < 2, key, "a wall has fewer than two points", "give two or more")?;
            wall.points.iter().try_for_each(|corner| point(key, *corner))?;
            profile(key, wall.profile())?;
            self.points += count;
        }
        for block in &shapes.boxes {
            point(key, block.at)?;
            all_within([
                (key, block.size_m.x, 0.001..=1000.0, "m of box"),
                (key, block.size_m.y, 0.001..=1000.0, "m of box"),
                (key, block.angle_deg, -360.0..=360.0, "degrees"),
            ])?;
            profile(key, block.profile())?;
        }
        self.points += shapes.drums.len() + shapes.boxes.len();
        let problem = format!("more than {MAX_POINTS} shapes and corners");
        refuse_if(self.points > MAX_POINTS, key, problem, "simplify the outline")
    }
}

fn profile(key: &'static str, profile: Profile) -> Result {
    let Profile { bottom_m, top_m, echo, light: _ } = profile;
    within(key, bottom_m, 0.0..=HIGHEST_M, "m of bottom_m")?;
    refuse_if(
        top_m <= bottom_m || top_m.is_nan(),
        key,
        format!("top_m = {top_m} is not above bottom_m = {bottom_m}"),
        "give the lower height as bottom_m, the higher as top_m",
    )?;
    within(key, echo, 0.0..=1.0, "as echo")
}
