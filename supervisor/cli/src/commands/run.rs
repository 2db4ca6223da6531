pub mod recorder;
mod summary_file;

use std::{fs, path::PathBuf, process::ExitCode, thread};

use clap::Args;
use common::{
    address::Address,
    clock::Pace,
    domain::RobotName,
    geometry::wrap_angle,
    mission::{Mission, Protocol, Resume, Start},
    samples::PlaceSample,
    signals::{Signals, exit_at_once},
    start::become_child,
};
use glam::DVec2;
use link::transport::SPEAKS_ROS2;
use mission_control::{
    Consumer, Finished, Options, Progress,
    recovery::{self, RecoveredRun},
};
use processes::{Starter, planner_executable};
use summary::{Hearer, Summary};

use self::{recorder::RunRecorder, summary_file::SummaryFile};
use super::{record::DiskBudget, run_report, stage::OTHER_PLANNERS};
use console::{
    failure::{self, Refused, Result, refuse},
    logging, missions,
    output::{json_lines, print, print_line, say, write_stderr},
    progress_line::{LINE_EVERY, ProgressLine},
    robots::SUPERVISOR_LOG,
    runs,
    words::age,
};

/// Carry out a mission: start the stages, drive, summarise.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Shipped mission (`firsthand missions`) or mission file.
    #[arg(default_value = "obstacle-course")]
    mission: String,
    /// Name of the robot and of its shared memory.
    #[arg(long, default_value_t)]
    robot: RobotName,
    /// Speed of mission time: `max`, or R times wall-clock time.
    ///
    /// Robots that speak ROS 2 accept R only. All real robots without ROS 2 run in real time.
    #[arg(long, default_value = "max")]
    pace: Pace,
    /// Seed of the simulation, instead of the mission's.
    #[arg(long, allow_negative_numbers = true)]
    seed: Option<u64>,
    /// Directory of logs, checkpoints, summary and picture.
    ///
    /// Default: a new one below --runs.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Directory that holds the directories of runs.
    #[arg(long, value_name = "DIR", default_value = "runs")]
    runs: PathBuf,
    /// First remove all but this robot's newest N ended runs.
    ///
    /// Applies to the directory of --runs.
    #[arg(long, value_name = "N", conflicts_with_all = ["resume", "out"])]
    keep: Option<usize>,
    /// Continue the run in DIR, whose supervisor was killed.
    ///
    /// The robot must still stand where it stopped.
    #[arg(
        long,
        value_name = "DIR",
        conflicts_with_all = ["mission", "robot", "pace", "seed", "out", "timeout", "set"]
    )]
    resume: Option<PathBuf>,
    /// Continue this robot's newest run below --runs if cut off.
    ///
    /// A robot that continues stands until `firsthand resume`, unless the mission says `resume =
    /// "automatic"`. A new run with --stay begins where the previous run ended. For systemd
    /// services.
    #[arg(long, conflicts_with_all = ["resume", "out"])]
    resume_last: bool,
    /// Give up after S seconds, instead of the mission's timeout.
    #[arg(long, value_name = "S")]
    timeout: Option<f64>,
    /// Set a key of the mission; may be repeated.
    ///
    /// Example: `--set start.heading_deg=90`.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Wait for further targets until Ctrl-C.
    ///
    /// After each target the robot stands, until `goto`, the page or ROS 2 sends the next. With
    /// --stay, a mission needs no target.
    #[arg(long, conflicts_with = "resume")]
    stay: bool,
    /// Start no stages: use systemd or `firsthand stage NAME --robot R`.
    #[arg(long)]
    watch_only: bool,
    /// Record nothing.
    ///
    /// Default: all topics except fields, in recording.mcap in the run's directory.
    #[arg(long)]
    no_record: bool,
    /// Largest size of the recordings: `500MB`, `2GB`.
    ///
    /// A new file begins at a quarter of SIZE or after an hour. The recorder removes the oldest
    /// files.
    #[arg(long, value_name = "SIZE", default_value = "2GB")]
    disk_budget: Option<DiskBudget>,
    /// Print only one line of JSON on standard output, at the end.
    #[arg(long)]
    json: bool,
    /// Stop the robot and end when this parent process ends.
    #[arg(long, hide = true)]
    parent: Option<u32>,
}

