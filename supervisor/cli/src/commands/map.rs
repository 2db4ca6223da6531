use std::path::PathBuf;

use clap::{Args, Subcommand};
use common::{grid::Replica, topics};
use recording::Recording;

use console::{
    failure::{Refused, Result},
    output::print_text,
};

/// Maps of the ROS map_server. A mission starts from one with `map = "office.yaml"`.
#[derive(Debug, Args)]
pub struct Arguments {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Write what the robot believed at the end of a run: its surfaces, the ground that was scanned, and the rest as unknown.
    Save {
        /// The directory of a run that was recorded, or a recording.
        #[arg(value_name = "RUN|F.mcap")]
        run: PathBuf,
        /// The map's YAML file; its image gets the same name with `.pgm`.
        #[arg(long, value_name = "FILE.yaml", default_value = "map.yaml")]
        out: PathBuf,
    },
}

pub fn main(arguments: &Arguments) -> Result {
    let Action::Save { run, out } = &arguments.action;
    let mut grid = Replica::default();
    // A run that was resumed has several recordings. The last has its last map.
    let parts = recording::parts(run);
    let recording = Recording::open(parts.last().unwrap_or(run))?;
    for sample in recording.slices(&topics::GRID)? {
        let sample = sample?;
        grid.apply(&sample.header.part, &sample.elements);
    }
    let frame = grid.frame().ok_or_else(|| {
        Refused::new("no-map", format!("{} contains no map; give a run that drove", run.display()))
    })?;
    let mission = &recording.run.mission;
    maps::save_believed(out, mission, &frame, grid.cells())?;
    Ok(print_text(&format!("{}\n", out.display()))?)
}
