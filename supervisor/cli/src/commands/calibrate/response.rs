//! The response of a base, from the recording of its turns.

use calibration::response::{Estimate, Measured, estimate, keys};
use common::{
    mission::CalibrationPlan,
    topics::{COMMAND, POSE},
};
use recording::Recording;
use serde_json::json;

use super::{
    Arguments,
    drive::{Carried, carry_out},
    refused,
};
use console::{failure::Failure, output::print_text};

pub(super) fn measure(arguments: &Arguments, plan: CalibrationPlan) -> Result<(), Failure> {
    let mission = arguments.mission(plan)?;
    let body = mission.body();
    let Carried { directory, .. } = carry_out(arguments.setting(), mission, "turns")?;
    let recording = Recording::open(&directory.join("recording.mcap"))?;
    let mut commands = Vec::new();
    for command in recording.samples(&COMMAND)? {
        let command = command?.sample;
        commands.push((command.stamp.time().seconds(), command.omega_rad_s));
    }
    let mut headings = Vec::new();
    for pose in recording.samples(&POSE)? {
        let pose = pose?.sample;
        headings.push((pose.stamp.time().seconds(), pose.heading_rad));
    }
    let found = estimate(&commands, &headings, &body).map_err(|why| refused(&why))?;
    let text = match arguments.json {
        true => format!("{}\n", as_json(&found)),
        false => keys(&found, body.response),
    };
    Ok(print_text(&text)?)
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
