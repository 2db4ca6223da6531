//! Tests of the paper's experiments: rows, and continuation after an interruption.

use std::{fs, path::Path};

use serde_json::Value;

use crate::support::{printed, refused};

fn three_of_them<'a>(out: &'a Path, seeds: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let only = ["experiments", "--only", "1a,3,5-constant", "--realism"];
    let into = ["laboratory", "--json", "--out", out.to_str().unwrap()];
    [&only[..], &into, &["--seeds", seeds], more].concat()
}

fn experiments(out: &Path, more: &[&str]) -> Vec<Value> {
    let lines = printed(&three_of_them(out, "1", more));
    let objects = lines.lines().map(|line| serde_json::from_str(line).unwrap());
    objects.collect()
}

#[test]
fn experiments_give_a_row_each_and_the_same_ones_again_when_they_were_cut_off() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("experiments");
    let whole = experiments(&out, &[]);
    let names: Vec<_> = whole.iter().map(|it| it["experiment"].as_str().unwrap()).collect();
    assert_eq!(names, ["1a", "3", "5-constant"]);
    for object in &whole {
        let paper = &object["paper"];
        assert_eq!(paper["count"], 1, "{object}");
        assert_eq!(paper["arrived"], 1, "{object}");
        for figure in ["time_s", "k", "sonar_unavailable", "wheel_range_rad_s"] {
            let median = paper[figure]["median"].as_f64();
            assert!(median > Some(0.0), "{figure}: {object}");
        }
    }
    assert_eq!(whole[1]["paper"]["safety_events"]["median"], 0.0, "nothing is sensed");
    assert!(whole[2].get("evidential").is_none(), "it has no constant speed");
    assert!(out.join("index.html").exists());
    assert!(out.join("pictures/3-1-paper.svg").exists());

    let rows = fs::read_to_string(out.join("rows.csv")).unwrap();
    assert_eq!(rows.lines().count(), 6, "{rows}");
    let (first, last) = rows.trim_end().rsplit_once('\n').unwrap();
    // State of experiments killed while they wrote the last row.
    fs::write(out.join("rows.csv"), format!("{first}\n{}", &last[..9])).unwrap();
    let resumed = experiments(&out, &["--resume"]);
    assert_eq!(resumed, whole);
    assert_eq!(fs::read_to_string(out.join("rows.csv")).unwrap(), rows);

    let again = three_of_them(&out, "1", &[]);
    refused(&again, "results-there", &["--resume"]);
    let other = three_of_them(&out, "2", &["--resume"]);
    refused(&other, "other-results", &[]);
}
