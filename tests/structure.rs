//! The rules of the tree that the compiler does not check: no circle of `use` between the files of a crate, and who
//! may depend on whom.
//!
//! An edge A -> B: code of A outside of tests names an item that B defines, by a `use` or by a path. A name is
//! followed through re-exports to the file that defines it, else to the module that should have it. Declaring a
//! module or importing one is no edge; re-exporting an item is.
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout)]

use std::{
    collections::{BTreeMap, BTreeSet, HashMap},
    fs,
    path::{Path, PathBuf},
    process::Command,
};

/// Crates that still have circles.
const EXCLUDED: [&str; 0] = [];

type Names = Vec<String>;

/// A module: where it is written, what it defines, imports and names.
#[derive(Default)]
struct Module {
    file: PathBuf,
    items: BTreeSet<String>,
    imports: HashMap<String, Names>,
    globs: Vec<Names>,
    paths: BTreeSet<Names>,
    words: BTreeSet<String>,
}

/// What a path leads to.
enum Target {
    Module(Names),
    Item(PathBuf),
}

/// The modules of one crate, by their paths from its root.
#[derive(Default)]
struct Crate(BTreeMap<Names, Module>);

type Edges<'a> = BTreeMap<&'a Path, BTreeSet<PathBuf>>;

/// The files that `from` names, directly or by way of others.
fn reached<'a>(edges: &'a Edges<'_>, from: &'a Path) -> BTreeSet<&'a Path> {
    let mut reached = BTreeSet::new();
    let mut ahead = vec![from];
    while let Some(file) = ahead.pop() {
        let next = edges.get(file).into_iter().flatten();
        ahead.extend(next.map(|it| &**it).filter(|it| reached.insert(*it)));
    }
    reached
}

/// Words, `::` and single characters; comments, strings, characters and lifetimes left out.
fn tokens(source: &str) -> Names {
    let text: Vec<char> = source.chars().collect();
    let starts = |at: usize, what: &str| {
        what.chars()
            .enumerate()
            .all(|(i, c)| text.get(at + i) == Some(&c))
    };
    let mut tokens: Names = Vec::new();
    let mut at = 0;
    while at < text.len() {
        let start = at;
        if starts(at, "//") {
            while at < text.len() && text[at] != '\n' {
                at += 1;
            }
        } else if starts(at, "/*") {
            at += 2;
            while at < text.len() && !starts(at, "*/") {
                at += 1;
            }
            at += 2;
        } else if text[at].is_alphanumeric() || text[at] == '_' {
            while at < text.len() && (text[at].is_alphanumeric() || text[at] == '_') {
                at += 1;
            }
            let word: String = text[start..at].iter().collect();
            let hashes = text[at..].iter().take_while(|c| **c == '#').count();
            if ["r", "br"].contains(&&*word) && text.get(at + hashes) == Some(&'"') {
                let end = format!("\"{}", "#".repeat(hashes));
                at += hashes + 1;
                while at < text.len() && !starts(at, &end) {
                    at += 1;
                }
                at += end.len();
            } else {
                tokens.push(word);
            }
        } else if text[at] == '"' {
            at += 1;
            while at < text.len() && text[at] != '"' {
                at += 1 + usize::from(text[at] == '\\');
            }
            at += 1;
        } else if text[at] == '\'' {
            // A character ends with a quote, a lifetime does not.
            at = match (text.get(at + 1), text.get(at + 2)) {
                (Some('\\'), _) => {
                    at + 4 + text[at + 3..].iter().take_while(|c| **c != '\'').count()
                }
                (_, Some('\'')) => at + 3,
                _ => at + 1,
            };
        } else {
            at += if starts(at, "::") { 2 } else { 1 };
            if !text[start].is_whitespace() {
                tokens.push(text[start..at].iter().collect());
            }
        }
    }
    tokens
}

/// Where the bracket that opens at `open` is closed.
fn closing(tokens: &[String], open: usize) -> usize {
    let mut depth = 0;
    for (at, token) in tokens.iter().enumerate().skip(open) {
        depth += match &**token {
            "{" | "(" | "[" => 1,
            "}" | ")" | "]" => -1,
            _ => 0,
        };
        if depth == 0 {
            return at;
        }
    }
    tokens.len() - 1
}

