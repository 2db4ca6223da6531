use std::path::PathBuf;

use clap::{Args, Subcommand};
use common::{grid::Replica, topics};
use recording::Recording;

use console::{
    failure::{Refused, Result},
    output::print_line,
};

/// Save maps in the format of the ROS map_server.
///
/// A mission starts from a map with `map = "office.yaml"`.
#[derive(Debug, Args)]
pub struct Arguments {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Write the believed map of a run's end.
    ///
    /// Surfaces are occupied, scanned ground is free, and the rest is unknown.
    Save {
        /// Directory of a recorded run, or a recording.
        #[arg(value_name = "RUN|F.mcap")]
        run: PathBuf,
        /// YAML file of the map; its image ends in `.pgm`.
        #[arg(long, value_name = "FILE.yaml", default_value = "map.yaml")]
        out: PathBuf,
    },
}

pub fn main(arguments: &Arguments) -> Result {
    let Action::Save { run, out } = &arguments.action;
    let mut grid = Replica::default();
    // A resumed run has several recordings, of which the last has the last map.
    let recording = Recording::open(recording::parts(run).last().unwrap_or(run))?;
    for sample in recording.slices(&topics::GRID)? {
        let (header, cells) = sample?;
        grid.apply(&header.part, &cells);
    }
    let frame = grid.frame().ok_or_else(|| {
        Refused::new("no-map", format!("{} contains no map; give a run that drove", run.display()))
    })?;
    maps::save_believed(out, &recording.run.mission, &frame, grid.cells())?;
    print_line(out.display())
}
