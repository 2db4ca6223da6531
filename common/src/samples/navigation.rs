//! Where the robot is, what is around it, and where it goes.

use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{
    bus::ZeroCopySend,
    geometry::{Zone, principal_axes},
    grid::Part,
    kinematics::{Pose2, Twist},
    mission::{INFRARED_RANGERS, Mission, Waypoint},
};

payloads! {
    /// The pose follows from the wheels, and from what came on `fix` and `turn`.
    #[derive(Serialize, Deserialize)]
    "firsthand.Pose" PoseSample {
        /// Metres in the mission frame.
        x_m: f64,
        y_m: f64,
        /// theta, radians counter-clockwise from x; not wrapped.
        heading_rad: f64,
        /// v over the last tick, m/s.
        v_m_s: f64,
        /// omega over the last tick, rad/s.
        omega_rad_s: f64,
        travelled_m: f64,
        /// Covariance of the error of (x, y, theta): xx, xy, x theta, yy, y theta, theta theta; m^2, m rad, rad^2. It covers the wheels'
        /// errors by the mission's `[robot.odometry]`, and motions lost with their counts.
        covariance: [f64; 6],
        /// The encoder counts at this pose.
        left_counts: u16,
        right_counts: u16,
        /// The pose of the odometry frame in the mission frame (map from odom of REP 105): x, y, theta; metres, radians. Odometry is
        /// this pose without the corrections by fixes and gyro, and continuous.
        map_from_odom: [f64; 3],
        /// Times that fixes which agree contradicted the pose, and it became theirs, and that an operator set it; each resets the map.
        relocations: u64,
        fixes: u64,
        fixes_refused: u64,
        /// The reason of the newest refusal: a [`FixRefusal`](super::FixRefusal).
        refusal: u8,
    }
}

impl PoseSample {
    pub const fn pose(&self) -> Pose2 {
        Pose2 { position: DVec2::new(self.x_m, self.y_m), heading: self.heading_rad }
    }

    /// The pose in the odometry frame, which no correction moves.
    pub fn odometry(&self) -> Pose2 {
        let ([x, y, turn], Pose2 { position, heading }) = (self.map_from_odom, self.pose());
        let position = DVec2::from_angle(-turn).rotate(position - DVec2::new(x, y));
        Pose2 { position, heading: heading - turn }
    }

    /// The 6x6 covariance of ROS messages, by rows: x, y, z and the rotations about them; only x, y and the last are estimated.
    pub fn covariance_6x6(&self) -> [f64; 36] {
        let [xx, xy, xt, yy, yt, tt] = self.covariance;
        let mut whole = [0.0; 36];
        for (row, values) in [(0, [xx, xy, xt]), (1, [xy, yy, yt]), (5, [xt, yt, tt])] {
            for (col, value) in [0, 1, 5].into_iter().zip(values) {
                whole[row * 6 + col] = value;
            }
        }
        whole
    }

    pub fn position_rms_m(&self) -> f64 {
        let [xx, _, _, yy, ..] = self.covariance;
        (xx + yy).max(0.0).sqrt()
    }

    /// Two standard deviations of the position's error along its worst axis, metres.
    pub fn position_within_m(&self) -> f64 {
        let ([worst, _], _) = self.position_axes();
        2.0 * worst
    }

    pub fn position_axes(&self) -> ([f64; 2], f64) {
        let [xx, xy, _, yy, ..] = self.covariance;
        principal_axes([xx, xy, yy])
    }

    /// Whether the position is sure enough for an arrival: two standard deviations are within the mission's `sure_within_m`.
    pub fn is_sure(&self, mission: &Mission) -> bool {
        self.position_within_m() <= mission.sure_within_m
    }

    pub const fn twist(&self) -> Twist {
        Twist { v: self.v_m_s, omega: self.omega_rad_s }
    }
}

/// The most sonar readings in a `grid` sample: 128 ticks of three sonars.
pub const CLEAR_BEAMS: usize = 3 * 128;

structs! {
    /// One reading as evidence of free ground: for a sonar, nothing square to the beam stands nearer than `clear_m`.
    #[derive(Serialize, Deserialize)]
    "firsthand.ClearBeam" ClearBeam {
        /// The sensor's place, metres in the mission frame.
        x_m: f32,
        y_m: f32,
        /// The direction of the sensor, radians counter-clockwise from x.
        bearing_rad: f32,
        clear_m: f32,
    }
}

/// The most infrared rays in a `grid` sample: 32 ticks.
pub const CLEAR_RAYS: usize = 32 * INFRARED_RANGERS;

/// The most movers in a `grid` sample.
pub const MOVERS: usize = 32;

structs! {
    /// A thing that moves, as a disc, at the time of the tick; in the mission's frame.
    #[derive(Serialize, Deserialize)]
    "firsthand.Mover" Mover {
        x_m: f32,
        y_m: f32,
        vx_m_s: f32,
        vy_m_s: f32,
        radius_m: f32,
        /// Deviations of the place, and of the velocity, along any axis.
        doubt_m: f32,
        doubt_m_s: f32,
    }
}