fn options(arguments: &Arguments) -> Result<Options> {
    if let Some(directory) = &arguments.resume {
        let found = fs::canonicalize(directory).map_err(|error| {
            let directory = directory.display();
            Refused::new(
                "no-run",
                format!(
                    "cannot resume the run in {directory}: {error}; give the directory of a run"
                ),
            )
        })?;
        return resumed(arguments, found);
    }
    let last =
        arguments.resume_last.then(|| runs::newest(&arguments.runs, &arguments.robot)).flatten();
    let mut is_cut_off = false;
    if let Some(cut) = last.as_ref().filter(|run| !run.has_ended()) {
        match resumed(arguments, fs::canonicalize(&cut.directory)?) {
            Ok(options) => {
                let place = recovery::last_place(&options.directory, &options.mission);
                let stands = options.mission.resume == Resume::Manual;
                tell_place(place.as_ref(), stands);
                return Ok(Options { stands, ..options });
            }
            Err(problem) => {
                say(format_args!("the last run ends here: {problem}"));
            }
        }
        is_cut_off = true;
    }
    let mut mission = mission(arguments)?;
    let place = last
        .filter(|run| mission.stay && run.mission.as_ref() == Some(&mission.name))
        .and_then(|run| recovery::last_place(&run.directory, &mission));
    let waits = mission.stay && mission.straight_m() == 0.0 && mission.targets.is_empty();
    if let Some((place, _)) = &place {
        let heading_deg = wrap_angle(place.heading_rad).to_degrees();
        mission.start = Start { at: DVec2::new(place.x_m, place.y_m), heading_deg };
        mission.target = if waits { mission.start.at } else { mission.target };
    }
    let goes_on = is_cut_off || place.is_some();
    let stands = goes_on && !waits && mission.resume == Resume::Manual;
    if goes_on {
        tell_place(place.as_ref(), stands);
    }
    let directory = match &arguments.out {
        Some(directory) => runs::own(directory)?,
        None => {
            if let Some(keep) = arguments.keep {
                runs::prune(&arguments.runs, &arguments.robot, keep);
            }
            runs::numbered(&arguments.runs, &mission.name)?
        }
    };
    Ok(Options {
        mission,
        robot: arguments.robot.clone(),
        pace: arguments.pace,
        directory,
        starter: starter(arguments),
        recovered: None,
        stands,
        place: place.map(|(place, _)| place),
    })
}

fn tell_place(place: Option<&(PlaceSample, f64)>, stands: bool) {
    let place = place.map_or(
        "the pose of the robot is unknown".to_owned(),
        |(PlaceSample { x_m, y_m, heading_rad, sigma_m, .. }, age_s)| {
            let heading = wrap_angle(*heading_rad).to_degrees();
            let (within_m, ago) = (2.0 * sigma_m, age(Some(*age_s)));
            format!("the robot believes it is where it stood {ago} ago: at ({x_m:.2}, {y_m:.2}) within {within_m:.2} m, heading {heading:.0} degrees")
        },
    );
    let until = if stands { "; it stands until `firsthand resume`" } else { "" };
    say(format_args!("{place}; `firsthand place` corrects it{until}"));
}

fn resumed(arguments: &Arguments, directory: PathBuf) -> Result<Options> {
    let recovered = RecoveredRun::load(&directory)?;
    let mut mission = recovered.run.mission.clone();
    planner_executable::resolve(&mut mission, OTHER_PLANNERS)?;
    Ok(Options {
        mission,
        robot: recovered.run.robot.clone(),
        pace: recovered.pace(),
        directory,
        starter: starter(arguments),
        recovered: Some(recovered),
        stands: false,
        place: None,
    })
}

fn starter(arguments: &Arguments) -> Starter {
    if arguments.watch_only { Starter::External } else { Starter::Supervisor }
}

