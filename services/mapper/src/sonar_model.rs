//! The sonar model: an echo, or none, as evidence for the cells around.
//!
//! The X80's front sonar is one ultrasonic ranger: one byte of centimetres a frame, "nothing" included, from a cone of about 15 degrees
//! to either side.
//!
//! Angles are radians off the axis, to one side. Weights are integers in quarters of an echo heard in the middle of its arc; positive is
//! for an obstacle, negative for free ground.

use std::f64::consts::TAU;

use common::mission::{Sensor, SensorModel};

const DEGREE: f64 = TAU / 360.0;

/// The evidence grid's inverse sensor model. The default is the X80's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SonarModel {
    /// Side of a cell, metres: a third of the cone's width where a hit starts to matter, as fine as the sonar resolves.
    pub(crate) resolution_m: f64,

    /// Half the angle of an echo's spread, the model's widest. The cone's 15 degrees, rounded up.
    pub(crate) arc: f64,
    /// Error of an echo's range, metres: noise, the byte's centimetre, half a cell.
    pub(crate) band_m: f64,
    /// An echo's weight in the middle of its arc.
    pub(crate) hit: f64,
    /// An echo's weight at the end of its arc, where the sound is weakest; between, it falls linearly. It is 0, so that gaps stay open:
    /// a beam that points there hears an obstacle better.
    pub(crate) hit_at_edge: f64,

    /// An obstacle this far before an echo may be its cause, metres, so the beam does not free the ground there.
    pub(crate) before_m: f64,
    /// Ground this far behind an echo counts as scanned, metres.
    pub(crate) behind_m: f64,
    /// Weight taken off a passed cell.
    pub(crate) pass: i8,
    /// Less, because the beam's edge may have missed.
    pub(crate) pass_at_edge: i8,
    /// Half the angle in which a beam is evidence against an earlier echo. Farther out it may have missed.
    pub(crate) against: f64,
    /// Half the widest such angle.
    pub(crate) against_at_edge: f64,
    /// The widest angle between two beams of which one is evidence against the other's echo. A smooth wall hit at a slant gives no echo,
    /// which says nothing against one heard square to it.
    pub(crate) same_side: f64,

    /// Weights are bounded, so that a few readings suffice where the world has changed.
    pub(crate) least: i8,
    pub(crate) most: i8,
    pub(crate) occupied: i8,
    /// An occupied cell becomes free at this weight.
    pub(crate) released: i8,
    /// A cell of this weight on an echo's arc is its cause: the rest learns nothing.
    pub(crate) explains: i8,

    /// Half the angle in which a silent beam scans ground. Less than the cone's, because a surface that only just reaches into the cone
    /// deflects the sound.
    pub(crate) scanned: f64,
    /// Ground is scanned up to here, metres. Echoes are mapped less far, because they are too wide there; silence still says that the
    /// ground is free.
    pub(crate) scanned_m: f64,
    /// Half the angle in which the sonar counts as pointed at a cell that it cannot see.
    pub(crate) pointed: f64,
    pub(crate) pointed_m: f64,
    /// The cell counts as scanned after so many such readings: there is nothing more to learn.
    pub(crate) pointed_enough: u8,
    /// Ground stays scanned for this way of the wheels, turns included, metres. By then the pose's error is about the clearance of
    /// hazards.
    pub(crate) scanned_for_m: f64,

    /// Silence excludes a surface square to the beam up to here, metres: half a metre less than the sonar's reach, where answers grow
    /// weak.
    pub(crate) clear_m: f64,
    /// An obstacle's greatest distance before its echo, metres: noise, the byte's centimetre.
    pub(crate) ahead_of_echo_m: f64,
    /// A reading is evidence of free ground for this way of the wheels, turns included, metres.
    pub(crate) clear_for_m: f64,

    /// The footprint's rim that is not certainly free, because the pose drifts, metres.
    pub(crate) rim_m: f64,
    /// An obstacle nearer to the robot survives the first reset, metres: the robot may touch it.
    pub(crate) near_m: f64,
}

impl SonarModel {
    /// The X80's model, scaled by field of view and reach.
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
