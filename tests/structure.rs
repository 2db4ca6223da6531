//! The rules of the tree that the compiler does not check: no circle of `use` between the files of a crate, and the
//! permitted dependencies between crates.

mod modules;

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use modules::{Crate, tokens};

/// Crates that still have circles.
const EXCLUDED: [&str; 0] = [];

fn root() -> PathBuf {
    fs::canonicalize(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).unwrap()
}

/// The files below `folder` whose names end with `end`.
fn files(folder: &Path, end: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() && !path.ends_with("target") {
            found.extend(files(&path, end));
        } else if path.to_str().is_some_and(|path| path.ends_with(end)) {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// The manifests of all crates, except those that need another compiler.
fn manifests() -> Vec<PathBuf> {
    let folders = ["common", "services", "supervisor", "tests"];
    let all = folders.iter().flat_map(|folder| files(&root().join(folder), "/Cargo.toml"));
    all.filter(|file| !file.ends_with("fuzz/Cargo.toml")).collect()
}

/// The names under `[dependencies]` of a manifest.
fn dependencies(manifest: &Path) -> Vec<String> {
    let text = fs::read_to_string(manifest).unwrap();
    let lines = text.lines().skip_while(|line| *line != "[dependencies]").skip(1);
    let lines = lines.take_while(|line| !line.starts_with('['));
    let name = |line: &str| line.split(['.', ' ', '=']).next().unwrap_or_default().to_owned();
    lines.filter(|line| !line.starts_with('#')).map(name).collect()
}

#[test]
fn no_crate_has_a_circle_of_use_between_its_files() {
    let mut found = String::new();
    for manifest in manifests() {
        let folder = manifest.parent().unwrap();
        let name = folder.strip_prefix(root()).unwrap().to_str().unwrap();
        for source in ["src/lib.rs", "src/main.rs"].map(|file| folder.join(file)) {
            if source.exists() && !EXCLUDED.contains(&name) {
                for circle in Crate::read(&source).circles() {
                    let circle = circle.replace(&format!("{}/", folder.display()), "");
                    found += &format!("{name}: {circle}\n");
                }
            }
        }
    }
    assert!(found.is_empty(), "\n{found}");
}

/// The circles of a crate of these files.
fn circles_of(sources: &[(&str, &str)]) -> usize {
    let folder = tempfile::tempdir().unwrap();
    for (name, source) in sources {
        let file = folder.path().join(name);
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::write(file, source).unwrap();
    }
    Crate::read(&folder.path().join("lib.rs")).circles().len()
}

#[test]
fn a_circle_is_found_however_it_is_written_and_only_where_there_is_one() {
    let circles = |a: &str, b: &str| {
        circles_of(&[("lib.rs", "mod a; mod b; pub use a::A;"), ("a.rs", a), ("b.rs", b)])
    };
    let a = "use crate::b::B; pub struct A(B);";
    let circular = [
        "pub struct B; use crate::a::A;",
        "pub struct B; use super::{a::{A as Other}};",
        "pub struct B; fn f() { let _ = crate::a::A::default(); }",
        "pub struct B; use super::a; fn f(_: &a::A) {}",
        "pub struct B; use super::a::*; fn f(_: &A) {}",
        // The circle passes a module that imports the item again.
        "pub struct B; use crate::A;",
        "pub struct B; mod inner { use super::super::a::A; }",
        "pub struct B; const C: char = '\\''; const Q: &str = \"//\"; use crate::a::A;",
    ];
    for b in circular {
        assert_eq!(circles(a, b), 1, "{b}");
    }
    let straight = [
        "pub struct B;",
        "pub struct B; // use crate::a::A;",
        "pub struct B; const S: &str = \"crate::a::A\";",
        "pub struct B; #[cfg(test)] mod tests { use crate::a::A; }",
        "pub struct B; #[cfg(test)] mod tests; use std::fmt::Debug;",
        "pub struct B; #[cfg(test)] use crate::a::{A};",
        "pub struct B; use super::a;",
        "pub struct B; use super::a::*;",
    ];
    for b in straight {
        assert_eq!(circles(a, b), 0, "{b}");
    }
    // A parent re-exports an item of its child, and the child needs the parent, directly or through a third file.
    let lib = ("lib.rs", "pub mod a;");
    let child = ("a/b.rs", "use super::Base; pub struct B(Base);");
    assert_eq!(circles_of(&[lib, ("a.rs", "mod b; pub use b::B; pub struct Base;"), child]), 1);
    assert_eq!(circles_of(&[lib, ("a.rs", "mod b; pub struct Base;"), child]), 0);
    let long = [
        ("lib.rs", "mod a; mod b; mod c;"),
        ("a.rs", "use crate::b::B;"),
        ("b.rs", "pub use crate::c::C; pub struct B;"),
        ("c.rs", "pub fn c() { crate::a::x() }"),
    ];
    assert_eq!(circles_of(&long), 1);
}

#[test]
fn the_middleware_is_named_in_one_place() {
    for folder in ["common", "services", "supervisor", "tests"] {
        for file in files(&root().join(folder), ".rs") {
            let path = file.strip_prefix(root()).unwrap();
            let may = path.starts_with("common/bus");
            let names =
                tokens(&fs::read_to_string(&file).unwrap()).contains(&"iceoryx2".to_owned());
            assert!(may || !names, "{} names iceoryx2", path.display());
        }
    }
    for manifest in manifests().iter().filter(|file| !file.ends_with("common/bus/Cargo.toml")) {
        assert!(!dependencies(manifest).contains(&"iceoryx2".to_owned()), "{}", manifest.display());
    }
}

#[test]
fn no_stage_knows_another_nor_the_supervisor() {
    let services = root().join("services");
    let stages: Vec<_> = fs::read_dir(&services)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    for stage in &stages {
        for name in dependencies(&services.join(stage).join("Cargo.toml")) {
            // The link may depend on its drivers.
            let driver = stage == "link" && name.ends_with("-driver");
            let foreign = stages.contains(&name) && !driver
                || ["supervisor", "firsthand", "bench", "picture", "evaluation"].contains(&&*name);
            assert!(!foreign, "{stage} depends on {name}");
        }
    }
}

#[test]
fn what_watches_a_robot_contains_no_pictures_no_file_formats_and_no_chance() {
    let tree = |arguments: &[&str]| {
        let fixed = [
            "tree",
            "--offline",
            "--locked",
            "--edges",
            "normal",
            "--prefix",
            "none",
            "--format",
            "{p}",
        ];
        let output = Command::new(env!("CARGO"))
            .args(fixed)
            .args(arguments)
            .current_dir(root())
            .output()
            .unwrap();
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    for arguments in
        [&["--package", "supervisor"][..], &["--package", "firsthand", "--no-default-features"]]
    {
        let tree = tree(arguments);
        let names: BTreeSet<_> = tree.lines().filter_map(|line| line.split(' ').next()).collect();
        assert!(names.contains("common"), "{tree}");
        for tool in [
            "png",
            "serde-saphyr",
            "rand",
            "rand_pcg",
            "firsthand-lab",
            "ratatui",
            "picture",
            "x80-sim",
            "page",
            "tokio",
        ] {
            assert!(!names.contains(tool), "{arguments:?} contains {tool}");
        }
    }
}