payloads! {
    /// The slice is one [`crate::grid::CellState`] byte a cell of the window.
    "firsthand.GridHeader" GridHeader {
        part: Part,
        /// Range samples that have put a hazard on the map.
        safety_events: u64,
        /// Each reset of the sensed belief begins another epoch.
        epoch: u64,
        /// 0 by the paper's method.
        clear_beam_count: u64,
        /// The newest sonar readings, oldest first.
        clear_beams: [ClearBeam; CLEAR_BEAMS],
        /// 0 without infrared rangers in the evidence.
        clear_ray_count: u64,
        /// The newest infrared readings, oldest first: nothing stands on the ray nearer than `clear_m`, at any angle.
        clear_rays: [ClearBeam; CLEAR_RAYS],
        /// 0 without a laser.
        mover_count: u64,
        /// Things that move, also out of sight for a while.
        movers: [Mover; MOVERS],
    }
}

impl GridHeader {
    pub fn clear_beams(&self) -> &[ClearBeam] {
        counted(&self.clear_beams, self.clear_beam_count)
    }

    pub fn clear_rays(&self) -> &[ClearBeam] {
        counted(&self.clear_rays, self.clear_ray_count)
    }

    pub fn movers(&self) -> &[Mover] {
        counted(&self.movers, self.mover_count)
    }

    /// Movers that can be drawn: any process may have written the numbers of a sample.
    pub fn drawn_movers(&self) -> impl Iterator<Item = &Mover> {
        self.movers().iter().filter(|mover| {
            let Mover { x_m, y_m, vx_m_s, vy_m_s, radius_m, doubt_m, doubt_m_s } = **mover;
            let lengths = [radius_m, doubt_m, doubt_m_s];
            let is_finite = [x_m, y_m, vx_m_s, vy_m_s].into_iter().all(f32::is_finite);
            is_finite && lengths.into_iter().all(|it| (0.0..f32::INFINITY).contains(&it))
        })
    }
}

impl Mover {
    pub fn place(&self) -> DVec2 {
        DVec2::new(self.x_m.into(), self.y_m.into())
    }

    pub fn velocity(&self) -> DVec2 {
        DVec2::new(self.vx_m_s.into(), self.vy_m_s.into())
    }

    /// Its place is within so many metres of its surface with 95 %, along any axis: two deviations.
    pub fn reach_m(&self) -> f64 {
        f64::from(self.radius_m) + 2.0 * f64::from(self.doubt_m)
    }
}

/// The first `count` of `all`; the count comes from shared memory and may be any number.
fn counted<T>(all: &[T], count: u64) -> &[T] {
    let count = usize::try_from(count).unwrap_or(all.len());
    &all[..count.min(all.len())]
}

wire_enum! {
    GuidanceStatus, unknown = Waiting {
        /// No field yet, or something that moves must pass first: the robot stands.
        Waiting = 0,
        Along = 1,
        /// Arrived beside the target, which is not free itself: no free place is nearer.
        AtTarget = 2,
        /// The robot stands in a hazard cell: (ex, ey) leads to the nearest free one.
        WayOut = 3,
        /// The belief cuts the robot off from the target; (ex, ey), unless 0, says where to look meanwhile.
        Unreachable = 4,
        /// Nobody has looked where the way leads: turn on the spot to face (ex, ey).
        Look = 5,
    }
}

structs! {
    #[derive(Serialize, Deserialize)]
    "firsthand.TargetPoint" TargetPoint {
        /// X_T, metres in the mission frame.
        x_m: f64,
        y_m: f64,
        /// Radians counter-clockwise from x.
        heading_rad: f64,
        /// 1: an arrival needs `heading_rad` too.
        has_heading: u8,
    }
}

impl TargetPoint {
    pub fn at(place: DVec2) -> Self {
        Self { x_m: place.x, y_m: place.y, ..Self::default() }
    }

    pub const fn position(&self) -> DVec2 {
        DVec2::new(self.x_m, self.y_m)
    }

    pub fn heading(&self) -> Option<f64> {
        (self.has_heading == 1).then_some(self.heading_rad)
    }
}

pub use crate::mission::MOST_TARGETS;

impl From<Waypoint> for TargetPoint {
    fn from(Waypoint { at, heading_deg }: Waypoint) -> Self {
        Self {
            heading_rad: heading_deg.unwrap_or_default().to_radians(),
            has_heading: heading_deg.is_some().into(),
            ..Self::at(at)
        }
    }
}

payloads! {
    /// The keep-out zones. The slice is their corners.
    "firsthand.ZonesHeader" ZonesHeader {
        /// Counts the changes by operators; 0: the mission's.
        number: u64,
    }
}

structs! {
    "firsthand.ZoneCorner" ZoneCorner {
        /// Corners of the same zone follow each other.
        zone: u32,
        x_m: f64,
        y_m: f64,
    }
}

