//! Permitted dependencies between crates. Privacy inside a crate is checked by the compiler.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    process::Command,
};

fn root() -> PathBuf {
    fs::canonicalize(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).unwrap()
}

/// Returns the crates that `arguments` of `cargo tree` select, with all linked crates.
fn linked(arguments: &[&str]) -> BTreeSet<String> {
    let fixed = ["tree", "--offline", "--locked", "--edges", "normal", "--prefix", "none"];
    let output = Command::new(env!("CARGO"))
        .args(fixed)
        .args(["--format", "{p}"])
        .args(arguments)
        .current_dir(root())
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    let tree = String::from_utf8(output.stdout).unwrap();
    tree.lines().filter_map(|line| Some(line.split_once(' ')?.0.to_owned())).collect()
}

fn manifest(folder: &Path) -> toml::Table {
    fs::read_to_string(folder.join("Cargo.toml")).unwrap().parse().unwrap()
}

fn dependencies(folder: &Path) -> Vec<String> {
    let manifest = manifest(folder);
    let named = manifest.get("dependencies").and_then(toml::Value::as_table);
    named.into_iter().flat_map(toml::Table::keys).cloned().collect()
}

fn members() -> Vec<(String, PathBuf)> {
    let arguments = ["metadata", "--offline", "--locked", "--no-deps", "--format-version", "1"];
    let output = Command::new(env!("CARGO")).args(arguments).current_dir(root()).output().unwrap();
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let packages = metadata["packages"].as_array().unwrap().iter();
    let member = |package: &serde_json::Value| {
        let manifest = Path::new(package["manifest_path"].as_str().unwrap());
        // Dependents use the library's name, which differs for publishable packages.
        let mut targets = package["targets"].as_array().unwrap().iter();
        let library = targets.find(|target| target["kind"][0] == "lib").map(|it| &it["name"]);
        let name = library.unwrap_or(&package["name"]).as_str().unwrap().replace('_', "-");
        (name, manifest.parent().unwrap().to_owned())
    };
    packages.map(member).collect()
}

#[test]
fn the_middleware_is_named_in_one_place() {
    for (name, folder) in members().iter().filter(|(name, _)| name != "bus") {
        let named = dependencies(folder).into_iter().find(|name| name.starts_with("iceoryx2"));
        assert_eq!(named, None, "{name} depends on it");
    }
}

#[test]
fn no_stage_knows_another_nor_the_supervisor() {
    let services = root().join("services");
    let members = members();
    let below = |folder: &Path, name: &str| {
        members.iter().any(|(its, at)| its == name && at.starts_with(folder))
    };
    for (stage, folder) in members.iter().filter(|(_, folder)| folder.starts_with(&services)) {
        for name in dependencies(folder) {
            // The link has its drivers, and the planner its solver.
            let own = stage == "link" && name.ends_with("-driver") || below(folder, &name);
            let foreign = below(&services, &name) && !own
                || ["supervisor", "tests"].iter().any(|top| below(&root().join(top), &name));
            assert!(!foreign, "{stage} depends on {name}");
        }
    }
}

#[test]
fn what_watches_a_robot_contains_no_pictures_no_file_formats_and_no_chance() {
    let names = linked(&["--package", "mission-control"]);
    assert!(names.contains("firsthand-common"), "{names:?}");
    for tool in ["png", "mcap", "csv", "rand_pcg", "picture", "x80-sim", "clap"] {
        assert!(!names.contains(tool), "{tool}");
    }
}

#[test]
fn the_robots_executable_contains_no_viewer_and_no_laboratory() {
    let names = linked(&["--package", "firsthand"]);
    assert!(names.contains("planner") && names.contains("x80-sim"), "{names:?}");
    for tool in ["tokio", "axum", "ratatui", "foxglove", "rustdds", "firsthand-lab"] {
        assert!(!names.contains(tool), "{tool}");
    }
}

#[test]
fn a_library_whose_documentation_is_not_tested_has_no_code_there() {
    for (_, folder) in members() {
        if manifest(&folder).get("lib").is_some_and(|lib| lib.get("doctest").is_some()) {
            let fences = ["-rhE", "^ *//[/!] ```"];
            let found = Command::new("grep").args(fences).arg(folder.join("src")).output().unwrap();
            let found = String::from_utf8(found.stdout).unwrap();
            assert!(found.lines().step_by(2).all(|line| line.ends_with("text")), "{folder:?}");
        }
    }
}
