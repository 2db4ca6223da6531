use super::{Checker, Objection, objection, within};
use crate::geometry::{Profile, Shapes};

/// More shapes than this in a file are a mistake.
const MAX_POINTS: usize = 100_000;
const HIGHEST_M: f64 = 1000.0;

impl Checker {
    pub(super) fn shapes(&mut self, key: &'static str, shapes: &Shapes) -> Result<(), Objection> {
        for drum in &shapes.drums {
            self.point(key, drum.at)?;
            within(key, drum.radius_m, 0.001..=1000.0, "m of drum radius")?;
            profile(key, drum.profile())?;
        }
        for wall in &shapes.walls {
            if wall.points.len() < 2 {
                return Err(objection(key, "a wall has fewer than two points", "give two or more"));
            }
            for point in &wall.points {
                self.point(key, *point)?;
            }
            profile(key, wall.profile())?;
            self.points += wall.points.len();
        }
        for block in &shapes.boxes {
            self.point(key, block.at)?;
            within(key, block.size_m.x, 0.001..=1000.0, "m of box")?;
            within(key, block.size_m.y, 0.001..=1000.0, "m of box")?;
            within(key, block.angle_deg, -360.0..=360.0, "degrees")?;
            profile(key, block.profile())?;
        }
        self.points += shapes.drums.len() + shapes.boxes.len();
        if self.points > MAX_POINTS {
            return Err(objection(
                key,
                format!("more than {MAX_POINTS} shapes and corners"),
                "simplify the outline",
            ));
        }
        Ok(())
    }
}

fn profile(key: &'static str, profile: Profile) -> Result<(), Objection> {
    let Profile { bottom_m, top_m, echo, light: _ } = profile;
    within(key, bottom_m, 0.0..=HIGHEST_M, "m of bottom_m")?;
    if top_m <= bottom_m || top_m.is_nan() {
        return Err(objection(
            key,
            format!("top_m = {top_m} is not above bottom_m = {bottom_m}"),
            "give the lower height as bottom_m, the higher as top_m",
        ));
    }
    within(key, echo, 0.0..=1.0, "as echo")
}
