use clap::Args;
use link::failsafe::stop_distance::{self, Stop};

use console::{
    failure::Result,
    output::{print_text, write_stderr},
};

/// Check a mission as `run` does. An error is reported with its line, its key and the remedy; of a mission without one, the way from each
/// fault to rest is printed.
#[derive(Debug, Args)]
pub struct Arguments {
    /// A mission file, or a shipped mission (`firsthand missions`).
    mission: String,
    /// Set a key of the mission, as often as needed: `--set start.heading_deg=90`.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
}

pub fn main(arguments: &Arguments) -> Result {
    let mission = super::run::ready(&arguments.mission, &arguments.set)?;
    for remark in &mission.remarks {
        write_stderr(&format!("firsthand: {remark}\n"));
    }
    let frame = mission.grid_frame();
    let mut text = format!(
        "{}: {} m to the target, {} x {} cells of {:.3} m\nFrom a fault to rest, at most, at {} m/s:\n",
        mission.name,
        mission.straight_m(),
        frame.cells,
        frame.cells,
        frame.resolution_m,
        mission.speed_m_s()
    );
    for (cause, Stop { known_s, rest_s, way_m }) in stop_distance::from_faults(&mission) {
        text += &format!(
            "  {:<28} {way_m:.2} m in {rest_s:.2} s (known after {known_s:.2} s)\n",
            cause.name()
        );
    }
    Ok(print_text(&text)?)
}
