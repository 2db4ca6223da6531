//! Payloads of the robot's pose, its surroundings and its goals.

use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{
    bus::ZeroCopySend,
    geometry::{Zone, principal_axes, symmetric},
    grid::Part,
    kinematics::{Pose2, Twist},
    mission::{INFRARED_RANGERS, Mission, Waypoint, wire_enum},
};

payloads! {
    /// Pose from the wheels and from samples of `fix` and `turn`.
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
        /// Covariance of the error of (x, y, theta): xx, xy, x theta, yy, y theta, theta theta;
        /// m^2, m rad, rad^2. It covers the wheel errors of `[robot.odometry]` and motion lost with
        /// its counts.
        covariance: [f64; 6],
        /// Encoder counts at this pose.
        left_counts: u16,
        right_counts: u16,
        /// Pose of the odometry frame in the mission frame (map from odom of REP 105): x, y, theta;
        /// metres, radians. Odometry is this pose without the corrections by fixes and gyro, and
        /// continuous.
        map_from_odom: [f64; 3],
        /// Times that consistent fixes replaced the contradicting pose, or an operator set it; each
        /// resets the map.
        relocations: u64,
        fixes: u64,
        fixes_refused: u64,
        /// Reason of the newest refusal: a [`FixRefusal`](super::FixRefusal).
        refusal: u8,
    }
}

impl PoseSample {
    pub const fn pose(&self) -> Pose2 {
        Pose2 { position: DVec2::new(self.x_m, self.y_m), heading: self.heading_rad }
    }

    /// Returns the pose in the odometry frame, which is free of corrections.
    pub fn odometry(&self) -> Pose2 {
        let [x, y, turn] = self.map_from_odom;
        let Pose2 { position, heading } = self.pose();
        let position = DVec2::from_angle(-turn).rotate(position - DVec2::new(x, y));
        Pose2 { position, heading: heading - turn }
    }

