//! `simulate`: runs of the whole robot in one process, each from one seed.

use std::{
    cell::RefCell,
    env,
    path::{Path, PathBuf},
    process::ExitCode,
    rc::Rc,
    time::{Instant, SystemTime},
};

use clap::Args;
use common::{VERSION, bus::Bus, file::append};
use console::{missions, output::print_line};
use recording::{
    Recording, RecordingError, Tape,
    replay::{Options, replay},
};
use simulation::{Observer, Ran, Scenario};
use tracing::subscriber::{DefaultGuard, NoSubscriber, set_default};

use crate::error::{OrCannot as _, Result};

/// Simulate runs in one process, with faults drawn from a seed, and check invariants after every
/// event.
#[derive(Debug, Args)]
pub struct Arguments {
    /// A shipped mission or a mission file.
    #[arg(default_value = "obstacle-course")]
    mission: String,
    /// Number of seeds.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    count: u64,
    /// First seed; each run takes the next one. Without it the clock draws one.
    #[arg(long)]
    seed: Option<u64>,
    /// Remove disturbances while the same invariant breaks.
    #[arg(long)]
    shrink: bool,
    /// Print the disturbances and the result of each run.
    #[arg(long)]
    verbose: bool,
    /// Record the run, for `firsthand replay` and the page.
    #[arg(long, value_name = "FILE", conflicts_with = "count")]
    out: Option<PathBuf>,
    /// Replay every generation of every stage, which must give the same samples to the bit.
    #[arg(long)]
    replay: bool,
    /// Append a row of totals to a CSV file.
    #[arg(long, value_name = "FILE")]
    rows: Option<PathBuf>,
    /// Set a mission key; repeatable.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
}

#[derive(Default)]
struct Totals {
    broken: u64,
    events: u64,
    simulated_s: f64,
    /// Disturbances that fell into the runs.
    disturbances: usize,
    supervisors_killed: u32,
}

impl Totals {
    fn add(&mut self, scenario: &Scenario, ran: &Ran) {
        let drawn = scenario.disturbances.iter();
        self.broken += u64::from(ran.broken.is_some());
        self.events += ran.events;
        self.simulated_s += ran.simulated.as_secs_f64();
        self.disturbances += drawn.filter(|drawn| drawn.at < ran.simulated).count();
        self.supervisors_killed += ran.supervisors - 1;
    }

    /// Appends a row to `file`, and the header if the file is new.
    fn append(&self, arguments: &Arguments, first: u64, minutes: f64, file: &Path) -> Result {
        let is_new = !file.exists();
        let mut writer = csv::Writer::from_writer(append(file).or_cannot("open the rows")?);
        if is_new {
            writer.write_record(COLUMNS)?;
        }
        writer.serialize((
            "seeds",
            &arguments.mission,
            first,
            arguments.count,
            self.broken,
            self.disturbances,
            self.supervisors_killed,
            self.events,
            format!("{:.1}", self.simulated_s / 3600.0),
            format!("{minutes:.1}"),
        ))?;
        Ok(writer.flush()?)
    }
}

const COLUMNS: [&str; 10] = [
    "section",
    "mission",
    "first seed",
    "runs",
    "broken",
    "disturbances",
    "supervisors killed",
    "events",
    "hours of mission",
    "minutes",
];

/// Keeps what simulated processes log from the terminal, unless `FIRSTHAND_LOG` asks for it.
pub fn quietly() -> Option<DefaultGuard> {
    let is_asked = env::var_os("FIRSTHAND_LOG").is_some();
    (!is_asked).then(|| set_default(NoSubscriber::default()))
}

