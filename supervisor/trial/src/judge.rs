//! How well a log was tracked.

use std::collections::BTreeSet;

use common::kinematics::Pose2;
use glam::DVec2;
use serde::Serialize;

use crate::{between, drive::Drive, median};

/// Side of a cell of the blur, metres.
const CELL_M: f64 = 0.1;
/// Squared Mahalanobis distance that 95.45 % of places stay below: 2 deviations.
const TWO_SIGMA: f64 = 6.18;

/// Figures of a tried log. Those by the log's own poses are `None` for a log without corrected ones.
#[derive(Clone, Debug, Serialize)]
pub struct Judged {
    pub scans: usize,
    /// Share of the scans that gave a fix.
    pub fixes: f64,
    /// Median error of the place over ways of 5 and 20 m, metres.
    pub error_5_m: Option<f64>,
    pub error_20_m: Option<f64>,
    /// The same of the raw odometry.
    pub odometry_error_5_m: Option<f64>,
    pub odometry_error_20_m: Option<f64>,
    /// Share of the poses beyond two standard deviations of the place.
    pub beyond_2_sigma: Option<f64>,
    /// Cells that the scans' points touch, over those by the raw odometry.
    pub blur_ratio: f64,
    /// Stands of the failsafe.
    pub false_stands: usize,
}

pub fn judge(drive: &Drive) -> Judged {
    let poses: Vec<_> = drive.poses.iter().map(|it| it.pose()).collect();
    let references = drive.references.as_deref();
    let error = |poses: &[Pose2], way_m| error_over(references?, poses, way_m);
    let beyond = references.map(|references| {
        let beyond = references.iter().zip(&drive.poses).filter(|(truth, pose)| {
            let DVec2 { x, y } = pose.pose().position - truth.position;
            let [xx, xy, _, yy, ..] = pose.covariance;
            let squared = x * x * yy - 2.0 * x * y * xy + y * y * xx;
            squared > TWO_SIGMA * (xx * yy - xy * xy)
        });
        beyond.count() as f64 / references.len().max(1) as f64
    });
    let cells = |poses: &[Pose2]| cells(drive, poses) as f64;
    Judged {
        scans: poses.len(),
        fixes: drive.fixes as f64 / poses.len().max(1) as f64,
        error_5_m: error(&poses, 5.0),
        error_20_m: error(&poses, 20.0),
        odometry_error_5_m: error(&drive.odometry, 5.0),
        odometry_error_20_m: error(&drive.odometry, 20.0),
        beyond_2_sigma: beyond,
        blur_ratio: cells(&poses) / cells(&drive.odometry).max(1.0),
        false_stands: drive.stands.len(),
    }
}

/// Returns the median error over stretches of the reference of this length.
fn error_over(references: &[Pose2], poses: &[Pose2], way_m: f64) -> Option<f64> {
    let steps = references.windows(2).map(|it| it[0].position.distance(it[1].position));
    let gone: Vec<f64> = std::iter::once(0.0)
        .chain(steps)
        .scan(0.0, |gone, step| {
            *gone += step;
            Some(*gone)
        })
        .collect();
    let errors = gone.iter().enumerate().map_while(|(from, begun)| {
        let to = gone.partition_point(|it| *it < begun + way_m);
        let of = |poses: &[Pose2]| Some(between(poses[from], *poses.get(to)?).position);
        Some(of(poses)?.distance(of(references)?))
    });
    median(errors)
}

/// Counts the cells that the points of all scans touch.
fn cells(drive: &Drive, poses: &[Pose2]) -> usize {
    let (first_rad, step_rad) = drive.laser.fan();
    let mut touched = BTreeSet::new();
    for (scan, pose) in drive.scans.iter().zip(poses) {
        let laser = drive.laser.mount.on(*pose);
        for (beam, range) in scan.iter().enumerate() {
            let range = f64::from(*range);
            if range < drive.laser.reach_m {
                let bearing = laser.heading + first_rad + beam as f64 * step_rad;
                let at = (laser.position + range * DVec2::from_angle(bearing)) / CELL_M;
                touched.insert((at.x.floor() as i64, at.y.floor() as i64));
            }
        }
    }
    touched.len()
}
