//! The first message of a page.

use common::{mission::SensorKind, run::Run};
use serde_json::{Value, json};

use crate::collector::COLUMNS;

/// The first message of a page, which describes `run`.
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