pub fn main(arguments: &Arguments) -> Result<ExitCode> {
    let _quiet = quietly();
    let mission = missions::load(&arguments.mission, &arguments.set)?;
    let first = arguments.seed.unwrap_or_else(|| {
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
        now.map_or(0, |since| since.as_nanos() as u64)
    });
    let began = Instant::now();
    let mut totals = Totals::default();
    for seed in (0..arguments.count).map(|nth| first.wrapping_add(nth)) {
        let scenario = Scenario::draw(&mission, seed);
        let ran = run(&scenario, arguments)?;
        totals.add(&scenario, &ran);
        if arguments.verbose {
            show(&scenario)?;
            let outcome = ran.finished.as_ref().map(|finished| &finished.ending);
            print_line(format!("seed {seed}: {outcome:?} after {} events", ran.events))?;
        }
        if let Some(broken) = ran.broken {
            print_line(format!("simulation: seed {} at {VERSION}: {broken}", scenario.seed))?;
            if arguments.shrink {
                show(&scenario.shrink(&broken))?;
            }
        }
    }
    let seconds = began.elapsed().as_secs_f64();
    print_line(format!(
        "{} runs from seed {first}: {} broke an invariant; {} events in {:.0} s of mission, {} supervisors killed, {seconds:.1} s",
        arguments.count,
        totals.broken,
        totals.events,
        totals.simulated_s,
        totals.supervisors_killed,
    ))?;
    if let Some(file) = &arguments.rows {
        totals.append(arguments, first, seconds / 60.0, file)?;
    }
    Ok(if totals.broken == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Records and replays the run if asked.
fn run(scenario: &Scenario, arguments: &Arguments) -> Result<Ran> {
    if arguments.out.is_none() && !arguments.replay {
        return Ok(scenario.run());
    }
    let directory = tempfile::tempdir().or_cannot("make a directory for recordings")?;
    let replayed = directory.path().join("recording.mcap");
    let out = arguments.out.as_ref().unwrap_or(&replayed);
    let mut ran = record(scenario, out)?;
    if arguments.replay && ran.broken.is_none() {
        let report = replay(&Recording::open(out)?, &Options::default())?;
        let not_replayed = report.stages.values().flat_map(|stage| &stage.not_replayed);
        let why = not_replayed.map(|(number, why)| format!("generation {number}: {why}")).next();
        let detail = report.difference.map(|difference| difference.to_string()).or(why);
        ran.broken =
            detail.map(|detail| ran.broken_at_end("a generation replays to the bit", detail));
    }
    Ok(ran)
}

/// Runs `scenario` before `observer`, and returns it too, unless the simulation keeps it.
pub fn observe<T: Observer + 'static>(scenario: &Scenario, observer: T) -> (Ran, Option<T>) {
    let observer = Rc::new(RefCell::new(observer));
    let ran = scenario.run_before(Some(observer.clone()));
    (ran, Rc::into_inner(observer).map(RefCell::into_inner))
}

pub fn record(scenario: &Scenario, out: &Path) -> Result<Ran> {
    let tape = Tape::new(&Scenario::robot(), Scenario::directory(), out.to_path_buf());
    let (ran, recorder) = observe(scenario, Recorder { tape, failed: Ok(()) });
    if let Some(Recorder { tape, failed }) = recorder {
        failed?;
        tape.finish()?;
    }
    Ok(ran)
}

/// Recorder of a simulated run. After its first error it only keeps that.
struct Recorder {
    tape: Tape,
    failed: Result<(), RecordingError>,
}

impl Recorder {
    fn record(&mut self, act: impl FnOnce(&mut Tape) -> Result<(), RecordingError>) {
        if self.failed.is_ok() {
            self.failed = act(&mut self.tape);
        }
    }
}

impl Observer for Recorder {
    fn on_bus(&mut self, bus: &Bus) {
        self.record(|tape| tape.attach(bus));
    }

    fn observe(&mut self) {
        self.record(Tape::take);
    }
}

fn show(scenario: &Scenario) -> Result {
    print_line(format!("load {:?}", scenario.load))?;
    for disturbance in &scenario.disturbances {
        print_line(disturbance.to_string())?;
    }
    Ok(())
}
