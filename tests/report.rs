//! Reports of runs through real processes.

use std::fs;

use rustix::process::Signal;

use crate::support::{Run, assert_nothing_left, printed, refused};

/// The figures of a robot with two driven wheels.
const FIGURES: [&str; 8] = [
    "trajectory",
    "timeline",
    "sonar",
    "speed",
    "turning",
    "wheel-left",
    "wheel-right",
    "tick-latency",
];

#[test]
fn a_run_ends_with_a_report_of_every_figure_and_of_a_planner_that_was_killed() {
    let mut run = Run::start("report-kill", "open-room", &["--pace", "2"]);
    run.wait_until_under_way(0.5);
    run.kill_and_await_successor("planner", Signal::KILL);
    let (code, summary, directory) = run.finish_in();
    assert_eq!(code, Some(0), "{summary}");
    let report = directory.path().join("run/report");
    let page = fs::read_to_string(report.join("report.html")).unwrap();
    assert!(page.contains("<td>planner</td><td>generation 1 died (signal 9)"));
    assert!(page.contains("<td>planner</td><td>generation 2 is ready"));
    assert!(page.contains("1 (reached)"));
    assert!(!page.contains("http"), "the page refers to something else");
    for figure in FIGURES {
        assert!(page.contains(&format!("<figure id=\"{figure}\">")));
        let svg = fs::read_to_string(report.join(format!("{figure}.svg"))).unwrap();
        // It is parsed for that.
        picture::png(&svg).unwrap();
        let alone = svg.replacen("http://www.w3.org/2000/svg", "", 1);
        assert!(!alone.contains("http"), "{figure} refers to something else");
        if figure == "timeline" {
            assert!(svg.contains(">process ended<") && svg.contains(">successor ready<"));
        }
    }

    // The report must be the same from the file alone, without a summary beside it.
    let alone = tempfile::tempdir().unwrap();
    let file = alone.path().join("drive.mcap");
    fs::copy(directory.path().join("run/recording.mcap"), &file).unwrap();
    let page = printed(&["report", file.to_str().unwrap()]);
    let page = fs::read_to_string(page.trim_end()).unwrap();
    assert!(page.contains("generation 1 died (signal 9)"));
    assert!(page.contains("how it ended is not known here"));
    assert_nothing_left("report-kill");
}

#[test]
fn a_run_that_was_not_recorded_has_no_report_and_the_command_says_why() {
    let run = Run::start("report-none", "open-room", &["--no-record"]);
    let (code, summary, directory) = run.finish_in();
    assert_eq!(code, Some(0), "{summary}");
    let run = directory.path().join("run");
    assert!(!run.join("report").exists());
    refused(&["report", run.to_str().unwrap()], "no-recording", &[]);
}

#[test]
fn a_report_that_cannot_be_written_does_not_end_the_mission() {
    let mut run = Run::start("report-full", "open-room", &["--pace", "4"]);
    run.wait_until_under_way(0.2);
    // A file where the directory goes.
    fs::write(run.directory().join("report"), "").unwrap();
    let (code, summary, _directory) = run.finish_in();
    assert_eq!((code, &summary["outcome"]), (Some(0), &"reached".into()), "{summary}");
    assert_nothing_left("report-full");
}
