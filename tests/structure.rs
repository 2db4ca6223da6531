//! Permitted dependencies between crates. Privacy inside a crate is checked by the compiler.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
    process::Command,
};

use serde_json::Value;

fn root() -> PathBuf {
    std::fs::canonicalize(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).unwrap()
}

fn cargo(arguments: &[&str]) -> String {
    let mut command = Command::new(env!("CARGO"));
    let output = command.args(arguments).args(["--offline", "--locked"]).current_dir(root());
    let output = output.output().unwrap();
    assert!(output.status.success(), "{output:?}");
    String::from_utf8(output.stdout).unwrap()
}

fn list<'a>(of: &'a Value, key: &str) -> &'a [Value] {
    of[key].as_array().unwrap()
}

fn packages() -> Vec<Value> {
    let metadata = cargo(&["metadata", "--no-deps", "--format-version", "1"]);
    let metadata: Value = serde_json::from_str(&metadata).unwrap();
    list(&metadata, "packages").to_vec()
}

fn folder(package: &Value) -> &Path {
    Path::new(package["manifest_path"].as_str().unwrap()).parent().unwrap()
}

#[test]
fn the_middleware_is_named_in_one_place_and_no_stage_knows_another_nor_the_supervisor() {
    let packages = packages();
    let [services, supervisor, tests] =
        ["services", "supervisor", "tests"].map(|at| root().join(at));
    let below = |top: &Path, name: &str| {
        packages.iter().any(|package| package["name"] == name && folder(package).starts_with(top))
    };
    for package in &packages {
        let member = package["name"].as_str().unwrap();
        let used = list(package, "dependencies").iter().filter(|used| used["kind"].is_null());
        for name in used.map(|used| used["name"].as_str().unwrap()) {
            let is_bus = member == "firsthand-bus";
            assert!(is_bus || !name.starts_with("iceoryx2"), "{member} depends on it");
            // The link has its drivers, and the planner its solver.
            let own = member == "link" && name.ends_with("-driver") || below(folder(package), name);
            let foreign = below(&services, name) && !own
                || [&supervisor, &tests].iter().any(|top| below(top, name));
            let is_stage = folder(package).starts_with(&services);
            assert!(!(is_stage && foreign), "{member} depends on {name}");
        }
    }
}

#[test]
fn the_robots_executable_contains_no_viewer_and_what_watches_it_no_pictures_files_or_chance() {
    for (package, there, tools) in [
        ("mission-control", "firsthand-common", "png mcap csv rand_pcg picture x80-sim clap"),
        ("firsthand", "x80-sim", "tokio axum ratatui foxglove rustdds firsthand-lab"),
    ] {
        let linked = ["tree", "--package", package, "--edges", "normal", "--prefix", "none"];
        let linked = cargo(&[&linked[..], &["--format", "{p}"]].concat());
        let names: BTreeSet<_> =
            linked.lines().filter_map(|line| Some(line.split_once(' ')?.0)).collect();
        assert!(names.contains(there), "{names:?}");
        let found = tools.split(' ').find(|tool| names.contains(tool));
        assert_eq!(found, None, "{package}");
    }
}

#[test]
fn a_library_whose_documentation_is_not_tested_has_no_code_there() {
    for package in packages() {
        let mut targets = list(&package, "targets").iter();
        if targets.any(|target| target["kind"][0] == "lib" && target["doctest"] == false) {
            let fences = ["-rhE", "^ *//[/!] ```"];
            let source = folder(&package).join("src");
            let found = Command::new("grep").args(fences).arg(&source).output().unwrap();
            let found = String::from_utf8(found.stdout).unwrap();
            assert!(found.lines().step_by(2).all(|line| line.ends_with("text")), "{source:?}");
        }
    }
}
