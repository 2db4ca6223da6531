use common::{geometry::principal_axes, kinematics::Pose2};
use glam::DVec2;

use super::{
    page::{Path, Px, View, ink, round_up},
    scene::Scene,
};

/// Limits the file, even after a day at 7 Hz.
const MOST_POSES: usize = 4000;
/// Approximate number of bodies along the trajectory.
const BODIES: f64 = 16.0;
/// Standard deviations that contain 95 % of a planar normal distribution: the root of -2 ln 0.05.
const WITHIN_95: f64 = 2.4477;

pub(super) struct Motion<'a> {
    scene: &'a Scene<'a>,
    /// True poses, or else the believed ones.
    way: &'a [Pose2],
    /// Mission time between two bodies, and poses from one to the next.
    every: Option<(f64, f64)>,
}

impl<'a> Motion<'a> {
    pub(super) fn of(scene: &'a Scene<'a>) -> Self {
        let way = if scene.truth.is_empty() { scene.believed } else { scene.truth };
        let duration = scene.facts.mission_time_s;
        let steps = way.len().saturating_sub(1);
        let is_timed = steps > 0 && duration.is_finite() && duration > 0.0;
        let every = is_timed.then(|| {
            let seconds = round_up(duration / BODIES);
            (seconds, seconds / duration * steps as f64)
        });
        Self { scene, way, every }
    }

    pub(super) const fn has_truth(&self) -> bool {
        !self.scene.truth.is_empty()
    }

    pub(super) const fn has_belief(&self) -> bool {
        !self.scene.believed.is_empty()
    }

    pub(super) const fn has_covariance(&self) -> bool {
        self.scene.covariance.is_some() && self.has_belief()
    }

    pub(super) fn period_s(&self) -> Option<f64> {
        self.every.map(|(seconds, _)| seconds)
    }

    pub(super) fn instants(&self) -> impl Iterator<Item = (f64, &'a Pose2)> {
        (0..).map(f64::from).map_while(|nth| {
            let (seconds, stride) = self.every?;
            Some((nth * seconds, self.way.get((nth * stride).round() as usize)?))
        })
    }

    pub(super) fn layer(&self, view: &View) -> String {
        let start = self.scene.mission.start_pose();
        let ring = view.px(self.scene.mission.arrival_tolerance_m);
        let mut targets = self.scene.targets.to_vec();
        if targets.is_empty() {
            targets.extend(self.scene.mission.waypoints().iter().map(|waypoint| waypoint.at));
        }
        let [truth, believed] =
            [self.scene.truth, self.scene.believed].map(|poses| trajectory(view, poses));
        let believed_last = self.scene.believed.last().filter(|_| self.has_truth());
        [
            targets.into_iter().map(|at| target(view.place(at), ring)).collect(),
            halo(&truth),
            halo(&believed),
            self.bodies(view, self.instants().map(|(_, pose)| pose), BODY),
            truth.element(&truth_line()),
            believed.element(&believed_line()),
            start_mark(view.place(start.position)),
            self.bodies(view, self.way.last(), &final_body()),
            self.bodies(view, believed_last, &believed_end()),
            self.region(view),
        ]
        .concat()
    }

    fn bodies<'p>(
        &self,
        view: &View,
        poses: impl IntoIterator<Item = &'p Pose2>,
        style: &str,
    ) -> String {
        let body = self.scene.mission.body();
        let radius = view.px(body.radius_m);
        let mut outlines = Path::default();
        for pose in poses.into_iter().filter(|pose| is_shown(view, pose)) {
            add_body(&mut outlines, view.place(pose.position), radius, pose.heading);
            if let Some(footprint) = &body.footprint {
                outlines.polygon(footprint.corners_at(*pose).map(|corner| view.place(corner)));
            }
        }
        outlines.element(style)
    }

    /// Draws the 95 % ellipse of the robot's centre.
    fn region(&self, view: &View) -> String {
        let (Some(covariance), Some(end)) = (self.scene.covariance, self.scene.believed.last())
        else {
            return String::new();
        };
        let ([long, short], angle) = principal_axes(covariance);
        let axes = [long, short].map(|sigma| Px(view.px(WITHIN_95 * sigma)));
        let drawn = is_shown(view, end) && long.is_finite() && view.px(long) > 0.5;
        if !drawn {
            return String::new();
        }
        let at = view.place(end.position);
        // The sheet's y axis points down.
        let angle = Px(-angle.to_degrees());
        format!(
            "<ellipse rx=\"{}\" ry=\"{}\" transform=\"translate({} {}) rotate({angle})\" {}/>\n",
            axes[0],
            axes[1],
            Px(at.x),
            Px(at.y),
            region_style()
        )
    }
}

