//! `firsthand run MISSION`: a mission from start to summary.

use std::{
    fs,
    io::{self, IsTerminal, Write as _},
    path::PathBuf,
    process::ExitCode,
    time::{Duration, Instant},
};

use clap::Args;
use common::{clock::Pace, domain::RobotName, mission::Mission, shell::become_child};

use super::{Failure, directories, missions};
#[cfg(feature = "tools")]
use crate::run_picture;
use crate::{logging, summary::Summary};
use supervisor::{
    Options, Progress, Starter,
    outcome::{Ending, Outcome},
    recovery::{self, RecoveredRun, SUMMARY},
};

/// Carry out a mission: bring up a robot's stages, let it drive, sum up.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// A shipped mission (`firsthand missions`) or a mission file.
    #[arg(default_value = "obstacle-course")]
    mission: String,
    /// Name of the robot, and of its corner of shared memory.
    #[arg(long, default_value = "x80")]
    robot: RobotName,
    /// Mission time of a simulated robot: `max`, or R times wall-clock.
    #[arg(long, default_value = "max")]
    pace: Pace,
    /// Seed of everything random in the simulation, over the mission's.
    #[arg(long)]
    seed: Option<u64>,
    /// Where logs, checkpoints, summary and picture go; a new directory below --runs otherwise.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Where the directories of runs are made.
    #[arg(long, value_name = "DIR", default_value = "runs")]
    runs: PathBuf,
    /// Go on with the run in DIR, whose supervisor died. The robot stands where it came to rest, and must not have
    /// been carried since.
    #[arg(
        long,
        value_name = "DIR",
        conflicts_with_all = ["mission", "robot", "pace", "seed", "out", "timeout", "set"]
    )]
    resume: Option<PathBuf>,
    /// Go on with the newest run below --runs if it was cut off within the last minute; say so instead of starting,
    /// once, if that was before: the robot is not where its mission starts. For services, which systemd starts again.
    #[arg(long, conflicts_with_all = ["resume", "out"])]
    resume_last: bool,
    /// Mission seconds after which to give up, over the mission's.
    #[arg(long, value_name = "S")]
    timeout: Option<f64>,
    /// KEY=VALUE over the mission file, as often as needed: `--set start.heading_deg=90`.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Start no stages: systemd does, or you do, with `firsthand stage NAME --robot R`.
    #[arg(long)]
    watch_only: bool,
    /// End with one line of JSON on standard output, and nothing else there.
    #[arg(long)]
    json: bool,
    /// Stop in order when this process, the parent, ends.
    #[arg(long, hide = true)]
    parent: Option<u32>,
}

impl Default for Arguments {
    fn default() -> Self {
        use clap::Parser as _;
        /// The defaults stand in one place: the attributes above.
        #[derive(clap::Parser)]
        struct Alone {
            #[command(flatten)]
            arguments: Arguments,
        }
        Alone::parse_from(["firsthand"]).arguments
    }
}

/// A run to carry out; none when one was cut off too long ago, and that was said.
fn options(arguments: &Arguments) -> Result<Option<Options>, Failure> {
    if let Some(directory) = &arguments.resume {
        return resumed(arguments, fs::canonicalize(directory)?).map(Some);
    }
    if arguments.resume_last
        && let Some(cut) = directories::cut_off(&arguments.runs)?
    {
        if recovery::age_s(&cut).is_some_and(|age| age <= RESUMED_WITHIN_S) {
            return resumed(arguments, cut).map(Some);
        }
        directories::mark_cut_off(&cut)?;
        let cut = cut.display();
        eprintln!(
            "firsthand: {cut} was cut off on its way, and a mission's origin is where the robot stands at its start: put it there, then start again; or, if it still stands where it came to rest, `firsthand run --resume {cut}`"
        );
        return Ok(None);
    }
    let mission = mission(arguments)?;
    let directory = match &arguments.out {
        Some(directory) => directories::own(directory)?,
        None => directories::numbered(&arguments.runs, &mission.name)?,
    };
    Ok(Some(Options {
        mission,
        robot: arguments.robot.clone(),
        pace: arguments.pace,
        directory,
        starter: starter(arguments),
        recovered: None,
    }))
}

/// The run in `directory`, to go on with.
fn resumed(arguments: &Arguments, directory: PathBuf) -> Result<Options, Failure> {
    let recovered = RecoveredRun::load(&directory)?;
    Ok(Options {
        mission: recovered.run.mission.clone(),
        robot: recovered.run.robot.clone(),
        pace: recovered.pace(),
        directory,
        starter: starter(arguments),
        recovered: Some(recovered),
    })
}

fn starter(arguments: &Arguments) -> Starter {
    if arguments.watch_only {
        Starter::Another
    } else {
        Starter::Supervisor
    }
}

