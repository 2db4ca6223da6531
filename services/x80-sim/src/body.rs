//! Body: a solid disc or polygon on two driven wheels or a car's.

use common::{
    kinematics::{DifferentialDrive, Pose2, Twist},
    mission::{Footprint, Mission, Shove},
};
use glam::DVec2;

use crate::world::{Surface, World};

/// Distance from which a contact ends.
const RELEASE_M: f64 = 0.005;
/// Maximum pushes out of obstacles; corners take two.
const PUSHES: usize = 4;
const NOTHING: (f64, Option<DVec2>) = (f64::INFINITY, None);

pub struct Body {
    drive: DifferentialDrive,
    /// True track, metres; W is the nominal one.
    pub track: f64,
    pub radius: f64,
    footprint: Option<Footprint>,
    pub pose: Pose2,
    pub clearance: f64,
    touching: bool,
    over_hole: bool,
    /// Contacts, each counted once however long it lasts.
    pub contacts: u64,
}

impl Body {
    pub fn new(mission: &Mission, world: &World, track_scale: f64) -> Self {
        let body = mission.body();
        let track = body.track_m * track_scale;
        let pose = mission.start_pose();
        let mut it = Self {
            drive: DifferentialDrive { track, ..body.unlimited() },
            track,
            radius: body.radius_m,
            footprint: body.footprint,
            pose,
            clearance: 0.0,
            touching: false,
            over_hole: false,
            contacts: 0,
        };
        (it.clearance, _) = it.nearest(world);
        it
    }

    pub fn put(&mut self, pose: Pose2, contacts: u64, world: &World) {
        self.pose = pose;
        self.contacts = contacts;
        (self.clearance, _) = self.nearest(world);
        self.touching = self.clearance <= RELEASE_M;
    }

    /// Radians counter-clockwise from the body's axis.
    pub fn touched_at(&self, world: &World) -> Option<f64> {
        let is_near = self.clearance <= RELEASE_M;
        let (_, outward) = is_near.then(|| self.nearest(world))?;
        Some(self.pose.axis().angle_to(-outward?))
    }

    /// Moves as both wheels ask, metres of ground. On contact the body slides along the obstacle,
    /// or halts. Returns the ground covered by each wheel.
    pub fn roll(&mut self, asked: [f64; 2], world: &World) -> [f64; 2] {
        let step = self.drive.twist(asked.map(|metres| metres / self.drive.radius));
        let Some(arc) = self.go(step, world) else {
            return asked;
        };
        let half_turn = step.omega * self.track / 2.0;
        [arc - half_turn, arc + half_turn]
    }

    /// Moves by `step`, metres and radians, until an obstacle blocks it. Returns the metres ahead
    /// on contact.
    pub fn go(&mut self, step: Twist, world: &World) -> Option<f64> {
        let before = self.pose;
        self.pose = before.along_arc(step.v, step.omega);
        let touched = self.leave_things(before, world);
        let clear = self.clearance > RELEASE_M;
        self.contacts += u64::from(touched && !self.touching);
        self.touching = touched || (self.touching && !clear);
        let aside = self.track / 2.0 * self.pose.axis().perp();
        let over_hole =
            [aside, -aside].into_iter().any(|wheel| world.is_hole(self.pose.position + wheel));
        self.contacts += u64::from(over_hole && !self.over_hole);
        self.over_hole = over_hole;
        let middle = DVec2::from_angle(before.heading + step.omega / 2.0);
        touched.then(|| (self.pose.position - before.position).dot(middle))
    }

    /// Moves the body as another force does, unless something is in the way.
    pub fn shove(&mut self, shove: &Shove, dt: f64, world: &World) {
        let before = self.pose;
        self.pose.position += shove.velocity_m_s * dt;
        self.pose.heading += shove.turn_deg_s.to_radians() * dt;
        let (clearance, _) = self.nearest(world);
        if clearance > RELEASE_M {
            self.clearance = clearance;
        } else {
            self.pose = before;
        }
    }

    /// Moves the body out of obstacles, or back to `before` if that fails. Returns whether it
    /// penetrated any.
    fn leave_things(&mut self, before: Pose2, world: &World) -> bool {
        for push in 0..PUSHES {
            let (gap, outward) = self.nearest(world);
            self.clearance = gap;
            if gap >= 0.0 {
                return push > 0;
            }
            let Some(outward) = outward else {
                break;
            };
            // The margin avoids endless penetration by rounding.
            self.pose.position += outward * (1e-9 - gap);
        }
        (self.clearance, _) = self.nearest(world);
        if self.clearance < 0.0 {
            self.pose.position = before.position;
            if self.footprint.is_some() {
                self.pose.heading = before.heading;
            }
            (self.clearance, _) = self.nearest(world);
        }
        true
    }