pub(super) const BODY: &str = "fill=\"#fff\" fill-opacity=\"0.45\" stroke=\"#0b0f14\" \
     stroke-width=\"1\" stroke-opacity=\"0.75\"";

pub(super) fn final_body() -> String {
    format!("fill=\"{0}\" fill-opacity=\"0.35\" stroke=\"{0}\" stroke-width=\"1.8\"", ink::TRUTH)
}

fn believed_end() -> String {
    format!(
        "fill=\"none\" stroke=\"{}\" stroke-width=\"1.4\" stroke-dasharray=\"3 2.4\"",
        ink::BELIEVED
    )
}

pub(super) fn region_style() -> String {
    format!(
        "fill=\"{0}\" fill-opacity=\"0.08\" stroke=\"{0}\" stroke-width=\"1.1\" stroke-dasharray=\"1.5 2.5\"",
        ink::BELIEVED
    )
}

pub(super) fn truth_line() -> String {
    line_style(ink::TRUTH, "2.2", "none")
}

pub(super) fn believed_line() -> String {
    line_style(ink::BELIEVED, "2", "7 4.5")
}

fn line_style(colour: &str, width: &str, dashes: &str) -> String {
    format!(
        "fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\" stroke-dasharray=\"{dashes}\" \
         stroke-linejoin=\"round\""
    )
}

/// Draws a white line below, to separate a line from field and hatch.
fn halo(line: &Path) -> String {
    line.element(
        "fill=\"none\" stroke=\"#fff\" stroke-width=\"5.5\" stroke-opacity=\"0.75\" \
         stroke-linejoin=\"round\" stroke-linecap=\"round\"",
    )
}

fn trajectory(view: &View, poses: &[Pose2]) -> Path {
    let stride = poses.len().div_ceil(MOST_POSES).max(1);
    view.line(poses.iter().step_by(stride).chain(poses.last()).map(|pose| pose.position))
}

fn is_shown(view: &View, pose: &Pose2) -> bool {
    view.shows(pose.position, 0.0) && pose.heading.is_finite()
}

pub(super) fn add_body(path: &mut Path, at: DVec2, radius: f64, heading: f64) {
    path.circle(at, radius);
    // The sheet's y axis points down.
    let axis = DVec2::from_angle(-heading);
    path.polyline([at + axis * (radius * 0.35), at + axis * radius]);
}

/// Draws a ring of the tolerance around a bull's eye.
pub(super) fn target(at: DVec2, tolerance: f64) -> String {
    let (x, y, ring) = (Px(at.x), Px(at.y), Px(tolerance));
    let colour = ink::TARGET;
    format!(
        "<circle cx=\"{x}\" cy=\"{y}\" r=\"{ring}\" fill=\"{colour}\" fill-opacity=\"0.14\" \
         stroke=\"{colour}\" stroke-width=\"1.5\" stroke-dasharray=\"4 3\"/>\n\
         <circle cx=\"{x}\" cy=\"{y}\" r=\"4.5\" fill=\"{colour}\" stroke=\"#fff\" \
         stroke-width=\"1.5\"/>\n"
    )
}

pub(super) fn start_mark(at: DVec2) -> String {
    format!(
        "<rect x=\"{}\" y=\"{}\" width=\"9\" height=\"9\" fill=\"#fff\" stroke=\"{}\" \
         stroke-width=\"2\"/>\n",
        Px(at.x - 4.5),
        Px(at.y - 4.5),
        ink::TRUTH
    )
}
