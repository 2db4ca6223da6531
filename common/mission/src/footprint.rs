//! Convex outline of a body around the origin of the robot's frame, metres.

use glam::DVec2;

use crate::{
    geometry::{nearest_on_segment, ring},
    kinematics::Pose2,
};

const MOST_CORNERS: usize = 16;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// Counter-clockwise; only the first `count` are valid.
    corners: [DVec2; MOST_CORNERS],
    count: usize,
}

impl Footprint {
    /// # Errors
    /// If the corners do not form a convex polygon around the origin in order; the error says why.
    pub fn new(corners: &[DVec2]) -> Result<Self, &'static str> {
        if !(3..=MOST_CORNERS).contains(&corners.len()) {
            return Err("it needs 3 to 16 corners");
        }
        if !corners.iter().all(|corner| corner.abs().max_element() <= 5.0) {
            return Err("its corners must lie within 5 m");
        }
        let mut footprint = Self { corners: [DVec2::ZERO; MOST_CORNERS], count: corners.len() };
        footprint.corners[..corners.len()].copy_from_slice(corners);
        let doubled_area: f64 = footprint.edges().map(|(from, to)| from.perp_dot(to)).sum();
        if doubled_area < 0.0 {
            footprint.corners[..corners.len()].reverse();
        }
        let all = footprint.corners();
        let turns = |index: usize| {
            let [one, two, three] = [0, 1, 2].map(|next| all[(index + next) % all.len()]);
            (two - one).perp_dot(three - two)
        };
        // Left turns alone also fit an outline that winds more than once, whose angles exceed a
        // full turn.
        let around: f64 = footprint.edges().map(|(from, to)| from.angle_to(to)).sum();
        if !(0..all.len()).all(|index| turns(index) > 1e-9) || around > 1.5 * std::f64::consts::TAU
        {
            return Err("it must be convex, with its corners in order and no three in a line");
        }
        if footprint.inscribed_m() < 0.01 {
            return Err("the robot's origin, between its wheels, must lie at least 0.01 m inside");
        }
        assert!(footprint.inscribed_m() <= footprint.circumscribed_m() + 1e-9);
        assert!(footprint.half_widths_m()[0] >= footprint.inscribed_m() - 1e-9);
        Ok(footprint)
    }

    pub fn corners(&self) -> &[DVec2] {
        &self.corners[..self.count]
    }

    pub fn corners_at(&self, pose: Pose2) -> impl Iterator<Item = DVec2> + '_ {
        self.corners().iter().map(move |corner| pose.position + pose.axis().rotate(*corner))
    }

    pub fn circumscribed_m(&self) -> f64 {
        self.corners().iter().map(|corner| corner.length()).fold(0.0, f64::max)
    }

    pub fn inscribed_m(&self) -> f64 {
        -self.sides().map(|(from, out)| -out.dot(from)).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Returns the smaller and the larger of the extents to the left and to the right of x.
    ///
    /// Obstacles grow by the smaller, so that no passage in which the body fits closes; the planner
    /// then checks the outline itself. The body sweeps ground up to the larger.
    pub fn half_widths_m(&self) -> [f64; 2] {
        let aside = |side: f64| self.corners().iter().map(|at| side * at.y).fold(0.0, f64::max);
        let [left, right] = [1.0, -1.0].map(aside);
        [left.min(right), left.max(right)]
    }

    /// Returns points of the outline at most `step_m` apart.
    pub fn outline(&self, step_m: f64) -> impl Iterator<Item = DVec2> + '_ {
        self.edges().flat_map(move |(from, to)| {
            let steps = (from.distance(to) / step_m).ceil().max(1.0) as u32;
            (0..steps).map(move |step| from.lerp(to, f64::from(step) / f64::from(steps)))
        })
    }

    pub fn edges(&self) -> impl Iterator<Item = (DVec2, DVec2)> + '_ {
        ring(self.corners())
    }

    fn sides(&self) -> impl Iterator<Item = (DVec2, DVec2)> + '_ {
        self.edges().map(|(from, to)| (from, -(to - from).perp().normalize_or_zero()))
    }

    /// Returns the distance from the body to `point` in its frame, metres (negative inside), and
    /// the unit direction.
    pub fn gap_to_point(&self, point: DVec2) -> (f64, DVec2) {
        let inside = greatest(self.sides().map(|(from, out)| (out.dot(point - from), out)));
        if inside.0 <= 0.0 {
            return inside;
        }
        let nearest = self.edges().map(|(from, to)| nearest_on_segment(point, from, to));
        least(nearest.map(|near| (near, point)))
    }

    /// Returns the distance from the body to a straight face in its frame, metres, and the unit
    /// direction. Negative distances are overlap along the direction.
    pub fn gap_to_face(&self, from: DVec2, to: DVec2) -> (f64, DVec2) {
        let Some(across) = (to - from).perp().try_normalize() else {
            return self.gap_to_point(from);
        };
        let sides = self
            .sides()
            .map(|(corner, out)| (out.dot(from - corner).min(out.dot(to - corner)), out));
        let faces = [across, -across].map(|out| {
            let beyond = self.corners().iter().map(|corner| out.dot(from - *corner));
            (beyond.fold(f64::INFINITY, f64::min), out)
        });
        let overlap = greatest(sides.chain(faces));
        if overlap.0 <= 0.0 {
            return overlap;
        }
        let corners = self.corners().iter().map(|at| (*at, nearest_on_segment(*at, from, to)));
        let ends = self.edges().flat_map(|(one, other)| {
            [from, to].map(|end| (nearest_on_segment(end, one, other), end))
        });
        least(corners.chain(ends))
    }
}