impl ZoneCorner {
    pub fn of(zones: &[Zone]) -> Vec<Self> {
        let corners =
            (0..).zip(zones).flat_map(|(zone, it)| it.points.iter().map(move |at| (zone, at)));
        corners.map(|(zone, at)| Self { zone, x_m: at.x, y_m: at.y }).collect()
    }

    pub fn zones(corners: &[Self]) -> Vec<Zone> {
        let zones = corners.chunk_by(|one, next| one.zone == next.zone);
        let zone = |corners: &[Self]| corners.iter().map(|at| DVec2::new(at.x_m, at.y_m)).collect();
        zones.map(|corners| Zone { points: zone(corners) }).collect()
    }
}

payloads! {
    "firsthand.Target" TargetSample {
        /// Counted from 1 in the run. A target that replaces another has a number of its own.
        number: u64,
        last: u64,
        /// The first tick in which it holds. A stage without another target takes it at once.
        since_tick: u64,
        target: TargetPoint,
        /// The targets after this one; the first `last - number` count.
        ahead: [TargetPoint; MOST_TARGETS],
    }
}

impl TargetSample {
    pub fn first(mission: &Mission) -> Self {
        Self { number: 1, last: 1, target: TargetPoint::at(mission.target), ..Self::default() }
    }

    pub fn ahead(&self) -> &[TargetPoint] {
        let count = usize::try_from(self.last.saturating_sub(self.number)).unwrap_or(MOST_TARGETS);
        &self.ahead[..count.min(MOST_TARGETS)]
    }
}

payloads! {
    /// E of (11) at the robot's pose.
    "firsthand.Guidance" GuidanceSample {
        /// (ex, ey): unit vector, 0 where there is none.
        ex: f64,
        ey: f64,
        /// dst of (14): straight to the target, metres.
        distance_m: f64,
        /// The most tangential speed by the map of the way ahead, m/s; infinite for no limit.
        speed_limit_m_s: f64,
        /// A [`GuidanceStatus`].
        status: u8,
        /// Mission time of the pose, nanoseconds.
        pose_ns: u64,
        /// The pose: metres in the mission frame, radians counter-clockwise from x, not wrapped.
        x_m: f64,
        y_m: f64,
        heading_rad: f64,
        /// The version of `grid`; its safety events and epoch follow.
        grid_version: u64,
        safety_events: u64,
        epoch: u64,
        full_solves: u64,
        full_solve_ns: u64,
        /// 0 for none.
        target_number: u64,
        target: TargetPoint,
    }
}

impl GuidanceSample {
    pub fn for_pose(pose: &PoseSample, belief: &GridHeader, target: &TargetSample) -> Self {
        Self {
            target_number: target.number,
            target: target.target,
            distance_m: target.target.position().distance(pose.pose().position),
            pose_ns: pose.stamp.stamp_ns,
            x_m: pose.x_m,
            y_m: pose.y_m,
            heading_rad: pose.heading_rad,
            safety_events: belief.safety_events,
            epoch: belief.epoch,
            ..Self::default()
        }
    }

    pub const fn pose(&self) -> Pose2 {
        Pose2 { position: DVec2::new(self.x_m, self.y_m), heading: self.heading_rad }
    }
}

payloads! {
    /// The slice is one [`FieldCell`] a cell of the window.
    "firsthand.FieldHeader" FieldHeader {
        part: Part,
        /// The version of `grid`.
        grid_version: u64,
        target_x_m: f64,
        target_y_m: f64,
        /// The worst componentwise relative residual of the last full solve, a verification.
        worst_residual: f64,
        /// Free cells that can reach the target, a verification.
        reachable: u64,
    }
}

structs! {
    "firsthand.FieldCell" FieldCell {
        /// (ex, ey) at the cell's centre: unit vector, 0 where there is no guidance.
        ex: f32,
        ey: f32,
        /// log2 u; -inf on hazards and where the target cannot be reached.
        log2_u: f32,
    }
}

wire_enum! {
    CommandState, unknown = Halt {
        /// No guidance to follow: stand.
        Halt = 0,
        Driving = 1,
        /// The target is reached: stand until there is another.
        Arrived = 2,
    }
}

payloads! {
    /// U of (17).
    "firsthand.Command" CommandSample {
        /// omega_L, rad/s; omega_h of a car's driven wheel.
        left_rad_s: f64,
        /// omega_R, rad/s; of a car the steering angle phi, radians, positive to the left: `robot.model` decides.
        right_rad_s: f64,
        /// vc of (16), m/s.
        v_m_s: f64,
        /// wc of (15), rad/s.
        omega_rad_s: f64,
        /// dst of (14), metres.
        distance_m: f64,
        /// Mission time of the oldest pose behind it, the guidance's among them, nanoseconds. The link refuses an old one, whatever the
        /// stamp says.
        pose_ns: u64,
        /// Mission time of the guidance, nanoseconds; the link checks its age too.
        guidance_ns: u64,
        /// The target that it leads to, or that is reached.
        target_number: u64,
        /// A [`CommandState`].
        state: u8,
    }
}
