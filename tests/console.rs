//! Tests of commands at the prompt. They end quietly when their reader is closed.

use std::{
    fs,
    io::{BufRead as _, BufReader, Read as _},
    path::Path,
    process::{Child, ChildStderr, ChildStdout, Command, Stdio},
};

use common::{bus::Kind, poll, topics};
use rustix::process::Signal;
use serde_json::Value;

use crate::support::{
    ENDLESS, PATIENCE, Run, STAGES, assert_no_restart, assert_nothing_left, assert_said,
    directory_of, firsthand, firsthand_under, generation, json_lines, kill, operate, output, pid,
    refused, run, signal_process, start_piped, start_quietly, wait_for_status, words,
};

/// Command whose lines are read as they arrive. It ends with the test.
struct Reading {
    child: Child,
    lines: BufReader<ChildStdout>,
    said: BufReader<ChildStderr>,
}

impl Reading {
    fn start(line: &str) -> Self {
        let mut child = start_piped(firsthand(&words(line)).stderr(Stdio::piped()));
        let lines = BufReader::new(child.stdout.take().unwrap());
        let said = BufReader::new(child.stderr.take().unwrap());
        Self { child, lines, said }
    }

    fn line(&mut self) -> String {
        let mut line = String::new();
        let is_there = !self.lines.buffer().is_empty();
        assert!(is_there || poll::is_readable(self.lines.get_ref(), PATIENCE).unwrap(), "no line");
        self.lines.read_line(&mut line).unwrap();
        line
    }

    fn json(&mut self) -> Value {
        let line = self.line();
        serde_json::from_str(&line).unwrap_or_else(|error| panic!("{line:?}: {error}"))
    }

    /// Closes the pipe, which ends the command. Returns its exit code and messages.
    fn close(self) -> (Option<i32>, String) {
        let Self { mut child, lines, mut said } = self;
        drop(lines);
        let mut rest = String::new();
        said.read_to_string(&mut rest).unwrap();
        (child.wait().unwrap().code(), rest)
    }
}

