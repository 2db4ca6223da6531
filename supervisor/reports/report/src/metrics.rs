//! Table of metrics, under their field names, from the run's summary with a simulated robot's
//! ground truth, or else from the recording with the robot's estimate.

use common::samples::PoseSample;
use serde_json::{Value, json};

use crate::{content::Content, shortest_path::shortest_path};

fn shown(value: Option<f64>, digits: usize, unit: &str) -> String {
    match value.filter(|value| value.is_finite()) {
        Some(value) if unit.is_empty() => format!("{value:.digits$}"),
        Some(value) => format!("{value:.digits$} {unit}"),
        None => "\u{2013}".to_owned(),
    }
}

/// Returns the success weighted by path length; 0 without success.
fn spl(content: &Content, path: Option<f64>) -> Option<f64> {
    if !content.outcome()?.starts_with("reached") {
        return Some(0.0);
    }
    let mission = &content.mission;
    let start = mission.start_pose().position;
    let body = mission.body().radius_m;
    let shortest = shortest_path(&mission.obstacles(), start, mission.target, body)?;
    Some(shortest / path?.max(shortest))
}

/// Returns the page's rows: name in the literature, value with unit or a dash, and field in
/// `summary.json` or formula.
pub(crate) fn rows(content: &Content) -> Vec<Value> {
    let measured = &content.measured;
    let pose = measured.last_pose.as_ref();
    let of = |field: &str, measured: Option<f64>| content.summed(field).or(measured);
    let path = of("path_length_m", pose.map(|pose| pose.travelled_m));
    let straight = Some(content.mission.straight_m()).filter(|straight| *straight > 0.0);
    let ratio = path.zip(straight).map(|(path, straight)| path / straight);
    let latency = content.heard.latency();
    let quantile = |field: &str, share: f64| {
        content
            .summary
            .get("tick_latency_us")
            .and_then(|tick| tick.get(field)?.as_f64())
            .or_else(|| latency.quantile_us(share))
            .map(|us| us / 1e3)
    };
    let success = match content.outcome() {
        Some(reached) if reached.starts_with("reached") => format!("1 ({reached})"),
        Some(other) => format!("0 ({other})"),
        None => shown(None, 0, ""),
    };
    let row = |name, field: &str, value: Option<f64>, digits, unit| {
        json!([name, shown(value, digits, unit), field])
    };
    // The recording completes the summary.
    let known =
        |name, field, measured, digits, unit| row(name, field, of(field, measured), digits, unit);
    let count = |value: u64| Some(value as f64);
    let time = pose.map(|_| measured.time_s);
    let [rms, within] = [PoseSample::position_rms_m, PoseSample::position_within_m];
    vec![
        json!(["success", success, "outcome"]),
        known("mission time", "mission_time_s", time, 1, "s"),
        row("path length", "path_length_m", path, 2, "m"),
        row("straight distance", "straight_m", straight, 2, "m"),
        row("K, path / straight", "path_length_m / straight_m", ratio, 3, ""),
        row(
            "SPL, success weighted by path length",
            "success × shortest / max(path, shortest)",
            spl(content, path),
            3,
            "",
        ),
        known("least true clearance", "min_clearance_m", None, 3, "m"),
        row(
            "share of ticks with a sonar reading nearer than d_safe",
            "range below mapper.map_within_m",
            measured.near(),
            3,
            "",
        ),
        row("mean |dv/dt|", "v of pose", measured.speed_change(), 3, "m/s²"),
        known("ticks that mapped a hazard", "safety_events", count(measured.safety_events), 0, ""),
        known(
            "share of the sonar unavailable",
            "sonar_unavailable_share",
            measured.unavailable(),
            3,
            "",
        ),
        row(
            "range of the commanded wheel speeds",
            "wheel_range_rad_s",
            wheel_range(content),
            2,
            "rad/s",
        ),
        known("pose error at the end", "pose_error_m", None, 3, "m"),
        known("pose error expected", "pose_error_expected_m", pose.map(rms), 3, "m"),
        known("pose known within", "pose_within_m", pose.map(within), 3, "m"),
        known("collisions", "collisions", None, 0, ""),
        known("full solves", "full_solves", count(content.heard.solves_until(None)), 0, ""),
        known("looks", "looks", None, 0, ""),
        row("tick latency, median", "tick_latency_us.p50", quantile("p50", 0.5), 2, "ms"),
        row("tick latency, 99 %", "tick_latency_us.p99", quantile("p99", 0.99), 2, "ms"),
        row("tick latency, longest", "tick_latency_us.max", quantile("max", 1.0), 2, "ms"),
        known("ticks", "ticks", count(measured.ticks), 0, ""),
        row("restarts of stages", "restarts", restarts(content), 0, ""),
        known("replans after stalls", "replans", None, 0, ""),
        known("resets of the map", "resets", None, 0, ""),
    ]
}

/// Returns `None` for a car, with one wheel speed and a steering angle.
fn wheel_range(content: &Content) -> Option<f64> {
    if content.mission.body().steering.is_some() {
        return None;
    }
    content.summed("wheel_range_rad_s").or_else(|| content.heard.wheel_range_rad_s(u64::MAX))
}

fn restarts(content: &Content) -> Option<f64> {
    let times = content.summary.get("restarts")?.as_object()?.values();
    Some(times.filter_map(Value::as_u64).sum::<u64>() as f64)
}
