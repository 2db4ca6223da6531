//! The sonar model: the meaning of an echo, and of its absence, for the cells around.
//!
//! The X80's front sonar is one ultrasonic ranger: one byte of centimetres a frame, "nothing" included, from a cone of
//! about 15 degrees to either side. Every number of the evidential method's sensor model stands here.
//!
//! Angles are radians off the sonar's axis, to one side. Weights are integers in quarters of the echo that is heard in
//! the middle of its arc; positive weights are evidence for an obstacle, negative ones for free ground.

use std::f64::consts::TAU;

use common::mission::{Sensor, SensorModel};

const DEGREE: f64 = TAU / 360.0;

/// The inverse sensor model of the evidence grid, with the bounds and the ageing of evidence. [`SonarModel::default`] is the
/// X80's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SonarModel {
    /// Side of a cell of the evidence grid, metres. A third of the cone's width where a hit starts to matter: as fine as
    /// the sonar resolves, and no finer.
    pub(crate) resolution_m: f64,

    /// Half the angle over which an echo is spread, and the widest angle of the model. The cone's 15 degrees, rounded up.
    pub(crate) arc: f64,
    /// Error of an echo's range, metres: noise, the byte's centimetre, half a cell.
    pub(crate) band_m: f64,
    /// Weight of an echo in the middle of its arc.
    pub(crate) hit: f64,
    /// Weight of an echo at the end of its arc, where the sound is weakest; in between the weight falls linearly. It is 0,
    /// because a beam that points there hears an obstacle better, and gaps stay open.
    pub(crate) hit_at_edge: f64,

    /// An obstacle this far before an echo may be its cause, metres: the beam is not evidence that the ground there is free.
    pub(crate) before_m: f64,
    /// Ground up to this far behind an echo counts as scanned, metres.
    pub(crate) behind_m: f64,
    /// Weight taken off a cell that a beam passed.
    pub(crate) pass: i8,
    /// Weight taken off a cell at the beam's edge, where the beam may have missed.
    pub(crate) pass_at_edge: i8,
    /// Half the angle in which a beam is evidence against an earlier echo. Farther out the beam may have missed the obstacle.
    pub(crate) against: f64,
    /// Half the widest angle in which a beam is evidence against an echo at all.
    pub(crate) against_at_edge: f64,
    /// Widest angle between two beams of which one is evidence against an echo of the other. A smooth wall that is hit at a
    /// slant gives no echo, which is no evidence against what was heard square to it.
    pub(crate) same_side: f64,

    /// Least weight of a cell. Weights are bounded, so that a few readings suffice where the world has changed.
    pub(crate) least: i8,
    /// Greatest weight of a cell.
    pub(crate) most: i8,
    /// A free cell becomes occupied at this weight.
    pub(crate) occupied: i8,
    /// An occupied cell becomes free at this weight.
    pub(crate) released: i8,
    /// A cell of this weight is the cause of an echo whose arc it lies on: the rest of the arc learns nothing.
    pub(crate) explains: i8,

    /// Half the angle in which a beam without echo scans ground. It is less than the cone's, because a surface that only just
    /// reaches into the cone deflects the sound.
    pub(crate) scanned: f64,
    /// Range up to which ground is scanned, metres. Echoes are mapped less far, because an echo from there is too wide; the
    /// absence of an echo still says that the ground is free.
    pub(crate) scanned_m: f64,
    /// Half the angle in which the sonar counts as pointed at a cell that it cannot see.
    pub(crate) pointed: f64,
    /// Range up to which the sonar counts as pointed at such a cell, metres.
    pub(crate) pointed_m: f64,
    /// Number of such readings after which the cell counts as scanned, because there is nothing more to learn.
    pub(crate) pointed_enough: u8,
    /// Scanned ground stays scanned while the wheels roll this far, turns on the spot included, metres. By then the error of
    /// the pose is about the clearance that hazards are given.
    pub(crate) scanned_for_m: f64,

    /// Range within which the absence of an echo excludes a surface square to the beam, metres. It is half a metre less than
    /// the sonar's reach, where answers grow weak.
    pub(crate) clear_m: f64,
    /// The greatest distance of an obstacle before its echo's range, metres: noise, the byte's centimetre.
    pub(crate) ahead_of_echo_m: f64,
    /// A reading is evidence of free ground until the wheels have rolled this far, turns on the spot included, metres.
    pub(crate) clear_for_m: f64,

    /// Width of the footprint's rim that is not certainly free, metres, because the pose drifts.
    pub(crate) rim_m: f64,
    /// An obstacle nearer than this to the robot survives the first reset of the sensed belief, metres: the robot may touch it.
    pub(crate) near_m: f64,
}

impl SonarModel {
    /// The model of a sonar: that of the X80 with the cone's angles and ranges in the ratio of field of view and reach.
    pub(crate) fn of(sensor: &Sensor) -> Self {
        let x80 = Self::default();
        let wide = sensor.field_of_view_deg / SensorModel::Dur5200.field_of_view_deg();
        let far = (sensor.reach_m / SensorModel::Dur5200.reach_m()).min(1.0);
        Self {
            arc: x80.arc * wide,
            against: x80.against * wide,
            against_at_edge: x80.against_at_edge * wide,
            scanned: x80.scanned * wide,
            pointed: x80.pointed * wide,
            scanned_m: x80.scanned_m * far,
            clear_m: x80.clear_m * far,
            ..x80
        }
    }
}

impl Default for SonarModel {
    fn default() -> Self {
        Self {
            resolution_m: 0.05,
            arc: 16.0 * DEGREE,
            band_m: 0.04,
            hit: 4.0,
            hit_at_edge: 0.0,
            before_m: 0.08,
            behind_m: 0.10,
            pass: 2,
            pass_at_edge: 1,
            against: 8.0 * DEGREE,
            against_at_edge: 13.0 * DEGREE,
            same_side: 35.0 * DEGREE,
            least: -8,
            most: 12,
            occupied: 2,
            released: 0,
            explains: 6,
            scanned: 12.0 * DEGREE,
            scanned_m: 1.25,
            pointed: 6.0 * DEGREE,
            pointed_m: 0.40,
            pointed_enough: 4,
            scanned_for_m: 1.5,
            clear_m: 2.0,
            ahead_of_echo_m: 0.05,
            clear_for_m: 6.0,
            rim_m: 0.02,
            near_m: 0.6,
        }
    }
}