/// Past the item at `at`, its attributes included.
fn past_item(tokens: &[String], mut at: usize) -> usize {
    while tokens[at] == "#" {
        at = closing(tokens, at + 1) + 1;
    }
    let import = tokens[at] == "use"
        || tokens[at] == "pub" && tokens.get(at + 1).is_some_and(|next| next == "use");
    while at < tokens.len() && tokens[at] != ";" {
        match &*tokens[at] {
            "{" if !import => return closing(tokens, at) + 1,
            "{" | "(" | "[" => at = closing(tokens, at) + 1,
            _ => at += 1,
        }
    }
    at + 1
}

/// The leaves of a `use` tree: each a path and the name it is imported by.
fn leaves(tokens: &[String], prefix: &[String], found: &mut Vec<(Names, String)>) {
    let mut at = 0;
    while at < tokens.len() {
        let mut path = prefix.to_vec();
        let mut name = None;
        while at < tokens.len() && tokens[at] != "," {
            match &*tokens[at] {
                "::" => at += 1,
                "{" => {
                    let end = closing(tokens, at);
                    leaves(&tokens[at + 1..end], &path, found);
                    (path, at) = (Vec::new(), end + 1);
                }
                "as" => {
                    name = tokens.get(at + 1).cloned();
                    at += 2;
                }
                "self" if !path.is_empty() => at += 1,
                word => {
                    path.push(word.to_owned());
                    at += 1;
                }
            }
        }
        if let Some(last) = path.last().cloned() {
            found.push((path, name.unwrap_or(last)));
        }
        at += 1;
    }
}

impl Crate {
    /// Read the crate whose root is `file`.
    fn read(file: &Path) -> Self {
        let mut read = Self::default();
        let folder = file.parent().unwrap();
        read.read_file(file, folder, Vec::new());
        read
    }

    /// Read `file` as `module`, whose own modules are in `folder`.
    fn read_file(&mut self, file: &Path, folder: &Path, module: Names) {
        let source =
            fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        self.read_module(&tokens(&source), file, folder, module);
    }

    fn read_module(&mut self, tokens: &[String], file: &Path, folder: &Path, name: Names) {
        let mut module = Module {
            file: file.to_owned(),
            ..Module::default()
        };
        let word = |at: usize| tokens.get(at).map_or("", |token| &**token);
        let is_word = |at: usize| word(at).starts_with(|c: char| c.is_alphabetic() || c == '_');
        let (mut at, mut depth) = (0, 0);
        while at < tokens.len() {
            match word(at) {
                "#" if word(at + 1) == "[" && word(at + 2) == "cfg" => {
                    let end = closing(tokens, at + 1);
                    let condition = &tokens[at + 4..end];
                    let is_test = condition[0] == "test"
                        || condition[0] == "all" && condition.iter().any(|it| it == "test");
                    at = if is_test {
                        past_item(tokens, end + 1)
                    } else {
                        end + 1
                    };
                    continue;
                }
                "{" => depth += 1,
                "}" => depth -= 1,
                "mod" if word(at + 2) == ";" || word(at + 2) == "{" => {
                    let child = word(at + 1).to_owned();
                    let path = [&name[..], &[child.clone()]].concat();
                    if word(at + 2) == ";" {
                        let flat = folder.join(format!("{child}.rs"));
                        let file = if flat.exists() {
                            flat
                        } else {
                            folder.join(&child).join("mod.rs")
                        };
                        self.read_file(&file, &folder.join(&child), path);
                        at += 3;
                    } else {
                        let end = closing(tokens, at + 2);
                        self.read_module(&tokens[at + 3..end], file, &folder.join(&child), path);
                        at = end + 1;
                    }
                    continue;
                }
                "use" if word(at + 1) != "<" => {
                    let end = at + tokens[at..].iter().position(|token| token == ";").unwrap();
                    let mut found = Vec::new();
                    leaves(&tokens[at + 1..end], &[], &mut found);
                    for (mut path, alias) in found {
                        if alias == "*" {
                            path.pop();
                            module.globs.push(path);
                        } else {
                            module.paths.insert(path.clone());
                            module.imports.insert(alias, path);
                        }
                    }
                    at = end;
                }
                "fn" | "struct" | "enum" | "union" | "trait" | "type" | "const" | "static"
                    if depth == 0 && is_word(at + 1) =>
                {
                    let name = if word(at + 1) == "mut" {
                        at + 2
                    } else {
                        at + 1
                    };
                    module.items.insert(word(name).to_owned());
                }
                // A macro may define what stands alone at the top of its braces.
                "!" if depth == 0 && word(at + 1) == "{" => {
                    let (mut inner, end) = (at + 2, closing(tokens, at + 1));
                    while inner < end {
                        if word(inner).starts_with(char::is_uppercase) && word(inner + 1) == "," {
                            module.items.insert(word(inner).to_owned());
                        }
                        let opens = ["{", "(", "["].contains(&word(inner));
                        inner = if opens { closing(tokens, inner) } else { inner } + 1;
                    }
                }
                "!" if word(at.wrapping_sub(1)) == "macro_rules" => {
                    module.items.insert(word(at + 1).to_owned());
                }
                _ if is_word(at) && word(at.wrapping_sub(1)) != "::" => {
                    let mut path = vec![word(at).to_owned()];
                    while word(at + 1) == "::" && is_word(at + 2) {
                        path.push(word(at + 2).to_owned());
                        at += 2;
                    }
                    if path.len() > 1 {
                        module.paths.insert(path);
                    } else {
                        module.words.extend(path);
                    }
                }
                _ => {}
            }
            at += 1;
        }
        self.0.insert(name, module);
    }

