//! Tests of evaluations: many missions, judged by the ground truth.

use std::fs;

use serde_json::Value;

use crate::support::{messages, printed, refused, words};

fn two_rooms(out: &str, more: &str) -> String {
    format!("evaluate --worlds rooms --count 2 --out {out} --json {more}")
}

fn evaluate(out: &str, more: &str) -> Value {
    serde_json::from_str(&printed(&words(&two_rooms(out, more)))).unwrap()
}

#[test]
fn an_evaluation_that_was_cut_off_goes_on_and_another_is_not_mixed_with_it() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("rooms");
    let name = out.to_str().unwrap();
    let seed = "--seed 5 --sensors front+infrared";
    let whole = evaluate(name, seed);
    assert_eq!(whole["count"], 2, "{whole}");
    assert_eq!(whole["aborted"], 0.0, "{whole}");
    assert!(out.join("index.html").exists());

    let rows = fs::read_to_string(out.join("rows.csv")).unwrap();
    assert!(rows.contains("evidential front+infrared"), "{rows}");
    let (first, _) = rows.trim_end().rsplit_once('\n').unwrap();
    // State of an evaluation killed while it wrote the last row.
    fs::write(out.join("rows.csv"), format!("{first}\nrooms-5-0001,6,evid")).unwrap();
    let resumed = evaluate(name, &format!("{seed} --resume --processes"));
    assert_eq!(resumed["count"], 2, "{resumed}");
    assert_eq!(resumed["success"], whole["success"]);
    let again = fs::read_to_string(out.join("rows.csv")).unwrap();
    assert_eq!(again, rows, "the rows follow from the seed");
    let latencies = fs::read_to_string(out.join("latencies.csv")).unwrap();
    assert!(latencies.lines().count() > 1, "the resumed mission was driven by processes");

    let again = two_rooms(name, seed);
    refused(&words(&again), "results-there", &["--resume"]);
    let other = two_rooms(name, "--seed 6 --resume");
    refused(&words(&other), "other-results", &[name]);
}

#[test]
fn two_robots_that_meet_have_a_row_each_and_the_same_rows_twice() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("rooms");
    let rows = |more: &str| {
        let robots = "--robot turtlebot2 --set robot.rate_hz=10 --seed 3";
        let meeting = format!("evaluate --json --worlds meeting --count 2 --out {}", out.display());
        printed(&words(&format!("{meeting} {robots} {more}")));
        fs::read_to_string(out.join("rows.csv")).unwrap()
    };
    let first = rows("");
    let worlds = ["0000", "0000-oncoming", "0001", "0001-oncoming"];
    let named = first.lines().skip(1).map(|row| row.split(',').next().unwrap());
    assert!(named.eq(worlds.map(|world| format!("meeting-3-{world}"))), "{first}");
    assert_eq!(first.matches(",success,").count(), 4, "{first}");
    // One robot's row is lost, so both drive again.
    let kept = first.lines().filter(|row| !row.contains("0001-oncoming"));
    let kept: String = kept.map(|row| format!("{row}\n")).collect();
    fs::write(out.join("rows.csv"), kept).unwrap();
    assert_eq!(first, rows("--resume"));
}

#[test]
fn a_failure_of_an_evaluation_is_opened_as_the_page_of_its_run() {
    let out = tempfile::tempdir().unwrap();
    let name = out.path().join("late");
    let all = evaluate(name.to_str().unwrap(), "--set timeout_s=3");
    assert_eq!(all["timeout"], 1.0, "{all}");
    let files = fs::read_dir(name.join("failures")).unwrap();
    let files: Vec<_> = files.map(|file| file.unwrap().path()).collect();
    let pages: Vec<_> = files.iter().filter(|file| file.extension().unwrap() == "html").collect();
    assert_eq!((pages.len(), files.len()), (2, 4), "each has its picture: {files:?}");
    let index = fs::read_to_string(name.join("index.html")).unwrap();
    for page in pages {
        let (messages, _) = messages(&fs::read_to_string(page).unwrap());
        assert_eq!(messages.last().unwrap()["kind"], "bad");
        let file = page.file_name().unwrap().to_str().unwrap();
        assert!(index.contains(&format!("href=\"failures/{file}\"")), "{index}");
    }
}
