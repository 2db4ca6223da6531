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

/// Side of a cell, metres: a third of the cone's width where a hit starts to matter, as fine as the sonar resolves.
pub(crate) const RESOLUTION_M: f64 = 0.05;

/// Error of an echo's range, metres: noise, the byte's centimetre, half a cell.
pub(crate) const BAND_M: f64 = 0.04;
/// An echo's weight in the middle of its arc. It falls linearly to 0 at the end, where the sound is weakest, so that gaps stay open: a
/// beam that points there hears an obstacle better.
pub(crate) const HIT: f64 = 4.0;

/// An obstacle this far before an echo may be its cause, metres, so the beam does not free the ground there.
pub(crate) const BEFORE_M: f64 = 0.08;
/// Ground this far behind an echo counts as scanned, metres.
pub(crate) const BEHIND_M: f64 = 0.10;
/// Weight taken off a passed cell.
pub(crate) const PASS: i8 = 2;
/// Less, because the beam's edge may have missed.
pub(crate) const PASS_AT_EDGE: i8 = 1;
/// The widest angle between two beams of which one is evidence against the other's echo. A smooth wall hit at a slant gives no echo,
/// which says nothing against one heard square to it.
pub(crate) const SAME_SIDE: f64 = 35.0 * DEGREE;

/// Weights are bounded, so that a few readings suffice where the world has changed.
pub(crate) const LEAST: i8 = -8;
pub(crate) const MOST: i8 = 12;
/// A free cell becomes occupied at this weight, and an occupied one free at [`RELEASED`].
pub(crate) const OCCUPIED: i8 = 2;
pub(crate) const RELEASED: i8 = 0;
/// A cell of this weight on an echo's arc is its cause: the rest learns nothing.
pub(crate) const EXPLAINS: i8 = 6;

/// The sonar counts as pointed at a cell that it cannot see up to here, metres.
pub(crate) const POINTED_M: f64 = 0.40;
/// The cell counts as scanned after so many such readings: there is nothing more to learn.
pub(crate) const POINTED_ENOUGH: u8 = 4;
/// Ground stays scanned for this way of the wheels, turns included, metres. By then the pose's error is about the clearance of hazards.
pub(crate) const SCANNED_FOR_M: f64 = 1.5;

/// An obstacle's greatest distance before its echo, metres: noise, the byte's centimetre.
pub(crate) const AHEAD_OF_ECHO_M: f64 = 0.05;
/// A reading is evidence of free ground for this way of the wheels, turns included, metres.
pub(crate) const CLEAR_FOR_M: f64 = 6.0;

/// The footprint's rim that is not certainly free, because the pose drifts, metres.
pub(crate) const RIM_M: f64 = 0.02;
/// An obstacle nearer to the robot survives the first reset, metres: the robot may touch it.
pub(crate) const NEAR_M: f64 = 0.6;

/// What depends on the sensor's field of view and reach.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SonarModel {
    /// Half the angle of an echo's spread, the model's widest. The cone's 15 degrees, rounded up.
    pub(crate) arc: f64,
    /// Half the angle in which a beam is evidence against an earlier echo. Farther out it may have missed.
    pub(crate) against: f64,
    /// Half the widest such angle.
    pub(crate) against_at_edge: f64,
    /// Half the angle in which a silent beam scans ground. Less than the cone's, because a surface that only just reaches into the cone
    /// deflects the sound.
    pub(crate) scanned: f64,
    /// Half the angle in which the sonar counts as pointed at a cell that it cannot see.
    pub(crate) pointed: f64,
    /// Ground is scanned up to here, metres. Echoes are mapped less far, because they are too wide there; silence still says that the
    /// ground is free.
    pub(crate) scanned_m: f64,
    /// Silence excludes a surface square to the beam up to here, metres: half a metre less than the sonar's reach, where answers grow
    /// weak.
    pub(crate) clear_m: f64,
}

impl SonarModel {
    /// The X80's model, scaled by field of view and reach.
    pub(crate) fn of(sensor: &Sensor) -> Self {
        let wide = sensor.field_of_view_deg / SensorModel::Dur5200.field_of_view_deg();
        let far = (sensor.reach_m / SensorModel::Dur5200.reach_m()).min(1.0);
        Self {
            arc: 16.0 * DEGREE * wide,
            against: 8.0 * DEGREE * wide,
            against_at_edge: 13.0 * DEGREE * wide,
            scanned: 12.0 * DEGREE * wide,
            pointed: 6.0 * DEGREE * wide,
            scanned_m: 1.25 * far,
            clear_m: 2.0 * far,
        }
    }
}
