//! The part of a run's summary that an evaluation reads.

use serde::Deserialize;

/// Quantiles of a duration, microseconds; none if it did not occur.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
pub(crate) struct Quantiles {
    pub(crate) p50: Option<f64>,
    pub(crate) p99: Option<f64>,
    pub(crate) max: Option<f64>,
}

/// Fields of the last line of `firsthand run --json`.
#[derive(Clone, Debug, Deserialize)]
pub struct Summary {
    pub(crate) outcome: String,
    pub(crate) reason: String,
    pub(crate) mission_time_s: f64,
    pub(crate) path_length_m: f64,
    pub(crate) min_clearance_m: Option<f64>,
    pub(crate) pose_error_m: Option<f64>,
    pub(crate) pose_error_expected_m: Option<f64>,
    pub(crate) true_distance_m: Option<f64>,
    /// Mission time at which the robot had moved 0.1 m in truth.
    pub(crate) departed_s: Option<f64>,
    pub(crate) safety_events: u64,
    pub(crate) sonar_unavailable_share: Option<f64>,
    pub(crate) wheel_range_rad_s: Option<f64>,
    pub(crate) looks: u64,
    pub(crate) look_s: f64,
    pub(crate) replans: u64,
    pub(crate) resets: u64,
    pub(crate) full_solves: u64,
    /// From the datagram in to the datagram out.
    pub(crate) tick_latency_us: Quantiles,
    pub(crate) full_solve_us: Quantiles,
}
