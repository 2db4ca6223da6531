//! Sonar model: an echo, or none, as evidence for the cells around.
//!
//! Angles are radians off the axis, to one side. Weights are quarters of an echo in the middle of
//! its arc: positive for an obstacle, negative for free ground.

use std::f64::consts::TAU;

use common::mission::{Sensor, SensorModel};

const DEGREE: f64 = TAU / 360.0;

/// Cell size: a third of the cone's width where hits start to matter.
pub(crate) const RESOLUTION_M: f64 = 0.05;

/// Range error of an echo: noise, the byte's centimetre, half a cell.
pub(crate) const BAND_M: f64 = 0.04;
/// Weight in the middle of an echo's arc. It falls linearly to 0 at the end, where sound is
/// weakest, so gaps stay open until a beam points there.
pub(crate) const HIT: f64 = 4.0;

/// Distance before an echo that stays unfreed, because its cause may be there.
pub(crate) const BEFORE_M: f64 = 0.08;
/// Distance behind an echo that counts as scanned.
pub(crate) const BEHIND_M: f64 = 0.10;
/// Weight taken from a passed cell.
pub(crate) const PASS: i8 = 2;
/// The same at the beam's edge, which may have missed.
pub(crate) const PASS_AT_EDGE: i8 = 1;
/// Maximum angle between beams that contradict each other. A smooth wall at a slant gives no echo,
/// so an echo at right angles stays valid.
pub(crate) const SAME_SIDE: f64 = 35.0 * DEGREE;

/// Bounds of weights: a few readings must suffice after a change.
pub(crate) const LEAST: i8 = -8;
pub(crate) const MOST: i8 = 12;
/// Weight that makes a free cell occupied; [`RELEASED`] frees it.
pub(crate) const OCCUPIED: i8 = 2;
pub(crate) const RELEASED: i8 = 0;
/// Weight at which a cell on an echo's arc is its cause; the others then keep theirs.
pub(crate) const EXPLAINS: i8 = 6;

/// Range up to which the sonar counts as pointed at an invisible cell.
pub(crate) const POINTED_M: f64 = 0.40;
/// Number of such readings that make the cell scanned.
pub(crate) const POINTED_ENOUGH: u8 = 4;
/// Wheel travel, turns included, for which ground stays scanned. By then the pose error is about
/// the clearance of hazards.
pub(crate) const SCANNED_FOR_M: f64 = 1.5;

/// Maximum distance of an obstacle before its echo: noise, the byte's centimetre.
pub(crate) const AHEAD_OF_ECHO_M: f64 = 0.05;
/// Wheel travel for which a reading is evidence of free ground.
pub(crate) const CLEAR_FOR_M: f64 = 6.0;

/// Rim of the footprint that may be occupied, because the pose drifts.
pub(crate) const RIM_M: f64 = 0.02;
/// Radius around the robot in which obstacles survive the first reset: it may touch them.
pub(crate) const NEAR_M: f64 = 0.6;

#[derive(Clone, Copy, Debug)]
pub(crate) struct SonarModel {
    /// Half the angle of an echo's arc: the cone's 15 degrees, rounded up.
    pub arc: f64,
    /// Half the angle of full evidence against an earlier echo; farther out the beam may have
    /// missed.
    pub against: f64,
    /// Half the angle of any such evidence.
    pub against_at_edge: f64,
    /// Half the angle that silence scans: below the cone's, because a surface at its edge deflects
    /// the sound.
    pub scanned: f64,
    pub pointed: f64,
    /// Range of scanned ground. Echoes are too wide there for mapping, but silence means free
    /// ground.
    pub scanned_m: f64,
    /// Range up to which silence excludes a square surface: half a metre below the reach, where
    /// answers grow weak.
    pub clear_m: f64,
}

impl SonarModel {
    pub(crate) fn of(sensor: &Sensor) -> Self {
        let product = SensorModel::Dur5200.product();
        let wide = sensor.field_of_view_deg / product.field_of_view_deg;
        let far = (sensor.reach_m / product.reach_m).min(1.0);
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