    /// Where `path`, written in the module `from`, leads; none when out of the crate.
    fn resolve(&self, from: &[String], path: &[String], depth: usize) -> Option<Target> {
        let (first, rest) = path.split_first()?;
        let mut here = match &**first {
            "crate" => Vec::new(),
            "self" => from.to_vec(),
            "super" => from[..from.len().checked_sub(1)?].to_vec(),
            _ => match self.member(from, first, depth)? {
                Target::Module(module) => module,
                item @ Target::Item(_) => return Some(item),
            },
        };
        for name in rest {
            if name == "super" {
                here.pop()?;
                continue;
            }
            match self.member(&here, name, depth) {
                Some(Target::Module(module)) => here = module,
                Some(item) => return Some(item),
                None => return Some(Target::Item(self.0[&here].file.clone())),
            }
        }
        Some(Target::Module(here))
    }

    /// What `name` is in `module`.
    fn member(&self, module: &[String], name: &String, depth: usize) -> Option<Target> {
        let child = [module, std::slice::from_ref(name)].concat();
        let it = self.0.get(module)?;
        if self.0.contains_key(&child) {
            Some(Target::Module(child))
        } else if it.items.contains(name) {
            Some(Target::Item(it.file.clone()))
        } else if depth == 0 {
            None
        } else if let Some(path) = it.imports.get(name) {
            // `use rand::rand` names another crate, not itself.
            (path.first() != Some(name)).then(|| self.resolve(module, path, depth - 1))?
        } else {
            it.globs
                .iter()
                .find_map(|glob| match self.resolve(module, glob, depth - 1)? {
                    Target::Module(of) => self.member(&of, name, depth - 1),
                    Target::Item(_) => None,
                })
        }
    }

    /// From each file to the files whose items it names.
    fn edges(&self) -> Edges<'_> {
        let mut edges = BTreeMap::<_, BTreeSet<_>>::new();
        for (name, module) in &self.0 {
            let from_globs = module
                .words
                .iter()
                .filter(|word| !module.imports.contains_key(*word) && !module.globs.is_empty());
            let words = from_globs.map(std::slice::from_ref);
            for path in module.paths.iter().map(Vec::as_slice).chain(words) {
                if let Some(Target::Item(file)) = self.resolve(name, path, 8)
                    && file != module.file
                {
                    edges.entry(&*module.file).or_default().insert(file);
                }
            }
        }
        edges
    }

    /// Files that name each other, directly or by way of others; a line for each such group.
    fn circles(&self) -> Vec<String> {
        let edges = self.edges();
        let all: BTreeMap<_, _> = edges
            .keys()
            .map(|file| (*file, reached(&edges, file)))
            .collect();
        let with = |file: &Path| {
            all[file]
                .iter()
                .filter(|it| all.get(**it).is_some_and(|back| back.contains(file)))
                .copied()
                .collect()
        };
        let groups: BTreeSet<BTreeSet<&Path>> = all
            .keys()
            .map(|file| with(file))
            .filter(|group: &BTreeSet<_>| !group.is_empty())
            .collect();
        let line = |group: &BTreeSet<&Path>| {
            let arrows = group.iter().map(|file| {
                let inside: Vec<_> = edges[file]
                    .iter()
                    .filter(|to| group.contains(&***to))
                    .map(|to| to.display().to_string())
                    .collect();
                format!("\n  {} -> {}", file.display(), inside.join(", "))
            });
            format!(
                "a circle of {} files:{}",
                group.len(),
                arrows.collect::<String>()
            )
        };
        groups.iter().map(line).collect()
    }
}

