//! Tests of run reports through real processes.

use std::fs;

use rustix::process::Signal;

use serde_json::Value;

use crate::support::{Run, assert_nothing_left, messages, printed, refused};

/// Returns the events of a page with their subjects, and the last message.
fn events(page: &str) -> (Vec<String>, Value) {
    let (messages, _) = messages(page);
    let all = messages.iter().filter_map(|message| message["events"].as_array()).flatten();
    let told = |event: &Value| format!("{}: {}", event["of"], event["text"]).replace('"', "");
    (all.map(told).collect(), messages.last().unwrap().clone())
}

#[test]
fn a_run_ends_with_a_report_that_tells_of_a_planner_that_was_killed() {
    let mut run = Run::under_way("report-kill", "open-room", &["--pace", "4"], 0.5);
    run.kill_and_await_successor("planner", Signal::KILL);
    let (code, summary, directory) = run.finish_in();
    assert_eq!(code, Some(0), "{summary}");
    let page = fs::read_to_string(directory.path().join("run/report/report.html")).unwrap();
    let (told, last) = events(&page);
    assert!(told.iter().any(|event| event.starts_with("planner: generation 1 died (signal 9)")));
    assert!(told.iter().any(|event| event == "planner: generation 2 runs"), "{told:?}");
    assert!(last["outcome"].as_str().unwrap().starts_with("reached"), "{last}");
    assert!(!page.contains("src=\"") && !page.contains("href=\"/"), "it refers to something");
    let (messages, _) = messages(&page);
    let columns = messages[0]["about"]["columns"].as_array().unwrap();
    let at = columns.iter().position(|column| column == "true_x").unwrap();
    let rows = messages.iter().filter_map(|message| message["rows"].as_array()).flatten();
    assert!(rows.filter(|row| row[at].is_number()).count() > 10, "it has the ground truth");

    // The recording alone, without a summary, gives the same report.
    let alone = tempfile::tempdir().unwrap();
    let file = alone.path().join("drive.mcap");
    fs::copy(directory.path().join("run/recording.mcap"), &file).unwrap();
    let page = printed(&["report", file.to_str().unwrap()]);
    let (alone, last) = events(&fs::read_to_string(page.trim_end()).unwrap());
    assert_eq!(alone, told);
    assert!(last["outcome"].as_str().unwrap().contains("end is unknown"));
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
    let run = Run::under_way("report-full", "open-room", &["--pace", "4"], 0.2);
    // A file takes the directory's place.
    fs::write(run.directory().join("report"), "").unwrap();
    let (code, summary, _directory) = run.finish_in();
    assert_eq!((code, &summary["outcome"]), (Some(0), &"reached".into()), "{summary}");
    assert_nothing_left("report-full");
}