fn mission(arguments: &Arguments) -> Result<Mission> {
    let stay = arguments.stay.then(|| "stay=true".to_owned());
    let set: Vec<_> = arguments.set.iter().cloned().chain(stay).collect();
    let mut mission = ready(&arguments.mission, &set)?;
    if let Some(seed) = arguments.seed {
        mission.seed = seed;
    }
    if let Some(timeout) = arguments.timeout {
        if !(timeout > 0.0 && timeout.is_finite()) {
            return Err(format!("--timeout {timeout} is not a time; give seconds above 0").into());
        }
        mission.timeout_s = timeout;
    }
    Ok(mission)
}

pub fn ready(name: &str, set: &[String]) -> Result<Mission> {
    let mut mission = missions::load(name, set)?;
    refuse_unspoken(&mission)?;
    let address = mission.robot.address.as_ref().and_then(|text| text.parse().ok());
    if let Some(Address::<String>::Serial(device)) = &address
        && !device.exists()
    {
        let device = device.display();
        return refuse(
            "no-device",
            format!(
                "robot.address: {device} does not exist; plug in its adapter, or name another (`ls -l /dev/serial/by-id`)"
            ),
        );
    }
    planner_executable::resolve(&mut mission, OTHER_PLANNERS)?;
    refuse_without_memory(&mission)?;
    Ok(mission)
}

fn refuse_without_memory(mission: &Mission) -> Result {
    /// Memory of all processes per cell, bytes: 1.84 GiB at 4096 x 4096.
    const PER_CELL: u64 = 118;
    let memory = fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let free = memory
        .lines()
        .find_map(|line| line.strip_prefix("MemAvailable:"))
        .and_then(|rest| rest.trim().strip_suffix(" kB")?.parse::<u64>().ok());
    let cells = mission.grid_frame().cells;
    let most = free.map_or(u64::MAX, |kb| (kb * 1024 / PER_CELL).isqrt());
    if u64::from(cells) <= most {
        return Ok(());
    }
    refuse(
        "mission",
        format!(
            "perimeter.cells: {cells} x {cells} cells need more memory than this machine has free; give {most} or fewer"
        ),
    )
}

fn refuse_unspoken(mission: &Mission) -> Result {
    if mission.robot.protocol() != Protocol::Ros2 || SPEAKS_ROS2 {
        return Ok(());
    }
    refuse(
        "mission",
        "robot.protocol: this executable is built without ROS 2; build it with `cargo build --release --features ros2`",
    )
}

