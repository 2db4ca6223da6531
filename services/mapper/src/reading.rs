//! A reading of the sonar, where it was taken.

use glam::DVec2;

/// A reading of the sonar, where it was taken.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reading {
    /// The sensor, metres.
    pub(crate) origin: DVec2,
    /// Which way it looked: a unit vector.
    pub(crate) axis: DVec2,
    /// The echo's range, metres; none where nothing answered.
    pub(crate) echo: Option<f64>,
}
