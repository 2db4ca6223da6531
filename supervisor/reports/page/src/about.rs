//! First message of a page, and results of targets.

use common::{mission::SensorKind, run::Run};
use robot_state::{Event, Kind};
use serde_json::{Value, json};

use crate::collector::COLUMNS;

/// Converts a target's result, a line of the run's records, to an event at its time.
pub fn result(target: &Value) -> Value {
    let outcome = target["outcome"].as_str().unwrap_or_default();
    let kind = match outcome {
        "reached" => Kind::Good,
        "replaced" | "not_tried" | "followed" => Kind::Note,
        _ => Kind::Bad,
    };
    let [x, y] = ["x_m", "y_m"].map(|key| target[key].as_f64().unwrap_or(f64::NAN));
    let off = |key: &str, by: &str| {
        target[key].as_f64().map_or(String::new(), |off_m| format!(", {off_m:.2} m off ({by})"))
    };
    let (pose, truth) = (off("distance_m", "pose"), off("truth_m", "ground truth"));
    json!(Event {
        t: target["at_s"].as_f64().unwrap_or_default(),
        of: format!("target {}", target["number"]),
        kind,
        text: format!("({x:.2}, {y:.2}): {}{pose}{truth}", outcome.replace('_', " ")),
    })
}

pub fn about(run: &Run) -> Value {
    let mission = &run.mission;
    let simulated = mission.robot.address.is_none();
    let sensors: Vec<_> = mission
        .sensor_table()
        .into_iter()
        .map(|sensor| {
            json!({
                "name": sensor.name,
                "cone": sensor.kind == SensorKind::Cone,
                "scan": sensor.kind == SensorKind::Scan,
                "forward_m": sensor.mount.forward_m,
                "bearing": sensor.mount.bearing_rad,
                "half": sensor.field_of_view_deg.to_radians() / 2.0,
                "reach_m": sensor.reach_m,
                "used": sensor.used,
            })
        })
        .collect();
    json!({
        "robot": run.robot.to_string(),
        "mission": mission.name,
        "simulated": simulated,
        "seed": mission.seed,
        "target": [mission.target.x, mission.target.y],
        "tolerance_m": mission.arrival_tolerance_m,
        "perimeter": {
            "width_m": mission.perimeter.width_m,
            "centre": [mission.perimeter.centre.x, mission.perimeter.centre.y],
        },
        "radius_m": mission.body().radius_m,
        "sensors": sensors,
        "columns": COLUMNS,
        "steers": mission.body().steering.is_some(),
        "known": mission.known,
        "world": simulated.then_some(&mission.world),
        "things": simulated.then_some(&mission.simulation.things),
    })
}