pub fn main(arguments: &Arguments) -> Result<ExitCode> {
    let signals = mission_control::end_signals()?;
    if let Some(parent) = arguments.parent {
        become_child("firsthand", parent)?;
    }
    let options = options(arguments)?;
    let directory = &options.directory;
    let made_for_nothing = || {
        if arguments.out.is_none() && !directory.join(common::run::FILE_NAME).exists() {
            let _ = fs::remove_dir_all(directory);
        }
    };
    let summary_file = prepare(&options).inspect_err(|_| made_for_nothing())?;
    let (mut line, title) = (ProgressLine::new(LINE_EVERY), title(&options));
    // The service status shows progress instead of the journal.
    let may_stay = !logging::to_journal();
    let mut lock = None;
    let mut recorder = RunRecorder::new(&options, arguments.disk_budget);
    let consumer: &mut dyn Consumer = if arguments.no_record { &mut () } else { &mut recorder };
    let (heard, listener) = Hearer::with_listener();
    let mut show = |progress: &Progress<'_>| {
        line.update(&title, || progress.to_string(), may_stay);
    };
    let ran = mission_control::run(&options, signals, &mut lock, consumer, listener, &mut show);
    let (finished, still_moving) = match ran {
        Ok(ran) => ran,
        Err(error) => {
            drop(recorder);
            drop(lock);
            made_for_nothing();
            let failed = failure::report(Err(error.into()));
            say("`firsthand doctor` examines this machine");
            return Ok(failed);
        }
    };
    line.end();
    let summary = Summary::new(&options.mission, &finished, &heard.borrow());
    let printed = print(&summary, arguments.json);
    complain(printed.map_err(|error| format!("cannot print the summary: {error}")));
    let may_be_removed = may_be_removed(arguments, &options, &finished);
    if !may_be_removed {
        complain(summary_file.write(&json_lines(&[&summary])?));
    }
    if let Some(robot) = still_moving {
        say(
            "THE ROBOT MOVES although every stop method was tried; its link keeps ordering the stop; Ctrl-C hands that over to its stop guard",
        );
        let did = robot.watch()?;
        say(format_args!("the robot {did}"));
    }
    // A starved recorder may need seconds for its last chunks.
    drop(recorder);
    drop(lock);
    if mission_control::operator::owes_stop(&options.robot) {
        let robot = &options.robot;
        say(format_args!(
            "THE ROBOT WAS NOT SEEN AT REST; its stop guard keeps ordering the stop: `firsthand status --robot {robot}` shows what it sees, `firsthand stop --sign-off --robot {robot}` ends it"
        ));
    }
    let ending = &finished.ending;
    let told = if ending.asked_for {
        String::new()
    } else {
        let (outcome, directory) = (summary.outcome.as_str(), directory.display());
        format!("firsthand: {outcome}: {}; the logs are in {directory}\n", ending.reason)
    };
    let as_asked = ending.asked_for && summary.outcome == ending.outcome;
    let code = if as_asked { 0 } else { summary.outcome.exit_code() };
    if may_be_removed {
        let _ = fs::remove_dir_all(directory);
        if !arguments.json {
            let directory = directory.display();
            let printed = print_line(format_args!(
                "the robot did not drive, so {directory} is removed; --out DIR keeps it"
            ));
            complain(printed.map_err(|error| format!("cannot print what is removed: {error}")));
        }
    } else {
        // Picture and report do not affect the result, so a signal skips them.
        let redraw = directory.display();
        let last_words = format!(
            "firsthand: picture and report are not drawn; `firsthand report {redraw}` draws the report\n{told}"
        );
        let signals = Signals::that_end();
        thread::spawn(move || {
            if signals.and_then(|mut signals| signals.wait()).is_ok() {
                write_stderr(&last_words);
                exit_at_once(code);
            }
        });
        let show = |written: run_report::Written| {
            let (name, file) = written?;
            let line = format!("{name}: {}", file.display());
            let printed = if arguments.json { Ok(()) } else { print_line(line) };
            printed.map_err(|error| format!("cannot print where the {name} is: {error}"))
        };
        complain(show(run_report::picture(&options, &finished, &heard.borrow(), &summary)));
        if !arguments.no_record {
            complain(show(run_report::report(&options)));
        }
    }
    write_stderr(&told);
    Ok(code.into())
}

fn prepare(options: &Options) -> Result<SummaryFile> {
    let log = options.directory.join(SUPERVISOR_LOG);
    logging::to_file(&log).map_err(|error| format!("cannot log to {}: {error}", log.display()))?;
    for remark in &options.mission.remarks {
        tracing::warn!("{remark}");
        say(remark);
    }
    // A resumed run already has its files.
    let cells = options.recovered.is_none().then(|| options.mission.grid_frame().area());
    Ok(SummaryFile::reserve(&options.directory, cells.map_or(0, summary_file::room_of_run))?)
}

fn complain(reported: Result<(), String>) {
    if let Err(problem) = reported {
        tracing::error!("{problem}");
        say(problem);
    }
}

/// Returns whether the run directory may be removed: this start made it, and the user ended the run
/// before a drive or a stage's death.
fn may_be_removed(arguments: &Arguments, options: &Options, finished: &Finished) -> bool {
    let made_here = arguments.out.is_none() && options.recovered.is_none();
    let is_placed = finished.resets > 0;
    made_here
        && finished.ending.asked_for
        && !finished.drove
        && !is_placed
        && finished.restarts.values().all(|&restarts| restarts == 0)
}

fn title(options: &Options) -> String {
    let mission = &options.mission;
    // A real robot is identified by its address, a simulated one by its pace.
    let pace = match &mission.robot.address {
        Some(address) => format!("at {address}"),
        None => format!("pace {}", options.pace),
    };
    let way = match mission.straight_m() {
        0.0 => "no target yet".to_owned(),
        straight_m => format!("{straight_m:.1} m to the target"),
    };
    format!(
        "mission {}{}: {way}, robot {}, {pace}; everything of this run is in {}",
        mission.name,
        if options.recovered.is_some() { " goes on" } else { "" },
        options.robot,
        options.directory.display()
    )
}
