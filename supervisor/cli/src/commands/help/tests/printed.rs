//! Tables that README and guide print from code, stored files and manifests.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

use console::missions;

use super::{documents, root};
use crate::commands::table;

fn test_functions() -> BTreeSet<String> {
    let mut functions = BTreeSet::new();
    let mut folders = vec![root().to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir() && name != "target" && !name.starts_with('.') {
                folders.push(path);
            } else if name.ends_with(".rs") {
                let text = fs::read_to_string(&path).unwrap();
                // A macro of tests takes names, each before its row.
                if text.contains("fn $promise()") {
                    let promises = text.lines().filter_map(|line| line.trim().strip_suffix(':'));
                    functions.extend(promises.map(str::to_owned));
                }
                functions.extend(text.split("#[test]").skip(1).filter_map(|after| {
                    let (attributes, function) = after.split_once("fn ")?;
                    let name = function.split_once('(')?.0;
                    // Ignored tests guard nothing.
                    (!attributes.contains("#[ignore")).then(|| name.to_owned())
                }));
            }
        }
    }
    functions
}

/// Returns the error in a row of capabilities.
fn flaw(row: &[String; 3], functions: &BTreeSet<String>) -> Option<String> {
    let [text, verdict, tests] = row;
    let mut tests = tests.split_whitespace();
    match (verdict.as_str(), tests.clone().next()) {
        ("Contract", None) => Some(format!("{text}: a contract without a test")),
        ("Contract", Some(_)) => tests
            .find(|test| !functions.contains(*test))
            .map(|test| format!("{text}: there is no test {test}")),
        ("Smoke", Some(step)) if step.starts_with(".ci/") && root().join(step).exists() => None,
        ("Smoke", _) => Some(format!("{text}: no step of .ci/ shows it")),
        ("Gap", None) => None,
        ("Gap", Some(test)) => Some(format!("{text}: a gap that {test} tests")),
        (other, _) => Some(format!("{text}: {other:?} is no verdict")),
    }
}

/// Returns a stored file's rows, with a section in the first column.
fn rows(name: &str) -> impl Iterator<Item = csv::StringRecord> {
    let file = root().join(format!("supervisor/guide/{name}.csv"));
    csv::Reader::from_path(file).unwrap().into_records().map(Result::unwrap)
}

#[test]
fn every_capability_has_a_verdict_and_every_contract_and_version_tests_that_exist() {
    let functions = test_functions();
    let rows: Vec<[String; 3]> =
        rows("capabilities").map(|row| [1, 2, 3].map(|at| row[at].to_owned())).collect();
    let flaws: Vec<_> = rows.iter().filter_map(|row| flaw(row, &functions)).collect();
    assert!(flaws.is_empty(), "{flaws:#?}");
    assert!(rows.len() > 90, "only {} rows were found", rows.len());
    let versions: String = self::rows("versions").map(|row| row[4].to_owned() + " ").collect();
    let lacks = versions.split_whitespace().find(|test| !functions.contains(*test));
    assert!(!versions.is_empty() && lacks.is_none(), "there is no test {lacks:?}");
}

#[test]
fn every_default_in_the_table_of_mission_keys_is_the_default() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("plain.toml");
    fs::write(&file, "target = [4.0, 0.0]").unwrap();
    let load = |set: &[String]| missions::load(file.to_str().unwrap(), set).unwrap();
    let span = |text: &str| {
        let inner = text.strip_prefix('`')?.strip_suffix('`')?;
        (!inner.contains('`')).then(|| inner.to_owned())
    };
    let plain = load(&[]);
    let mut checked = 0;
    for row in rows("mission-keys") {
        let of_a_row = ["sensor", "touch", "shapes"].contains(&&row[0]);
        let (Some(key), Some(default)) = (span(&row[1]), span(&row[2])) else { continue };
        if !of_a_row && !["name", "description"].contains(&key.as_str()) {
            assert_eq!(load(&[format!("{key}={default}")]), plain, "{key}");
            checked += 1;
        }
    }
    assert!(checked > 40, "only {checked} defaults were found");
}

