//! Tests of calibrations through real processes.

use std::{path::PathBuf, process::Output};

use common::mission::Calibration;
use serde_json::Value;
use tempfile::TempDir;

use crate::support::{
    assert_nothing_left, assert_refused, assert_said, directory_of, output, words,
};

/// Calibrates wheels that only the simulator knows: a larger right wheel, a narrower track, and a
/// measured floor.
///
/// Returns the command's output, and the file that it should write.
fn calibrated(robot: &str, more: &str) -> (Output, PathBuf, TempDir) {
    let folder = directory_of(robot);
    let out = folder.path().join("calibration.toml");
    let files = format!("--runs {} --out {}", folder.path().display(), out.display());
    let wheels = "simulation.wheels={diameter_ratio=1.006,diameter_spread=0,track_scale=0.985,\
                  track_spread=0,slip_share_spread=0}";
    let line = format!("calibrate --robot {robot} {files} --json --seed 3 --set {wheels} {more}");
    let said = output(&words(&line));
    assert_nothing_left(robot);
    (said, out, folder)
}

const GYRO: &str = "--gyro --set robot={protocol='json',gyro=true}";

#[test]
fn unknown_wheels_are_found_within_three_deviations_by_a_wall_or_a_gyro_and_written() {
    for (method, arguments, most_sd) in
        [("wall", "", [0.001, 0.003]), ("gyro", GYRO, [0.003, 0.012])]
    {
        let (said, out, _folder) = calibrated(method, arguments);
        let said: Value = serde_json::from_slice(&said.stdout).unwrap();
        let found = Calibration::parse(&std::fs::read_to_string(out).unwrap()).unwrap();
        let pairs = [
            (found.diameter_ratio, found.diameter_ratio_sd, 1.006),
            (found.track_scale, found.track_scale_sd, 0.985),
        ];
        for ((value, sd, truth), most_sd) in std::iter::zip(pairs, most_sd) {
            assert!((value - truth).abs() <= 3.0 * sd, "{value} +- {sd}, not {truth}: {said}");
            assert!(sd > 0.0 && sd <= most_sd, "{sd}: {said}");
        }
        let provenance = found.calibrated.unwrap();
        assert_eq!((&*provenance.method, &*provenance.robot), (method, method));
        let in_time = method == "wall" || said["seconds"].as_f64() < Some(60.0);
        assert!(in_time, "{said}");
    }
}

#[test]
fn without_a_wall_or_a_gyro_nothing_is_written() {
    // No wall answers this sonar.
    let deaf = "--set simulation.sonar.wall_limit_deg=0 --set simulation.sonar.edge_share=0";
    let (said, out, _folder) = calibrated("no-wall", deaf);
    assert_refused(&said, "not-calibrated", &["wall"]);
    assert!(!out.exists());
    let (said, out, _folder) = calibrated("no-gyro", "--gyro");
    assert!(!said.status.success() && !out.exists());
    assert_said(&said, &["no gyro", "gyro = true"]);
}