    /// Returns the row-major 6x6 covariance of ROS messages: x, y, z and the rotations about them,
    /// of which x, y and the last are estimated.
    pub fn covariance_6x6(&self) -> [f64; 36] {
        let mut whole = [0.0; 36];
        for (row, values) in [0, 1, 5].into_iter().zip(symmetric(self.covariance)) {
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

    /// Returns two standard deviations of the position error along its worst axis, metres.
    pub fn position_within_m(&self) -> f64 {
        let ([worst, _], _) = self.position_axes();
        2.0 * worst
    }

    pub fn position_axes(&self) -> ([f64; 2], f64) {
        let [xx, xy, _, yy, ..] = self.covariance;
        principal_axes([xx, xy, yy])
    }

    /// Returns whether two standard deviations of the position are within the mission's
    /// `sure_within_m`, as an arrival needs.
    pub fn is_sure(&self, mission: &Mission) -> bool {
        self.position_within_m() <= mission.sure_within_m
    }

    pub const fn twist(&self) -> Twist {
        Twist { v: self.v_m_s, omega: self.omega_rad_s }
    }
}

/// Most sonar readings in a `grid` sample: 128 ticks of three sonars.
pub const CLEAR_BEAMS: usize = 3 * 128;

structs! {
    /// Reading as evidence of free ground. For a sonar, nothing square to the beam is nearer than
    /// `clear_m`.
    #[derive(Serialize, Deserialize)]
    "firsthand.ClearBeam" ClearBeam {
        /// Position of the sensor, metres in the mission frame.
        x_m: f32,
        y_m: f32,
        /// Direction of the sensor, radians counter-clockwise from x.
        bearing_rad: f32,
        clear_m: f32,
    }
}

/// Most infrared rays in a `grid` sample: 32 ticks.
pub const CLEAR_RAYS: usize = 32 * INFRARED_RANGERS;

pub const MOVERS: usize = 32;

structs! {
    /// Moving thing, as a disc at the time of the tick, in the mission frame.
    #[derive(Serialize, Deserialize)]
    "firsthand.Mover" Mover {
        x_m: f32,
        y_m: f32,
        vx_m_s: f32,
        vy_m_s: f32,
        radius_m: f32,
        /// Standard deviations of the position and of the velocity along any axis.
        doubt_m: f32,
        doubt_m_s: f32,
    }
}

payloads! {
    /// Safety map; the slice has one [`crate::grid::CellState`] byte per cell of the window.
    "firsthand.GridHeader" GridHeader {
        part: Part,
        /// Range samples that added a hazard to the map.
        safety_events: u64,
        /// Epoch; each reset of the sensed belief begins another.
        epoch: u64,
        /// 0 with the paper's method.
        clear_beam_count: u64,
        /// Newest sonar readings, oldest first.
        clear_beams: [ClearBeam; CLEAR_BEAMS],
        /// 0 without infrared rangers in the evidence.
        clear_ray_count: u64,
        /// Newest infrared readings, oldest first: the ray is free up to `clear_m`, for surfaces at
        /// any angle.
        clear_rays: [ClearBeam; CLEAR_RAYS],
        /// 0 without a laser.
        mover_count: u64,
        /// Moving things, also for a while out of sight.
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

    /// Returns the movers with valid numbers, which any process may have written.
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

    /// Returns the radius that contains its surface with 95 % along any axis.
    pub fn reach_m(&self) -> f64 {
        f64::from(self.radius_m) + 2.0 * f64::from(self.doubt_m)
    }
}

/// Returns the first `count` of `all`; the count from shared memory is untrusted.
fn counted<T>(all: &[T], count: u64) -> &[T] {
    let count = usize::try_from(count).unwrap_or(all.len());
    &all[..count.min(all.len())]
}

wire_enum! {
    GuidanceStatus, unknown = Waiting {
        /// No field yet, or a moving thing must pass first: the robot stands.
        Waiting = 0,
        Along = 1,
        /// Arrived at the free place nearest to the target, which is occupied.
        AtTarget = 2,
        /// The robot is in a hazard cell: (ex, ey) leads to the nearest free one.
        WayOut = 3,
        /// The belief cuts the robot off from the target; a nonzero (ex, ey) says where to look
        /// meanwhile.
        Unreachable = 4,
        /// The path leads to unseen ground: turn on the spot to face (ex, ey).
        Look = 5,
    }
}

wire_enum! {
    Maneuver, unknown = Stand {
        Stand = 0,
        /// Along (ex, ey) within the speed limit. Below the least speed, a robot that can turn on
        /// the spot only faces (ex, ey).
        Follow = 1,
        /// On the spot to (ex, ey).
        Turn = 2,
        /// Straight back along the robot's axis, within the speed limit.
        Back = 3,
    }
}

impl GuidanceStatus {
    /// Returns the usual maneuver of a planner in this status.
    pub const fn maneuver(self) -> Maneuver {
        match self {
            Self::Along | Self::WayOut => Maneuver::Follow,
            Self::Look | Self::Unreachable => Maneuver::Turn,
            Self::Waiting | Self::AtTarget => Maneuver::Stand,
        }
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
    /// Keep-out zones; the slice holds their corners.
    "firsthand.ZonesHeader" ZonesHeader {
        /// Number of operator changes; 0 for the mission's zones.
        number: u64,
    }
}

structs! {
    "firsthand.ZoneCorner" ZoneCorner {
        /// Index of its zone; a zone's corners are adjacent.
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
        /// Counts from 1 within the run. A target that replaces another gets a new number.
        number: u64,
        last: u64,
        /// First tick in which it holds. A stage without a target takes it at once.
        since_tick: u64,
        target: TargetPoint,
        /// Targets after this one; the first `last - number` are valid.
        ahead: [TargetPoint; MOST_TARGETS],
    }
}

impl TargetSample {
    pub fn first(mission: &Mission) -> Self {
        Self { number: 1, last: 1, target: TargetPoint::at(mission.target), ..Self::default() }
    }

    pub fn ahead(&self) -> &[TargetPoint] {
        counted(&self.ahead, self.last.saturating_sub(self.number))
    }
}

payloads! {
    /// E of (11) at the robot's pose.
    "firsthand.Guidance" GuidanceSample {
        /// (ex, ey): unit vector, or 0 for none.
        ex: f64,
        ey: f64,
        /// dst of (14): straight to the target, metres.
        distance_m: f64,
        /// Greatest speed of `Follow` and `Back`, m/s, by the map of the way; infinite for no limit.
        speed_limit_m_s: f64,
        /// A [`GuidanceStatus`].
        status: u8 as GuidanceStatus,
        /// A [`Maneuver`].
        maneuver: u8 as Maneuver,
        /// Mission time of the pose, nanoseconds.
        pose_ns: u64,
        /// Pose: metres in the mission frame, radians counter-clockwise from x, not wrapped.
        x_m: f64,
        y_m: f64,
        heading_rad: f64,
        /// Version of `grid`; its safety events and epoch follow.
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

    /// Returns the speed limit as viewers show it: negative to back up.
    pub fn signed_limit_m_s(&self) -> f64 {
        let limit = self.speed_limit_m_s;
        if self.maneuver() == Maneuver::Back { -limit } else { limit }
    }
}

payloads! {
    /// Field; the slice has one [`FieldCell`] per cell of the window.
    "firsthand.FieldHeader" FieldHeader {
        part: Part,
        /// Version of `grid`.
        grid_version: u64,
        target_x_m: f64,
        target_y_m: f64,
        /// Worst componentwise relative residual of the last full solve, for verification.
        worst_residual: f64,
        /// Free cells that can reach the target, for verification.
        reachable: u64,
    }
}

structs! {
    "firsthand.FieldCell" FieldCell {
        /// (ex, ey) at the cell's centre: unit vector, or 0 without guidance.
        ex: f32,
        ey: f32,
        /// log2 u; -inf on hazards and in cells that cannot reach the target.
        log2_u: f32,
    }
}

wire_enum! {
    CommandState, unknown = Halt {
        /// No guidance to follow: stand.
        Halt = 0,
        Driving = 1,
        /// Target reached: stand until the next one.
        Arrived = 2,
    }
}

payloads! {
    /// U of (17).
    "firsthand.Command" CommandSample {
        /// omega_L, rad/s; omega_h of a car's driven wheel.
        left_rad_s: f64,
        /// omega_R, rad/s; for a car by `robot.model` the steering angle phi, radians, positive to
        /// the left.
        right_rad_s: f64,
        /// vc of (16), m/s.
        v_m_s: f64,
        /// wc of (15), rad/s.
        omega_rad_s: f64,
        /// dst of (14), metres.
        distance_m: f64,
        /// Mission time of the oldest pose behind it, including the guidance's, nanoseconds. The
        /// link refuses an old one regardless of the stamp.
        pose_ns: u64,
        /// Mission time of the guidance, nanoseconds; the link checks its age too.
        guidance_ns: u64,
        /// Target that it leads to, or that is reached.
        target_number: u64,
        /// A [`CommandState`].
        state: u8 as CommandState,
    }
}
