//! Computes the response of a base from the recording of its turns.

use bring_up::Trace;
use calibration::response::{By, Estimate, Measured, estimate, keys};
use common::mission::Mission;
use recording::Recording;
use serde_json::json;

use super::{Arguments, drive::Carried, refused};
use console::{
    failure::Result,
    output::{print_line, print_text},
};

pub fn measure(arguments: &Arguments, mission: &Mission) -> Result {
    let body = mission.body();
    let Carried { directory, .. } = arguments.setting.carry_out(mission, "turns")?;
    let trace = Trace::read(mission, &Recording::open(&directory)?)?;
    let turn = |(at, [left, right]): &(f64, [f64; 2])| (*at, (right - left) / body.track_m);
    let [told, turned] =
        [&trace.told, &trace.rolled].map(|it| it.iter().map(turn).collect::<Vec<_>>());
    let found = estimate(&told, &turned, &body, By::Turns).map_err(refused)?;
    if arguments.setting.json {
        print_line(as_json(&found))
    } else {
        print_text(keys(&found, body.response))
    }
}

fn as_json(found: &Estimate) -> serde_json::Value {
    let Measured { value, sd } = found.delay_s;
    let acceleration = found.acceleration_m_s2;
    json!({
        "delay_s": value,
        "delay_s_sd": sd,
        "acceleration_m_s2": acceleration.map(|it| it.value),
        "acceleration_m_s2_sd": acceleration.map(|it| it.sd),
    })
}