/// Returns the output of a command that must end successfully within [`PATIENCE`].
fn printed(arguments: &[&str]) -> String {
    let patience = PATIENCE.as_secs().to_string();
    let limited = ["timeout", "--signal", "KILL", &patience];
    let output = firsthand_under(&limited, arguments).output().unwrap();
    assert!(output.status.success(), "{arguments:?}: {output:?}");
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn every_topic_is_echoed_and_counted_and_a_closed_standard_output_makes_no_command_fail() {
    let robot = "con-echo";
    // The robot arrives only after all output.
    let slow = "--pace 2 --set controller.speed_m_s=0.02";
    let run = Run::under_way(robot, "open-room", slow, 0.2);
    let of_robot = |line: &str| printed(&words(&format!("{line} --robot {robot}")));
    echo_prints_every_topic(robot, of_robot);
    hz_counts_every_topic(robot, of_robot);
    let closed = |line: &str, silent: bool| {
        let mut reading = Reading::start(&format!("{line} --robot {robot}"));
        assert!(silent || !reading.line().is_empty(), "{line}");
        let (code, said) = reading.close();
        assert!(code == Some(0) && !said.contains("panic"), "{line}: {said}");
        assert!(silent || said.is_empty(), "{line}: {said}");
    };
    for line in [
        "topic echo pose",
        "topic echo field --json",
        "topic hz",
        "topic hz pose --json",
        "logs -f",
    ] {
        closed(line, false);
    }
    // The first prints nothing, so a failed write cannot reveal the closed reader.
    for line in ["topic echo stalls", "topic echo pose -n 1", "status"] {
        closed(line, true);
    }
    let directory = directory_of("con-shut");
    let out = directory.path().join("run");
    for line in [
        "status --all",
        "completions zsh",
        "man",
        "missions",
        "missions trap",
        "check trap",
        "install --print",
        "topic list",
        "stage list",
        "table failsafe",
        "help tables",
        &format!("run open-room --robot con-shut --out {}", out.display()),
    ] {
        // A pipe without a reader from the start.
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let status = firsthand(&words(line)).stdout(writer).stderr(Stdio::null()).status();
        assert_eq!(status.unwrap().code(), Some(0), "{line}");
    }
    run.stop();
}

/// Topics that need an event, a laser, a robot without counters, lockstep or a mirror.
const SELDOM: &str = "counts base_response tick_limit contact complaints scan scan_fix fix turn \
    beacon following imu_turn deaths stalls requests orders faults place zones mirror";

fn echo_prints_every_topic(robot: &str, printed: impl Fn(&str) -> String) {
    let poses = json_lines(&printed("topic echo pose --json -n 3"));
    let tick = |pose: &Value| pose["stamp"]["tick"].as_u64().unwrap();
    assert!(poses.windows(2).all(|pair| tick(&pair[1]) == tick(&pair[0]) + 1), "{poses:?}");
    assert_eq!(poses[0]["covariance"].as_array().unwrap().len(), 6);
    for topic in topics::TABLE {
        let name = topic.spec().name;
        if SELDOM.split_whitespace().any(|seldom| seldom == name) {
            continue;
        }
        let text = printed(&format!("topic echo {name} -n 1"));
        assert!(text.starts_with("stamp:\n  tick: ") && text.ends_with("---\n"), "{text}");
        let (Kind::Struct(header), element) = topic.layout() else { panic!("{name}") };
        for field in header.fields.iter().filter(|field| field.name != "stamp") {
            assert!(text.contains(&format!("\n{}:", field.name)), "{text}");
        }
        assert_eq!(text.contains("\nelements:"), element.is_some(), "{text}");
    }
    let roster = printed("topic echo roster -n 1");
    for stage in STAGES {
        assert!(roster.contains(&format!("- {{stage: {stage:?}, pid: ")), "{roster}");
    }
    refused(
        &["topic", "echo", "poses", "--robot", robot],
        "unknown-topic",
        &["poses", "pose, grid"],
    );
}

fn hz_counts_every_topic(robot: &str, printed: impl Fn(&str) -> String) {
    let reports = json_lines(&printed("topic hz --json -n 2"));
    let names: Vec<_> = reports.iter().map(|report| report["topic"].as_str().unwrap()).collect();
    let table: Vec<_> = topics::TABLE.iter().map(|topic| topic.spec().name).collect();
    assert_eq!(names, [&table[..], &table].concat());
    let second = |topic: &str| reports.iter().rfind(|report| report["topic"] == topic).unwrap();
    // There are 7 ticks a second, at twice the wall clock.
    let rate = second("pose")["rate_hz"].as_f64().unwrap();
    assert!((0.5..=40.0).contains(&rate), "{rate}");
    assert!(second("pose")["missing_ticks"].is_u64(), "{reports:?}");
    assert!(second("health")["rate_hz"].as_f64() > Some(5.0), "{reports:?}");
    assert!(second("stalls")["age_s"].is_null(), "{reports:?}");
    let text = printed("topic hz pose -n 1");
    let has = |part| text.contains(part);
    assert!(text.starts_with("topic") && has("\npose ") && has("  each tick: "), "{text}");

    let mut roster = Reading::start(&format!("topic hz roster --robot {robot} --json"));
    assert!(!roster.line().is_empty());
    operate(robot, "stage freeze supervisor");
    while roster.json()["late"] != true {}
    operate(robot, "stage thaw supervisor");
    while roster.json()["late"] != false {}
    roster.close();
}

#[test]
fn echo_and_logs_follow_their_robot_from_run_to_run_and_logs_come_from_every_process() {
    let robot = "con-follow";
    let mut echo = Reading::start(&format!("topic echo command --robot {robot} --json"));
    let mut logs = Reading::start(&format!("logs -f supervisor --robot {robot}"));
    let mut waits = String::new();
    echo.said.read_line(&mut waits).unwrap();
    assert!(waits.contains(robot), "{waits}");
    let arguments = "--pace 8";
    let first = Run::start(robot, "open-room", arguments);
    let mut tick = || echo.json()["stamp"]["tick"].as_u64().unwrap();
    while !logs.line().contains("all stages ready") {}
    while tick() < 10 {}
    first.signal(Signal::TERM);
    let (_, _, directory) = first.finish_in();
    let second = Run::start(robot, "open-room", arguments);
    while !logs.line().contains("all stages ready") {}
    while tick() >= 10 {}
    signal_process(echo.child.id(), Signal::TERM);
    let (code, said) = echo.close();
    assert_eq!(code, Some(0));
    // The message came once, at the end of the first run.
    assert_eq!(said.lines().filter(|line| line.contains(robot)).count(), 1, "{said}");
    second.arrives();
    assert_eq!(logs.close().0, Some(0));

    let run = directory.path().join("run");
    let run = run.to_str().unwrap();
    let all = printed(&["logs", "--run", run]);
    for process in STAGES.iter().copied().chain(["supervisor", "x80-sim"]) {
        assert!(all.contains(&format!(" {process} ")), "{all}");
    }
    let mapper = printed(&["logs", "mapper", "--run", run]);
    assert!(mapper.lines().all(|line| line.contains(" mapper ")), "{mapper}");
    refused(&["logs", "wheel", "--run", run], "unknown-process", &["dead-reckoning"]);
}

#[test]
fn robots_that_run_are_listed_with_their_place_and_do_not_see_each_other() {
    let [one, two] = ["con-list-1", "con-list-2"];
    let mut runs = [one, two].map(|robot| Run::start(robot, "open-room", ENDLESS));
    runs.iter_mut().for_each(|run| drop(run.wait_until_under_way(0.5)));
    let listed = |robot: &str| {
        let robots = json_lines(&printed(&["status", "--all", "--json"]));
        robots.into_iter().find(|it| it["robot"] == robot)
    };
    for run in &runs {
        let robot = listed(&run.robot).unwrap();
        assert_eq!(robot["supervisor_pid"], run.pid(), "{robot}");
        assert_eq!((&robot["state"], &robot["simulated"]), (&"driving".into(), &true.into()));
        let directory = fs::canonicalize(run.directory()).unwrap();
        assert_eq!(robot["run"], directory.to_str().unwrap(), "{robot}");
        assert!(robot["mission_time_s"].as_f64() > Some(0.4), "{robot}");
    }
    assert!(printed(&["status", "--all"]).contains("con-list-2 "));
    let [mut killed, mut ended] = runs;
    let status = killed.kill_and_await_successor("mapper", Signal::KILL);
    let other = ended.wait_until_all_run();
    assert_eq!(generation(&other, "mapper"), 1, "{other}");
    assert_ne!(pid(&status, "mapper"), pid(&other, "mapper"));
    killed.kill();
    assert_eq!(listed(one), None);
    assert_said(&output(&["status", "--all"]), &[one]);
    assert_no_restart(&ended.stop());
    assert_eq!(listed(two), None);
    let (code, _) = run(one, "open-room", "--timeout 1");
    assert_eq!(code, Some(4));
    assert_nothing_left(one);
}

#[test]
fn runs_are_listed_with_their_outcomes_and_pruned() {
    let robot = "con-runs";
    let directory = directory_of(robot);
    let below = directory.path().to_str().unwrap();
    let begin = ["run", "open-room", "--robot", robot, "--runs", below];
    printed(&begin);
    let mut goes_on = start_quietly(firsthand(&begin).args(["--pace", "1"]));
    wait_for_status(robot, |status| status["order"] == "driving");
    let list = |arguments: &[&str]| -> Vec<_> {
        let lines = printed(&[&["runs", "--runs", below, "--json"], arguments].concat());
        let of = |run: &Value| {
            let name = Path::new(run["run"].as_str().unwrap()).file_name().unwrap();
            format!("{} {}", name.display(), run["outcome"].as_str().unwrap())
        };
        json_lines(&lines).iter().map(of).collect()
    };
    let all = ["open-room-001 reached", "open-room-002 running"];
    assert_eq!(list(&[]), all);
    let table = printed(&["runs", "--runs", below]);
    assert!(table.contains("2 runs, ") && table.contains(" reached "), "{table}");
    assert_eq!(list(&["--prune", "0"]), all[1..], "an active run is not removed");
    kill(&mut goes_on);
    assert_eq!(list(&[]), ["open-room-002 cut off"]);
    let missing = "/no/such/directory";
    refused(&["runs", "--runs", missing], "", &[missing]);
    printed(&begin);
    assert_nothing_left(robot);
}

#[test]
fn the_manual_page_has_each_subcommand_and_bash_completes_options_names_and_pages() {
    let help = printed(&["help"]);
    let names: Vec<_> = help
        .lines()
        .take_while(|line| *line != "Options:")
        .filter_map(|line| line.strip_prefix("  ")?.split_whitespace().next())
        .collect();
    assert!(names.len() > 18, "{names:?}");
    let man = printed(&["man"]);
    for name in names.iter().copied().chain(["topic echo", "stage kill"]) {
        assert!(man.contains(&format!(".SH \"{}\"\n", name.to_uppercase())), "{name}");
    }
    assert!(man.contains("\\-\\-resume\\-last"), "{man}");

    let script = printed(&["completions", "bash"]);
    let executable = Path::new(env!("CARGO_BIN_EXE_firsthand"));
    let path = executable.parent().unwrap().display();
    let completed = |words: &str| {
        let at = words.split(' ').count() - 1;
        let last = words.rsplit(' ').next().unwrap();
        let ask = format!(
            "PATH={path}:$PATH; COMP_TYPE=9; COMP_WORDS=({words} ''); COMP_CWORD={at}
            _clap_complete_firsthand firsthand '{last}' ''; printf '%s\\n' \"${{COMPREPLY[@]}}\""
        );
        let output =
            Command::new("bash").args(["-c", &format!("{script}\n{ask}")]).output().unwrap();
        String::from_utf8(output.stdout).unwrap()
    };
    for (words, candidate) in [
        ("firsthand stage kill --ro", "--robot"),
        ("firsthand stage kill map", "mapper"),
        ("firsthand stage pla", "planner"),
        ("firsthand topic echo po", "pose"),
        ("firsthand run tr", "trap"),
        ("firsthand help att", "attach"),
        ("firsthand lo", "logs"),
    ] {
        let completed = completed(words);
        assert!(completed.lines().any(|it| it == candidate), "{words}: {completed}");
    }
    assert_eq!(completed("firsthand ki").trim(), "");
    for shell in ["zsh", "fish", "elvish", "powershell"] {
        assert!(printed(&["completions", shell]).contains("firsthand"), "{shell}");
    }
}
