//! Tests of calibrations through real processes.

use std::{path::PathBuf, process::Output};

use common::mission::Calibration;
use serde_json::Value;
use tempfile::TempDir;

use crate::support::{assert_nothing_left, assert_refused, directory_of, output, printed};

/// Calibrates wheels that only the simulator knows: a larger right wheel, a narrower track, and a
/// measured floor.
///
/// Returns the command's output, and the file that it should write.
fn calibrated(robot: &str, more: &[&str]) -> (Output, PathBuf, TempDir) {
    let folder = directory_of(robot);
    let out = folder.path().join("calibration.toml");
    let (folder_name, out_name) = (folder.path().to_str().unwrap(), out.to_str().unwrap());
    let files = ["calibrate", "--robot", robot, "--runs", folder_name, "--out", out_name];
    let wheels = "simulation.wheels={diameter_ratio=1.006,diameter_spread=0,track_scale=0.985,\
                  track_spread=0,slip_share_spread=0}";
    let said = output(&[&files[..], &["--json", "--set", wheels], more].concat());
    assert_nothing_left(robot);
    (said, out, folder)
}

#[test]
fn unknown_wheels_are_found_within_three_deviations_and_written() {
    let (said, out, _folder) = calibrated("calibrated", &["--seed", "3"]);
    let said: Value = serde_json::from_slice(&said.stdout).unwrap();
    let found = Calibration::parse(&std::fs::read_to_string(out).unwrap()).unwrap();
    let is_near = |value: f64, sd: f64, truth: f64, most_sd: f64| {
        assert!((value - truth).abs() <= 3.0 * sd, "{value} +- {sd}, not {truth}: {said}");
        assert!(sd > 0.0 && sd <= most_sd, "{sd}: {said}");
    };
    is_near(found.diameter_ratio, found.diameter_ratio_sd, 1.006, 0.001);
    is_near(found.track_scale, found.track_scale_sd, 0.985, 0.003);
    is_near(found.slip, found.slip_sd, 0.001, 0.001);
    let provenance = found.calibrated.unwrap();
    assert_eq!((&*provenance.method, &*provenance.robot), ("wall", "calibrated"));
    assert!(provenance.metres > 20.0 && provenance.chi2_per_dof < 4.0, "{provenance:?}");
    assert!(said["residuals"].as_array().unwrap().len() >= 6, "{said}");
}

#[test]
fn a_gyro_finds_ratio_and_track_in_less_than_a_minute_and_a_robot_without_one_is_told_so() {
    let robot = |gyro: &str| {
        let json = format!("robot={{protocol='json',gyro={gyro}}}");
        calibrated("gyro", &["--seed", "3", "--gyro", "--set", &json])
    };
    let (said, out, _folder) = robot("true");
    let said: Value = serde_json::from_slice(&said.stdout).unwrap();
    let found = Calibration::parse(&std::fs::read_to_string(out).unwrap()).unwrap();
    for (value, sd, truth, most_sd) in [
        (found.diameter_ratio, found.diameter_ratio_sd, 1.006, 0.003),
        (found.track_scale, found.track_scale_sd, 0.985, 0.012),
    ] {
        assert!((value - truth).abs() <= 3.0 * sd, "{value} +- {sd}, not {truth}: {said}");
        assert!(sd > 0.0 && sd <= most_sd, "{sd}: {said}");
    }
    assert_eq!(found.calibrated.unwrap().method, "gyro");
    assert!(said["seconds"].as_f64().unwrap() < 60.0, "{said}");
    let (said, out, _folder) = robot("false");
    assert!(!said.status.success() && !out.exists());
    let error = String::from_utf8_lossy(&said.stderr);
    assert!(error.contains("no gyro") && error.contains("gyro = true"), "{error}");
}

#[test]
fn the_response_of_a_stated_base_is_found_again() {
    let folder = directory_of("response");
    let folder_name = folder.path().to_str().unwrap();
    for (delay_s, acceleration) in [(0.07, 0.8), (0.3, 0.6)] {
        let stated =
            format!("robot.response={{delay_s={delay_s},acceleration_m_s2={acceleration}}}");
        let words =
            ["calibrate", "--response", "--robot", "response", "--runs", folder_name, "--json"];
        let said = printed(&[&words[..], &["--set", &stated]].concat());
        let said: Value = serde_json::from_str(&said).unwrap();
        let found = |key: &str| said[key].as_f64().unwrap();
        assert!((found("delay_s") - delay_s).abs() < 0.03, "{said}");
        assert!((found("acceleration_m_s2") / acceleration - 1.0).abs() < 0.15, "{said}");
        assert!(found("delay_s_sd") > 0.0 && found("acceleration_m_s2_sd") > 0.0, "{said}");
    }
    let runs = printed(&["runs", "--runs", folder_name]);
    assert_eq!(runs.matches(" completed ").count(), 2, "{runs}");
    assert_nothing_left("response");
}

#[test]
fn without_a_wall_nothing_is_written() {
    // No wall answers this sonar.
    let deaf =
        ["--set", "simulation.sonar.wall_limit_deg=0", "--set", "simulation.sonar.edge_share=0"];
    let (said, out, _folder) = calibrated("no-wall", &deaf);
    assert_refused(&said, "not-calibrated", &["wall"]);
    assert!(!out.exists());
}