/// The mission asked for, overrides and all.
fn mission(arguments: &Arguments) -> Result<Mission, Failure> {
    let mut mission = missions::load(&arguments.mission, &arguments.set)?;
    if let Some(seed) = arguments.seed {
        mission.seed = seed;
    }
    if let Some(timeout) = arguments.timeout {
        if !(timeout > 0.0 && timeout.is_finite()) {
            return Err(format!("--timeout {timeout} is no time; give seconds above 0").into());
        }
        mission.timeout_s = timeout;
    }
    Ok(mission)
}

#[allow(clippy::print_stdout)]
pub(crate) fn main(arguments: &Arguments) -> Result<ExitCode, Failure> {
    if let Some(parent) = arguments.parent {
        become_child("firsthand", parent)?;
    }
    let Some(options) = options(arguments)? else {
        return Ok(ExitCode::from(CUT_OFF));
    };
    let directory = &options.directory;
    // The supervisor's own log lies beside its stages'.
    logging::to_file(&directory.join("supervisor.log"), "info")?;
    for remark in &options.mission.remarks {
        tracing::warn!("{remark}");
        eprintln!("firsthand: {remark}");
    }
    let mut console = Console::new(&options);
    let finished = match supervisor::run(&options, &mut |progress| console.show(progress)) {
        Ok(finished) => finished,
        Err(error) => {
            // A directory made for a run that never was is litter.
            if arguments.out.is_none() && !directory.join(common::run::FILE_NAME).exists() {
                let _ = fs::remove_dir_all(directory);
            }
            return Err(error.into());
        }
    };
    console.end();
    let summary = Summary::of(&options.mission, &finished);
    let json = serde_json::to_string(&summary)?;
    fs::write(directory.join(SUMMARY), format!("{json}\n"))?;
    if arguments.json {
        println!("{json}");
    } else {
        print!("{summary}");
    }
    // Drawn last: the result does not depend on it.
    #[cfg(feature = "tools")]
    {
        let picture = directory.join("picture.svg");
        fs::write(
            &picture,
            run_picture::svg(&options.mission, &finished, &summary),
        )?;
        if !arguments.json {
            println!("picture: {}", picture.display());
        }
    }
    Ok(exit_code(&summary, &finished.ending))
}

/// A robot that stands unsupervised for longer may have been carried.
const RESUMED_WITHIN_S: f64 = 60.0;
/// What `--resume-last` ends with instead of starting.
const CUT_OFF: u8 = 7;

/// The documented code.
fn exit_code(summary: &Summary, ending: &Ending) -> ExitCode {
    if ending.asked_for && summary.outcome == ending.outcome {
        return ExitCode::SUCCESS;
    }
    ExitCode::from(match summary.outcome {
        Outcome::Reached => 0,
        Outcome::Unreachable => 3,
        Outcome::Timeout => 4,
        Outcome::Collision => 5,
        Outcome::Aborted => 6,
    })
}

/// Progress on standard error: one line rewritten on a terminal, a line now and then elsewhere, none in a
/// journal: systemd is told it as the service's status.
struct Console {
    rewrites: bool,
    silent: bool,
    shown: Option<Instant>,
    title: String,
}

/// Where lines cannot be rewritten they come so seldom.
const LINE_EVERY: Duration = Duration::from_secs(5);

impl Console {
    fn new(options: &Options) -> Self {
        let mission = &options.mission;
        Self {
            rewrites: io::stderr().is_terminal(),
            silent: logging::to_journal(),
            shown: None,
            title: format!(
                "mission {}{}: {:.1} m to the target, robot {}, pace {}; everything of this run is in {}",
                mission.name,
                if options.recovered.is_some() {
                    " goes on"
                } else {
                    ""
                },
                mission.target.length(),
                options.robot,
                options.pace,
                options.directory.display()
            ),
        }
    }

    fn show(&mut self, progress: &Progress<'_>) {
        let due = self
            .shown
            .is_none_or(|shown| self.rewrites || shown.elapsed() >= LINE_EVERY);
        if !due {
            return;
        }
        if self.shown.replace(Instant::now()).is_none() {
            say(&format!("{}\n", self.title));
        }
        if self.rewrites {
            say(&format!("\r\x1b[K{progress}"));
        } else if !self.silent {
            say(&format!("{progress}\n"));
        }
    }

    fn end(&self) {
        if self.rewrites {
            say("\n");
        }
    }
}

/// On standard error; a reader that went away does not end the mission.
fn say(text: &str) {
    let mut stderr = io::stderr();
    let _ = stderr
        .write_all(text.as_bytes())
        .and_then(|()| stderr.flush());
}