fn greatest(gaps: impl Iterator<Item = (f64, DVec2)>) -> (f64, DVec2) {
    gaps.fold((f64::NEG_INFINITY, DVec2::X), |best, gap| if gap.0 > best.0 { gap } else { best })
}

fn least(pairs: impl Iterator<Item = (DVec2, DVec2)>) -> (f64, DVec2) {
    pairs.fold((f64::INFINITY, DVec2::X), |best, (body, thing)| {
        let distance = body.distance(thing);
        if distance < best.0 { (distance, (thing - body).normalize_or(DVec2::X)) } else { best }
    })
}

#[cfg(test)]
mod tests {
    use std::sync::LazyLock;

    use super::*;

    static LONG: LazyLock<Footprint> = LazyLock::new(|| {
        let corners = [[-0.2, -0.1], [0.3, -0.1], [0.3, 0.1], [-0.2, 0.1]];
        Footprint::new(&corners.map(DVec2::from)).unwrap()
    });

    fn close((gap, out): (f64, DVec2), want: f64, along: DVec2) {
        assert!((gap - want).abs() < 1e-12 && out.distance(along) < 1e-9, "{gap} {out}");
    }

    #[test]
    fn gaps_of_a_polygon_are_to_its_sides_and_corners_and_negative_inside() {
        close(LONG.gap_to_point(DVec2::new(0.5, 0.05)), 0.2, DVec2::X);
        close(LONG.gap_to_point(DVec2::new(0.6, 0.5)), 0.5, DVec2::new(0.6, 0.8));
        close(LONG.gap_to_point(DVec2::new(0.0, -0.09)), -0.01, -DVec2::Y);
        let face = |from: [f64; 2], to: [f64; 2]| LONG.gap_to_face(from.into(), to.into());
        close(face([0.4, -5.0], [0.4, 5.0]), 0.1, DVec2::X);
        close(face([-5.0, 0.15], [0.0, 0.15]), 0.05, DVec2::Y);
        close(face([0.6, 0.5], [0.6, 5.0]), 0.5, DVec2::new(0.6, 0.8));
        close(face([-5.0, 0.08], [5.0, 0.08]), -0.02, DVec2::Y);
        close(face([0.29, 0.0], [5.0, 0.0]), -0.01, DVec2::X);
    }

    #[test]
    fn a_footprint_is_a_convex_polygon_around_the_origin_in_either_order() {
        let mut corners = LONG.corners().to_vec();
        assert_eq!(Footprint::new(&corners), Ok(*LONG));
        assert!((LONG.inscribed_m() - 0.1).abs() < 1e-12);
        assert_eq!(LONG.half_widths_m(), [0.1, 0.1]);
        let aside = [[-0.2, -0.3], [0.3, -0.3], [0.3, 0.1], [-0.2, 0.1]].map(DVec2::from);
        assert_eq!(Footprint::new(&aside).map(|it| it.half_widths_m()), Ok([0.1, 0.3]));
        assert!((LONG.circumscribed_m() - 0.1_f64.hypot(0.3)).abs() < 1e-12);
        corners.reverse();
        assert!(Footprint::new(&corners).is_ok());
        corners.swap(0, 1);
        let beside = LONG.corners().iter().map(|corner| *corner + DVec2::Y).collect::<Vec<_>>();
        let star =
            [0, 2, 4, 1, 3].map(|k| DVec2::from_angle(f64::from(k) * 0.4 * std::f64::consts::PI));
        // The first one crosses itself.
        for wrong in [&corners[..], &corners[..2], &beside, &star, &[DVec2::NAN; 4]] {
            assert!(Footprint::new(wrong).is_err(), "{wrong:?}");
        }
    }
}