    /// Returns the nearest obstacle's distance, negative inside, and direction to the body.
    fn nearest(&self, world: &World) -> (f64, Option<DVec2>) {
        let position = self.pose.position;
        let Some(footprint) = self.footprint else {
            let gaps = world.touchable().map(|it| (it.distance(position) - self.radius, it));
            let nearest = gaps.min_by(|(a, _), (b, _)| a.total_cmp(b));
            return nearest.map_or(NOTHING, |(gap, surface)| (gap, surface.outward(position)));
        };
        let axis = self.pose.axis();
        let local = |at: DVec2| DVec2::new(axis.x, -axis.y).rotate(at - position);
        let mut nearest = NOTHING;
        for surface in world.touchable() {
            let at_least = surface.distance(position) - self.radius;
            if nearest.0 < at_least {
                continue;
            }
            let (gap, out) = match surface {
                Surface::Drum { at, radius } => {
                    let (gap, out) = footprint.gap_to_point(local(at));
                    (gap - radius, out)
                }
                Surface::Face { from, to } => footprint.gap_to_face(local(from), local(to)),
            };
            if gap < nearest.0 {
                nearest = (gap, Some(-axis.rotate(out)));
            }
        }
        nearest
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{mission, near};

    fn at_start(text: &str) -> (Body, World) {
        let mission = mission(text);
        (Body::new(&mission, &World::new(&mission), 1.0), World::new(&mission))
    }

    /// Rolls in steps of 5 mm, into nothing. Returns the way of the left wheel.
    fn roll(body: &mut Body, world: &World, steps: i32) -> f64 {
        let step = |_| {
            let way = body.roll([0.005 * f64::from(steps.signum()); 2], world)[0];
            assert!(body.clearance >= 0.0);
            way
        };
        (0..steps.abs()).map(step).sum()
    }

    #[test]
    fn a_wall_holds_the_body_and_its_wheels_and_is_one_contact() {
        let (mut body, world) = at_start("world.wall = [{ points = [[1, -2], [1, 2]] }]");
        let rolled = roll(&mut body, &world, 400);
        near(body.pose.position.x, 0.81, 1e-6);
        near(rolled, 0.81, 1e-6);
        assert_eq!(body.contacts, 1);
        roll(&mut body, &world, -40);
        roll(&mut body, &world, 80);
        // It came back.
        assert_eq!(body.contacts, 2);
    }

    #[test]
    fn an_oblique_wall_lets_the_body_slide_along_it_and_a_corner_halts_it() {
        let (mut body, world) = at_start("world.wall = [{ points = [[0.3, -1], [2.3, 1]] }]");
        roll(&mut body, &world, 600);
        assert!(body.pose.position.y > 0.1, "it slid to {:?}", body.pose);
        assert_eq!(body.contacts, 1);
        let (mut body, world) =
            at_start("world.wall = [{ points = [[0.2, -1.5], [1.2, 0], [0.2, 1.5]] }]");
        roll(&mut body, &world, 600);
        assert!(body.pose.position.x < 1.0);
    }

    const LONG: &str = "robot.footprint = [[-0.1, -0.1], [0.4, -0.1], [0.4, 0.1], [-0.1, 0.1]]\n";

    #[test]
    fn a_long_body_drives_through_a_gap_that_its_circle_does_not_fit_and_touches_nothing() {
        let walls = "world.wall = [{ points = [[0.5, 0.15], [3, 0.15]] }, { points = [[0.5, -0.15], [3, -0.15]] }]";
        let (mut body, world) = at_start(&format!("{LONG}{walls}"));
        roll(&mut body, &world, 400);
        assert!((body.pose.position.x - 2.0).abs() < 1e-9 && body.contacts == 0);
        near(body.clearance, 0.05, 1e-9);
    }

    #[test]
    fn a_long_body_that_turns_touches_a_wall_with_its_corner_and_goes_into_nothing() {
        for shape in [
            "wall = [{ points = [[-2, 0.5], [2, 0.5]] }]",
            "drum = [{ at = [0, 1], radius_m = 0.5 }]",
        ] {
            let (mut body, world) = at_start(&format!("{LONG}world.{shape}"));
            let position = DVec2::new(0.0, 0.2);
            body.put(Pose2 { position, heading: 0.0 }, 0, &world);
            for _ in 0..400 {
                body.roll([-0.001, 0.001], &world);
                assert!(body.clearance >= 0.0, "it went into it: {shape}");
            }
            assert!(body.contacts >= 1, "{shape}");
        }
    }
}