fn root() -> PathBuf {
    fs::canonicalize(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).unwrap()
}

/// What is below `folder` and is called so or ends so.
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

/// The manifests of all crates, without what needs another compiler.
fn manifests() -> Vec<PathBuf> {
    let folders = ["common", "services", "supervisor"];
    let all = folders
        .iter()
        .flat_map(|folder| files(&root().join(folder), "/Cargo.toml"));
    all.filter(|file| !file.ends_with("fuzz/Cargo.toml"))
        .collect()
}

/// The names under `[dependencies]` of a manifest.
fn dependencies(manifest: &Path) -> Vec<String> {
    let text = fs::read_to_string(manifest).unwrap();
    let lines = text
        .lines()
        .skip_while(|line| *line != "[dependencies]")
        .skip(1);
    let lines = lines.take_while(|line| !line.starts_with('['));
    let name = |line: &str| {
        line.split(['.', ' ', '='])
            .next()
            .unwrap_or_default()
            .to_owned()
    };
    lines
        .filter(|line| !line.starts_with('#'))
        .map(name)
        .collect()
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
        circles_of(&[
            ("lib.rs", "mod a; mod b; pub use a::A;"),
            ("a.rs", a),
            ("b.rs", b),
        ])
    };
    let a = "use crate::b::B; pub struct A(B);";
    let circular = [
        "pub struct B; use crate::a::A;",
        "pub struct B; use super::{a::{A as Other}};",
        "pub struct B; fn f() { let _ = crate::a::A::default(); }",
        "pub struct B; use super::a; fn f(_: &a::A) {}",
        "pub struct B; use super::a::*; fn f(_: &A) {}",
        // Past what is imported again elsewhere.
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
    // A parent that re-exports what its child defines, while the child needs the parent; and through a third file.
    let lib = ("lib.rs", "pub mod a;");
    let child = ("a/b.rs", "use super::Base; pub struct B(Base);");
    assert_eq!(
        circles_of(&[
            lib,
            ("a.rs", "mod b; pub use b::B; pub struct Base;"),
            child
        ]),
        1
    );
    assert_eq!(
        circles_of(&[lib, ("a.rs", "mod b; pub struct Base;"), child]),
        0
    );
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
            let may = path.starts_with("common/src/bus") || path == Path::new("common/src/bus.rs");
            let names =
                tokens(&fs::read_to_string(&file).unwrap()).contains(&"iceoryx2".to_owned());
            assert!(may || !names, "{} names iceoryx2", path.display());
        }
    }
    for manifest in manifests()
        .iter()
        .filter(|file| !file.ends_with("common/Cargo.toml"))
    {
        assert!(
            !dependencies(manifest).contains(&"iceoryx2".to_owned()),
            "{}",
            manifest.display()
        );
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
            let foreign = stages.contains(&name)
                || ["supervisor", "firsthand", "chaos", "picture", "maps"].contains(&&*name);
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
    for arguments in [
        &["--package", "supervisor"][..],
        &["--package", "firsthand", "--no-default-features"],
    ] {
        let tree = tree(arguments);
        let names: BTreeSet<_> = tree
            .lines()
            .filter_map(|line| line.split(' ').next())
            .collect();
        assert!(names.contains("common"), "{tree}");
        for tool in [
            "image",
            "zip",
            "resvg",
            "serde-saphyr",
            "npyz",
            "rand",
            "rand_pcg",
            "chaos",
            "picture",
            "maps",
            "x80-sim",
        ] {
            assert!(!names.contains(tool), "{arguments:?} contains {tool}");
        }
    }
}