/// Returns `text` with each table after `<!-- table NAME SECTION -->` reprinted.
fn renewed(text: &str, print: impl Fn(&str, Option<&str>) -> String) -> String {
    let mut renewed = String::new();
    let mut lines = text.lines().peekable();
    while let Some(line) = lines.next() {
        renewed.push_str(line);
        renewed.push('\n');
        let marker = line.strip_prefix("<!-- table ").and_then(|line| line.strip_suffix(" -->"));
        let Some(marker) = marker else { continue };
        let (name, section) =
            marker.split_once(' ').map_or((marker, None), |(name, section)| (name, Some(section)));
        renewed.push('\n');
        renewed.push_str(&print(name, section));
        while lines.next_if(|line| line.is_empty() || is_of_a_table(line)).is_some() {}
        if lines.peek().is_some() {
            renewed.push('\n');
        }
    }
    renewed
}

fn is_of_a_table(line: &str) -> bool {
    ["- ", "  ", "|"].iter().any(|start| line.starts_with(start))
}

/// Returns the table for `<!-- table NAME SECTION -->`.
fn shown(name: &str, section: Option<&str>) -> Option<String> {
    match name {
        "crates" => Some(crates()),
        "topics" => Some(table::topics()),
        "stages" => Some(table::stages()),
        "failsafe" => Some(table::failsafe()),
        "faults" => Some(table::faults()),
        "ros2" => Some(firsthand_ros2::topics()),
        name => stored(name, section),
    }
}

/// Returns the rows of all or some sections (`a,b`) of a stored file, or `None` if there are none.
fn stored(name: &str, section: Option<&str>) -> Option<String> {
    let guide = root().join("supervisor/guide");
    let files = [format!("{name}.csv"), format!("results/{}.csv", name.replace('-', "_"))];
    let file = files.map(|file| guide.join(file)).into_iter().find(|file| file.exists())?;
    let mut reader = csv::Reader::from_path(file).unwrap();
    let (mut text, mut count) = (Vec::<u8>::new(), 0);
    let mut writer = csv::Writer::from_writer(&mut text);
    writer.write_record(reader.headers().unwrap()).unwrap();
    for row in reader.records().map(Result::unwrap) {
        if section.is_none_or(|asked| asked.split(',').any(|asked| row.get(0) == Some(asked))) {
            writer.write_record(&row).unwrap();
            count += 1;
        }
    }
    writer.flush().unwrap();
    drop(writer);
    (count > 0).then(|| table::stored::markdown(name, std::str::from_utf8(&text).unwrap()))
}

#[test]
fn documents_show_the_tables_that_are_printed() {
    let renew = std::env::var_os("RENEW").is_some();
    for document in documents() {
        let path = root().join(&document.path);
        let print = |name: &str, section: Option<&str>| {
            shown(name, section)
                .unwrap_or_else(|| panic!("{}: no table {name} {section:?}", path.display()))
        };
        let text = renewed(&document.text, print);
        if renew && text != document.text {
            fs::write(&path, &text).unwrap();
        }
        assert!(
            renew || text == document.text,
            "{} is behind; renew it by RENEW=1 cargo test -p firsthand --bin firsthand documents_show",
            path.display()
        );
    }
}

fn crates() -> String {
    let manifest = |folder: &Path| -> toml::Table {
        let text = fs::read_to_string(folder.join("Cargo.toml")).unwrap();
        toml::from_str(&text).unwrap()
    };
    let mut folders = BTreeSet::new();
    for member in manifest(root())["workspace"]["members"].as_array().unwrap() {
        let member = member.as_str().unwrap();
        match member.strip_suffix("/*") {
            None => folders.extend([root().join(member)]),
            Some(folder) => folders.extend(
                fs::read_dir(root().join(folder))
                    .unwrap()
                    .map(|entry| entry.unwrap().path())
                    .filter(|path| path.join("Cargo.toml").exists()),
            ),
        }
    }
    let row = |folder: &PathBuf| {
        let manifest = manifest(folder);
        let description = manifest["package"]["description"].as_str().unwrap();
        let folder = folder.strip_prefix(root()).unwrap().display();
        format!("| `{folder}` | {description} |\n")
    };
    let rows: String = folders.iter().map(row).collect();
    format!(
        "| crate | content |\n|---|---|\n{rows}| `tests` | Tests of the package `firsthand`, most with whole runs through real processes |\n"
    )
}
