//! `firsthand replay F.mcap`: every generation of a recording is computed again and compared to the bit; with `--live` by
//! processes on a bus.

use std::{path::PathBuf, process::ExitCode};

use clap::Args;
use common::{
    clock::{MissionTime, Pace},
    domain::RobotName,
    signals::{SIGHUP, SIGINT, SIGTERM, Signals},
};
use processes::{
    planner_executable,
    stages::{self, Stage},
};
use recording::{
    Recording,
    replay::{
        self, Options,
        live::{self, Happened},
    },
};

use crate::{
    commands::stage::OTHER_PLANNERS,
    console::{
        failure::Failure,
        missions, operator,
        output::{print, write_stderr},
    },
};

/// Replay a recording: give each generation of each stage its recorded inputs, and compare its outputs with the recorded ones to
/// the bit. Exits with 1 if something differs.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// The directory of a run that was recorded, or a recording.
    #[arg(value_name = "RUN|F.mcap")]
    recording: PathBuf,
    /// Only these stages, with commas between. With --live: the stages that run as processes, by default all but the link.
    #[arg(long, value_name = "STAGES", value_delimiter = ',')]
    stage: Vec<String>,
    /// Publish the recording on a bus, for any consumer, and run stages in processes of their own instead of the recorded
    /// ones. With `--pace max` time waits for their answers.
    #[arg(long)]
    live: bool,
    /// With --live: name of the robot on the bus.
    #[arg(long, default_value = "replay", requires = "live")]
    robot: RobotName,
    /// With --live: set a key of the recorded mission for the stages that run, as often as needed. Your own planner is
    /// `planner.executable="my-planner"`.
    #[arg(long, value_name = "KEY=VALUE", requires = "live")]
    set: Vec<String>,
    /// `max`, or R times mission time.
    #[arg(long, default_value = "max")]
    pace: Pace,
    /// Compare from this mission time on, seconds.
    #[arg(long, value_name = "S", default_value = "0")]
    from: f64,
    /// Print one line of JSON at the end, and nothing else on standard output.
    #[arg(long)]
    json: bool,
}

pub(crate) fn main(arguments: &Arguments) -> Result<ExitCode, Failure> {
    for name in &arguments.stage {
        operator::known_stage(name)?;
    }
    let recording = Recording::open(&arguments.recording)?;
    if arguments.live {
        return play(arguments, &recording);
    }
    let options = Options {
        stages: arguments.stage.clone(),
        from: MissionTime::from_seconds(arguments.from),
        pace: arguments.pace,
        run: None,
    };
    let report = replay::replay(&recording, &options)?;
    print(&report, arguments.json)?;
    Ok(ExitCode::from(u8::from(report.difference.is_some())))
}

fn play(arguments: &Arguments, recording: &Recording) -> Result<ExitCode, Failure> {
    let mut signals = Signals::catch(&[SIGINT, SIGTERM, SIGHUP])?;
    let chosen: Vec<&'static Stage> = if arguments.stage.is_empty() {
        live::live_stages().collect()
    } else {
        let named = arguments.stage.iter();
        named.filter_map(|name| stages::find(name)).collect()
    };
    let mut mission = missions::with(&recording.run.mission, &arguments.set)?;
    if let Some(mission) = &mut mission {
        planner_executable::resolve(mission, OTHER_PLANNERS)?;
    }
    let options = live::Options {
        robot: arguments.robot.clone(),
        stages: chosen,
        pace: arguments.pace,
        from: MissionTime::from_seconds(arguments.from),
        mission,
    };
    let mut tell = |happened| {
        let robot = &arguments.robot;
        write_stderr(&match happened {
            Happened::Ready(stage, pid) => format!("{stage}: process {pid}\n"),
            Happened::Playing => format!("playing as robot {robot}\n"),
            Happened::Waiting(stage, tick) => format!("waiting for {stage} in tick {tick}\n"),
        });
    };
    let report = live::play(recording, &options, &mut || signals.came(), &mut tell)?;
    print(&report, arguments.json)?;
    Ok(ExitCode::from(u8::from(report.first.is_some())))
}
