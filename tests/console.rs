//! Tests of commands at the prompt. They end quietly when their reader is closed.

use std::{
    collections::BTreeSet,
    fs,
    io::{BufRead as _, BufReader, Read as _},
    path::Path,
    process::{Child, ChildStderr, ChildStdout, Command, Stdio},
};

use common::{bus::Kind, poll, topics};
use rustix::process::Signal;
use serde_json::Value;

use crate::support::{
    PATIENCE, Run, STAGES, assert_nothing_left, directory_of, firsthand, firsthand_under, operate,
    output, refused, run, signal_process, start_quietly, wait_for_status,
};

/// Command whose lines are read as they arrive. It ends with the test.
struct Reading {
    child: Child,
    lines: BufReader<ChildStdout>,
    said: BufReader<ChildStderr>,
}

impl Reading {
    fn start(arguments: &[&str]) -> Self {
        let mut child =
            firsthand(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
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
fn echo_prints_every_topic_with_the_fields_of_its_layout() {
    let robot = "con-echo";
    // The robot arrives only after all output.
    let slow = ["--pace", "2", "--set", "controller.speed_m_s=0.05"];
    let run = Run::under_way(robot, "open-room", &slow, 0.2);
    let poses = printed(&["topic", "echo", "pose", "--robot", robot, "--json", "-n", "3"]);
    let ticks: Vec<u64> = poses
        .lines()
        .map(|line| {
            let pose: Value = serde_json::from_str(line).unwrap();
            assert_eq!(pose["covariance"].as_array().unwrap().len(), 6);
            pose["stamp"]["tick"].as_u64().unwrap()
        })
        .collect();
    assert!(ticks.windows(2).all(|pair| pair[1] == pair[0] + 1), "{ticks:?}");
    for topic in topics::TABLE {
        let name = topic.spec().name;
        // These topics need an event, a laser, a robot without counters, lockstep or a mirror.
        if [
            "counts",
            "base_response",
            "tick_limit",
            "contact",
            "complaints",
            "scan",
            "scan_fix",
            "fix",
            "turn",
            "beacon",
            "following",
            "imu_turn",
            "deaths",
            "stalls",
            "requests",
            "orders",
            "faults",
            "place",
            "zones",
            "mirror",
        ]
        .contains(&name)
        {
            continue;
        }
        let text = printed(&["topic", "echo", name, "--robot", robot, "-n", "1"]);
        assert!(text.starts_with("stamp:\n  tick: ") && text.ends_with("---\n"), "{text}");
        let (header, element) = topic.layout();
        let Kind::Struct(header) = header else {
            panic!("{name}");
        };
        for field in &header.fields {
            assert!(
                text.contains(&format!("\n{}:", field.name)) || field.name == "stamp",
                "{text}"
            );
        }
        assert_eq!(text.contains("\nelements:"), element.is_some(), "{text}");
    }
    let roster = printed(&["topic", "echo", "roster", "--robot", robot, "-n", "1"]);
    for stage in STAGES {
        assert!(roster.contains(&format!("- {{stage: {stage:?}, pid: ")), "{roster}");
    }
    let unknown = ["topic", "echo", "poses", "--robot", robot];
    refused(&unknown, "unknown-topic", &["poses", "pose, grid"]);
    run.stop();
}

#[test]
fn echo_follows_its_robot_from_run_to_run_and_ends_on_a_signal() {
    let robot = "con-follow";
    let mut echo = Reading::start(&["topic", "echo", "command", "--robot", robot, "--json"]);
    let mut waits = String::new();
    echo.said.read_line(&mut waits).unwrap();
    assert!(waits.contains(robot), "{waits}");
    let arguments = ["--pace", "8"];
    let first = Run::start(robot, "open-room", &arguments);
    let mut tick = || echo.json()["stamp"]["tick"].as_u64().unwrap();
    while tick() < 10 {}
    first.signal(Signal::TERM);
    first.finish();
    let second = Run::start(robot, "open-room", &arguments);
    while tick() >= 10 {}
    signal_process(echo.child.id(), Signal::TERM);
    let (code, said) = echo.close();
    assert_eq!(code, Some(0));
    // The message came once, at the end of the first run.
    assert_eq!(said.lines().filter(|line| line.contains(robot)).count(), 1, "{said}");
    second.arrives();
}

#[test]
fn whatever_prints_without_end_ends_quietly_when_its_reader_closes_the_pipe() {
    let robot = "con-pipe";
    let run = Run::under_way(robot, "open-room", &["--pace", "1"], 0.5);
    for command in [
        &["topic", "echo", "pose"][..],
        &["topic", "echo", "field", "--json"],
        &["topic", "hz"],
        &["topic", "hz", "pose", "--json"],
        &["logs", "-f"],
    ] {
        let mut reading = Reading::start(&[command, &["--robot", robot]].concat());
        assert!(!reading.line().is_empty(), "{command:?}");
        assert_eq!(reading.close(), (Some(0), String::new()), "{command:?}");
    }
    // This command prints nothing, so a failed write cannot reveal the closed reader.
    let silent = Reading::start(&["topic", "echo", "stalls", "--robot", robot]);
    assert_eq!(silent.close(), (Some(0), String::new()));
    for command in [
        &["status", "--all"][..],
        &["completions", "zsh"],
        &["man"],
        &["topic", "echo", "pose", "-n", "1", "--robot", robot],
    ] {
        let (code, said) = Reading::start(command).close();
        assert!(code == Some(0) && !said.contains("panic"), "{command:?}: {said}");
    }
    run.stop();
}

#[test]
fn hz_counts_every_topic_and_finds_one_that_is_not_published_as_the_table_says() {
    let robot = "con-hz";
    let run = Run::under_way(robot, "obstacle-course", &["--pace", "1"], 0.5);
    let lines = printed(&["topic", "hz", "--robot", robot, "--json", "-n", "2"]);
    let reports: Vec<Value> =
        lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let names: Vec<_> = reports.iter().map(|report| report["topic"].as_str().unwrap()).collect();
    let table: Vec<_> = topics::TABLE.iter().map(|topic| topic.spec().name).collect();
    assert_eq!(names, [&table[..], &table].concat());
    let second = |topic: &str| {
        reports[table.len()..].iter().find(|report| report["topic"] == topic).unwrap()
    };
    // There are 7 ticks a second.
    let rate = second("pose")["rate_hz"].as_f64().unwrap();
    assert!((0.5..=20.0).contains(&rate), "{}", second("pose"));
    assert!(second("pose")["missing_ticks"].is_u64(), "{}", second("pose"));
    assert!(second("health")["rate_hz"].as_f64() > Some(5.0), "{}", second("health"));
    assert!(second("stalls")["age_s"].is_null(), "{}", second("stalls"));
    let text = printed(&["topic", "hz", "pose", "--robot", robot, "-n", "1"]);
    assert!(
        text.starts_with("topic") && text.contains("\npose ") && text.contains("  each tick: "),
        "{text}"
    );

    let mut roster = Reading::start(&["topic", "hz", "roster", "--robot", robot, "--json"]);
    assert!(!roster.line().is_empty());
    operate(robot, &["stage", "freeze", "supervisor"]);
    while roster.json()["late"] != true {}
    operate(robot, &["stage", "thaw", "supervisor"]);
    while roster.json()["late"] != false {}
    roster.close();
    run.stop();
}

#[test]
fn list_shows_the_robots_that_run_and_where() {
    let [one, two] = ["con-list-1", "con-list-2"];
    // The robots still run if another test's frozen robot delays the list.
    let slowly = ["--pace", "1", "--set", "controller.speed_m_s=0.05"];
    let mut runs = [one, two].map(|robot| Run::start(robot, "open-room", &slowly));
    runs.iter_mut().for_each(|run| drop(run.wait_until_under_way(0.5)));
    let listed = |robot: &str| {
        let lines = printed(&["status", "--all", "--json"]);
        let mut robots = lines.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
        robots.find(|it| it["robot"] == robot)
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
    let [mut killed, ended] = runs;
    killed.signal(Signal::KILL);
    killed.reap();
    assert_eq!(listed(one), None);
    let said = output(&["status", "--all"]).stderr;
    assert!(String::from_utf8_lossy(&said).contains(one), "{said:?}");
    ended.signal(Signal::TERM);
    ended.finish();
    assert_eq!(listed(two), None);
    let (code, _) = run(one, "open-room", &["--timeout", "1"]);
    assert_eq!(code, Some(4));
    assert_nothing_left(one);
}

#[test]
fn runs_are_listed_with_their_outcomes_and_pruned() {
    let robot = "con-runs";
    let directory = directory_of(robot);
    let below = directory.path().to_str().unwrap();
    let start = |arguments: &[&str]| {
        let run = ["run", "open-room", "--robot", robot, "--runs", below];
        output(&[&run[..], arguments].concat())
    };
    start(&["--timeout", "1"]);
    start(&[]);
    let goes_on = ["run", "open-room", "--robot", robot, "--pace", "1"];
    let mut goes_on = start_quietly(firsthand(&goes_on).args(["--runs", below]));
    wait_for_status(robot, |status| status["order"] == "driving");
    let list = |arguments: &[&str]| -> Vec<(String, String)> {
        let lines = printed(&[&["runs", "--runs", below, "--json"], arguments].concat());
        let runs = lines.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
        let of = |run: Value| {
            assert!(
                run["size_bytes"].as_u64() > Some(10_000) && run["mission"] == "open-room",
                "{run}"
            );
            let name = Path::new(run["run"].as_str().unwrap()).file_name().unwrap().to_owned();
            (name.into_string().unwrap(), run["outcome"].as_str().unwrap().to_owned())
        };
        runs.map(of).collect()
    };
    let run = |name: &str, outcome: &str| (name.to_owned(), outcome.to_owned());
    let all = [
        run("open-room-001", "timeout"),
        run("open-room-002", "reached"),
        run("open-room-003", "running"),
    ];
    assert_eq!(list(&[]), all);
    assert_eq!(list(&["--robot", "con-other"]), []);
    let table = printed(&["runs", "--runs", below]);
    assert!(table.contains("3 runs, ") && table.contains(" reached "), "{table}");
    assert_eq!(list(&["--prune", "0"]), all[2..], "an active run is not removed");
    goes_on.kill().unwrap();
    goes_on.wait().unwrap();
    assert_eq!(list(&[]), [run("open-room-003", "cut off")]);
    let missing = "/no/such/directory";
    refused(&["runs", "--runs", missing], "", &[missing]);
    start(&["--timeout", "1"]);
    assert_nothing_left(robot);
}

#[test]
fn logs_of_all_processes_come_merged_by_time_and_are_followed_into_the_next_run() {
    let robot = "con-logs";
    let mut follow = Reading::start(&["logs", "-f", "supervisor", "--robot", robot]);
    let first = Run::start(robot, "open-room", &[]);
    while !follow.line().contains("all stages ready") {}
    let directory = first.directory();
    let (code, _, kept) = first.finish_in();
    assert_eq!(code, Some(0));
    let second = Run::start(robot, "open-room", &[]);
    while !follow.line().contains("all stages ready") {}
    second.finish();
    assert_eq!(follow.close().0, Some(0));

    let all = printed(&["logs", "--run", directory.to_str().unwrap()]);
    let words: Vec<Vec<_>> = all.lines().map(|line| line.split_whitespace().collect()).collect();
    let times: Vec<_> = words.iter().map(|words| words[0]).collect();
    assert!(times.is_sorted() && times[0].ends_with('Z'), "{all}");
    let processes: BTreeSet<_> = words.iter().map(|words| words[1]).collect();
    let expected = STAGES.iter().copied().chain(["supervisor", "x80-sim"]);
    assert_eq!(processes, expected.collect(), "{all}");
    let written: usize = fs::read_dir(&directory)
        .unwrap()
        .flatten()
        .map(|file| file.path())
        .filter(|file| file.extension().is_some_and(|end| end == "log"))
        .map(|file| fs::read_to_string(file).unwrap().lines().count())
        .sum();
    assert_eq!(words.len(), written);
    let mapper = printed(&["logs", "mapper", "--run", directory.to_str().unwrap()]);
    assert!(mapper.lines().all(|line| line.contains(" mapper ")), "{mapper}");
    let unknown = ["logs", "wheel", "--run", directory.to_str().unwrap()];
    refused(&unknown, "unknown-process", &["dead-reckoning"]);
    drop(kept);
    assert_nothing_left(robot);
}

#[test]
fn the_manual_page_has_a_section_for_every_subcommand_of_the_help() {
    let help = printed(&["help"]);
    let names: Vec<_> = help
        .lines()
        .take_while(|line| *line != "Options:")
        .filter_map(|line| line.strip_prefix("  ")?.split_whitespace().next())
        .collect();
    assert!(names.len() > 18, "{names:?}");
    let man = printed(&["man"]);
    for name in names.iter().copied().chain(["topic echo", "stage kill"]) {
        let section = format!(".SH \"{}\"\n", name.to_uppercase());
        assert!(man.contains(&section), "{name}");
    }
    assert!(man.contains("\\-\\-resume\\-last"), "{man}");
}

#[test]
fn bash_completes_options_stages_topics_missions_pages_and_old_names_nowhere() {
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
