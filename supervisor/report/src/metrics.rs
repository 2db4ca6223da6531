//! The table of metrics, under their field names. A value comes from the run's summary, which knows the ground truth of a
//! simulated robot; or else from the recording, which knows the robot's estimate.

use serde_json::{Value, json};

use crate::{
    content::Content,
    shortest_path::{ShortestPath, shortest_path},
};

struct Metric {
    /// The name in the literature.
    name: &'static str,
    /// The field in `summary.json`, or the formula.
    field: &'static str,
    /// The value with its unit; a dash if it is unknown.
    value: String,
}

fn shown(value: Option<f64>, digits: usize, unit: &str) -> String {
    match value.filter(|value| value.is_finite()) {
        Some(value) if unit.is_empty() => format!("{value:.digits$}"),
        Some(value) => format!("{value:.digits$} {unit}"),
        None => "\u{2013}".to_owned(),
    }
}

/// Success weighted by path length: 1 for the shortest path, 0 if the target was not reached.
fn spl(content: &Content, path: Option<f64>) -> Option<f64> {
    if !content.outcome()?.starts_with("reached") {
        return Some(0.0);
    }
    let mission = &content.mission;
    let start = mission.start_pose().position;
    let body = mission.body().radius_m;
    match shortest_path(&mission.obstacles(), start, mission.target, body) {
        ShortestPath::Found(shortest) => Some(shortest / path?.max(shortest)),
        ShortestPath::None | ShortestPath::TooLarge => None,
    }
}

/// The rows of the table as the page takes them: name, value, field.
pub(crate) fn rows(content: &Content) -> Vec<Value> {
    let rows = table(content).into_iter();
    rows.map(|metric| json!([metric.name, metric.value, metric.field])).collect()
}

fn table(content: &Content) -> Vec<Metric> {
    let measured = &content.measured;
    let of = |field: &str, measured: Option<f64>| content.summed(field).or(measured);
    let has_poses = measured.ticks > 0;
    let time = of("mission_time_s", has_poses.then_some(content.duration_s()));
    let path = of("path_length_m", has_poses.then_some(measured.path_m));
    let straight = content.mission.target.length();
    let straight = (straight > 0.0).then_some(straight);
    let ratio = path.zip(straight).map(|(path, straight)| path / straight);
    let full = measured.solves();
    let latency = measured.latency();
    let quantile = |field: &str, share: f64| {
        let summed = content.summary.get("tick_latency_us");
        let summed = summed.and_then(|tick| tick.get(field)?.as_f64());
        summed.or_else(|| latency.quantile_us(share)).map(|us| us / 1e3)
    };
    let success = match content.outcome() {
        Some(reached) if reached.starts_with("reached") => format!("1 ({reached})"),
        Some(other) => format!("0 ({other})"),
        None => "\u{2013}".to_owned(),
    };
    let row = |name, field, value| Metric { name, field, value };
    let count = |value: u64| Some(value as f64);
    vec![
        row("success", "outcome", success),
        row("mission time", "mission_time_s", shown(time, 1, "s")),
        row("path length", "path_length_m", shown(path, 2, "m")),
        row("straight distance", "straight_m", shown(straight, 2, "m")),
        row("K, path / straight", "path_length_m / straight_m", shown(ratio, 3, "")),
        row(
            "SPL, success weighted by path length",
            "success × shortest / max(path, shortest)",
            shown(spl(content, path), 3, ""),
        ),
        row(
            "least true clearance",
            "min_clearance_m",
            shown(content.summed("min_clearance_m"), 3, "m"),
        ),
        row(
            "share of ticks with a sonar reading nearer than d_safe",
            "range below mapper.map_within_m",
            shown(measured.near(), 3, ""),
        ),
        row("mean |dv/dt|", "v of pose", shown(measured.speed_change(), 3, "m/s²")),
        row(
            "safety events",
            "safety_events",
            shown(of("safety_events", count(measured.safety_events)), 0, ""),
        ),
        row(
            "share of the sonar unavailable",
            "sonar_unavailable_share",
            shown(of("sonar_unavailable_share", measured.unavailable()), 3, ""),
        ),
        row(
            "range of the commanded wheel speeds",
            "wheel_range_rad_s",
            shown(wheel_range(content), 2, "rad/s"),
        ),
        row("pose error at the end", "pose_error_m", shown(content.summed("pose_error_m"), 3, "m")),
        row(
            "pose error expected",
            "pose_error_expected_m",
            shown(
                of("pose_error_expected_m", measured.last_pose().map(|pose| pose.position_rms_m())),
                3,
                "m",
            ),
        ),
        row(
            "pose known within",
            "pose_within_m",
            shown(
                of("pose_within_m", measured.last_pose().map(|pose| pose.position_within_m())),
                3,
                "m",
            ),
        ),
        row("collisions", "collisions", shown(content.summed("collisions"), 0, "")),
        row("full solves", "full_solves", shown(of("full_solves", count(full)), 0, "")),
        row("looks", "looks", shown(content.summed("looks"), 0, "")),
        row("tick latency, median", "tick_latency_us.p50", shown(quantile("p50", 0.5), 2, "ms")),
        row("tick latency, 99 %", "tick_latency_us.p99", shown(quantile("p99", 0.99), 2, "ms")),
        row("tick latency, longest", "tick_latency_us.max", shown(quantile("max", 1.0), 2, "ms")),
        row("ticks", "ticks", shown(of("ticks", count(measured.ticks)), 0, "")),
        row("restarts of stages", "restarts", restarts(content)),
        row("replans after stalls", "replans", shown(content.summed("replans"), 0, "")),
        row("resets of the map", "resets", shown(content.summed("resets"), 0, "")),
    ]
}

/// The range of the wheel speeds; none for a car, which has only one wheel speed and a steering angle.
fn wheel_range(content: &Content) -> Option<f64> {
    if content.mission.body().steering.is_some() {
        return None;
    }
    let summed = content.summed("wheel_range_rad_s");
    summed.or_else(|| content.measured.wheel_range())
}

fn restarts(content: &Content) -> String {
    let restarts = content.summary.get("restarts");
    let times = restarts.and_then(|restarts| {
        let times = restarts.as_object()?.values();
        Some(times.filter_map(Value::as_u64).sum::<u64>() as f64)
    });
    shown(times, 0, "")
}
