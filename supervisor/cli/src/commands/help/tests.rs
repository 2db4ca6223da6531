//! What README and guide say of commands, files and tests.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

use super::*;
use crate::{
    commands::{
        self, parse,
        table::{self, stored},
    },
    console::missions,
};

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
}

/// A document: its path from the root, and its text.
struct Document {
    path: PathBuf,
    text: String,
}

fn documents() -> Vec<Document> {
    let pages = GUIDE
        .iter()
        .map(|page| PathBuf::from(format!("supervisor/guide/{}.md", page.file)));
    std::iter::once(PathBuf::from("README.md"))
        .chain(pages)
        .map(|path| Document {
            text: fs::read_to_string(root().join(&path)).unwrap(),
            path,
        })
        .collect()
}

impl Document {
    /// Lines of the blocks that a shell would read, and what stands in backticks elsewhere.
    fn code(&self) -> Vec<String> {
        let mut code = Vec::new();
        let mut fence = None;
        for line in self.text.lines() {
            match (line.strip_prefix("```"), fence) {
                (Some(_), Some(_)) => fence = None,
                (Some(language), None) => fence = Some(language),
                (None, Some("sh")) => code.push(line.to_owned()),
                (None, Some(_)) => {}
                (None, None) => {
                    // A code span may hold backticks between longer rows of them.
                    let line = line.replace("``", "\u{1}");
                    let (odd, plain) = line
                        .split('\u{1}')
                        .enumerate()
                        .partition::<Vec<_>, _>(|(at, _)| at % 2 == 1);
                    code.extend(odd.into_iter().map(|(_, text)| text.to_owned()));
                    for (_, text) in plain {
                        code.extend(text.split('`').skip(1).step_by(2).map(str::to_owned));
                    }
                }
            }
        }
        code
    }

    /// Where its links lead to, from the root.
    fn links(&self) -> Vec<PathBuf> {
        let targets = self.text.split("](").skip(1);
        targets
            .map(|rest| rest.split(')').next().unwrap())
            .filter(|target| !target.contains("://"))
            .map(|target| {
                let file = target.split('#').next().unwrap();
                self.path.parent().unwrap().join(file)
            })
            .collect()
    }
}

/// The simple commands of a line of shell, in words, with placeholders filled in.
fn commands(line: &str) -> Vec<Vec<String>> {
    let mut commands = vec![Vec::new()];
    let mut word = None::<String>;
    let mut quote = None;
    for letter in line.chars().chain([' ']) {
        match letter {
            _ if quote == Some(letter) => quote = None,
            _ if quote.is_some() => word.get_or_insert_default().push(letter),
            '\'' | '"' => {
                quote = Some(letter);
                word.get_or_insert_default();
            }
            '#' if word.is_none() => break,
            ' ' | ';' | '|' | '&' | '>' => {
                commands
                    .last_mut()
                    .unwrap()
                    .extend(word.take().map(|word| filled_in(&word)));
                if letter != ' ' {
                    commands.push(Vec::new());
                }
            }
            _ => word.get_or_insert_default().push(letter),
        }
    }
    commands
}

/// `word` with a value in place of what stands for one.
fn filled_in(word: &str) -> String {
    let value = |word: &str| match word {
        "S" | "N" | "H" | "K" | "$s" => Some("256"),
        "NAME" | "STAGE" => Some("planner"),
        "FAULT" => Some("saddle"),
        "TOPIC" => Some("pose"),
        "PAGE" => Some("method"),
        _ => None,
    };
    let (key, last) = match word.rsplit_once('=') {
        Some((key, last)) => (format!("{key}="), last),
        None => (String::new(), word),
    };
    value(last).map_or(word.to_owned(), |value| format!("{key}{value}"))
}

/// What `firsthand` is given, if this command runs it.
fn arguments(command: &[String]) -> Option<&[String]> {
    let words: Vec<&str> = command.iter().map(String::as_str).collect();
    let at = match words.as_slice() {
        ["sudo", "-u", _, "firsthand", ..] => 4,
        ["do" | "sudo", "firsthand", ..] => 2,
        ["cargo", "run", "--", ..] => 3,
        ["cargo", "run", "--release", "--", ..] => 4,
        ["cargo", "run", "--release"] => 3,
        ["firsthand", ..] => 1,
        _ => return None,
    };
    Some(&command[at..])
}

/// Whether a command line lacks no more than arguments.
fn is_incomplete(error: &clap::Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::MissingRequiredArgument
            | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand
            | ErrorKind::MissingSubcommand
    )
}

#[test]
fn every_command_line_in_readme_and_guide_is_understood() {
    let mut checked = 0;
    for document in documents() {
        let code = document.code();
        let commands: Vec<_> = code.iter().flat_map(|line| commands(line)).collect();
        for command in commands.iter().filter_map(|command| arguments(command)) {
            let line = command.join(" ");
            let at = document.path.display();
            let parsed = match parse(command) {
                // A subcommand alone is named rather than called.
                Err(error) if is_incomplete(&error) && command.len() <= 2 => continue,
                parsed => parsed.unwrap_or_else(|error| panic!("{at}: firsthand {line}: {error}")),
            };
            let set: Vec<String> = command
                .windows(2)
                .filter(|pair| pair[0] == "--set")
                .map(|pair| pair[1].clone())
                .collect();
            missions::load("obstacle-course", &set)
                .unwrap_or_else(|error| panic!("{at}: firsthand {line}: {error}"));
            if let commands::Command::Help(Arguments { page: words }) = parsed {
                let is_page = matches!(&words[..], [name] if page(name).is_some());
                let known = is_page || subcommand(&mut commands::command_line(), &words).is_some();
                assert!(known, "{at}: firsthand {line}");
            }
            checked += 1;
        }
    }
    assert!(checked > 50, "only {checked} command lines were found");
}

#[test]
fn a_command_line_with_an_option_or_key_that_does_not_exist_is_found() {
    let wrong = [
        "firsthand run --sed 7",
        "for s in $(seq 50); do firsthand runs --seed $s; done",
        "sudo -u firsthand firsthand states",
        "firsthand stage kill --signal ABRT",
        "firsthand topic ehco pose",
    ];
    for line in wrong {
        let found = commands(line);
        let command = found.iter().find_map(|command| arguments(command)).unwrap();
        assert!(parse(command).is_err(), "{line}");
    }
}

#[test]
fn every_old_name_leads_to_a_subcommand_that_exists() {
    for (old, new) in renamed::RENAMED {
        let words = new.iter().filter(|word| !word.starts_with('-'));
        let mut whole = commands::command_line();
        let found = words.fold(Some(&mut whole), |command, word| {
            command.and_then(|command| command.find_subcommand_mut(word))
        });
        assert!(found.is_some(), "{old}");
    }
}

#[test]
fn every_link_and_path_in_readme_and_guide_exists() {
    let of_the_tree = ["common/", "services/", "supervisor/", "tests/", ".ci/"];
    for document in documents() {
        let at = document.path.display();
        for link in document.links() {
            assert!(root().join(&link).exists(), "{at}: {}", link.display());
        }
        let code = document.code();
        let words = code.iter().flat_map(|code| code.split_whitespace());
        let paths = words.filter(|word| of_the_tree.iter().any(|top| word.starts_with(top)));
        for path in paths {
            // The crate that the reader makes.
            if !path.contains("odometer") {
                assert!(root().join(path).exists(), "{at}: {path}");
            }
        }
    }
}

/// Test functions of the whole tree.
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
                // A macro of tests is called with their names, each before its row.
                if text.contains("fn $promise()") {
                    let promises = text
                        .lines()
                        .filter_map(|line| line.trim().strip_suffix(':'));
                    functions.extend(promises.map(str::to_owned));
                }
                functions.extend(text.split("#[test]").skip(1).filter_map(|after| {
                    let (attributes, function) = after.split_once("fn ")?;
                    let name = function.split_once('(')?.0;
                    // A test that is run on demand only guards nothing.
                    (!attributes.contains("#[ignore")).then(|| name.to_owned())
                }));
            }
        }
    }
    functions
}

/// What is wrong with a row of the capabilities.
fn flaw(row: &[String; 3], functions: &BTreeSet<String>) -> Option<String> {
    let [text, verdict, tests] = row;
    let mut tests = tests.split_whitespace();
    let first = tests.clone().next();
    match (verdict.as_str(), first) {
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

#[test]
fn every_capability_has_a_verdict_and_every_contract_tests_that_exist() {
    let functions = test_functions();
    let rows = stored::capabilities();
    let flaws: Vec<_> = rows
        .iter()
        .filter_map(|row| flaw(row, &functions))
        .collect();
    assert!(flaws.is_empty(), "{flaws:#?}");
    assert!(rows.len() > 90, "only {} rows were found", rows.len());
}

#[test]
fn a_contract_without_a_test_or_with_one_that_does_not_exist_is_found() {
    let functions = BTreeSet::from(["it_holds".to_owned()]);
    let row = |text: &str, verdict: &str, tests: &str| [text, verdict, tests].map(str::to_owned);
    for right in [
        row("", "Contract", "it_holds"),
        row("it is done", "Smoke", ".ci/run"),
        row("it is missing", "Gap", ""),
    ] {
        assert_eq!(flaw(&right, &functions), None);
    }
    for wrong in [
        row("it holds", "Contract", ""),
        row("it holds", "Contract", "it_holds it_held"),
        row("it holds", "Smoke", "it_holds"),
        row("it holds", "Gap", "it_holds"),
        row("it holds", "Measured", ""),
    ] {
        assert!(flaw(&wrong, &functions).is_some(), "{wrong:?}");
    }
}

/// `text` with what stands behind each `<!-- table NAME SECTION -->` printed anew.
fn renewed(text: &str, print: impl Fn(&str, Option<&str>) -> String) -> String {
    let mut renewed = String::new();
    let mut lines = text.lines().peekable();
    while let Some(line) = lines.next() {
        renewed.push_str(line);
        renewed.push('\n');
        let marker = line
            .strip_prefix("<!-- table ")
            .and_then(|line| line.strip_suffix(" -->"));
        let Some(marker) = marker else { continue };
        let (name, section) = match marker.split_once(' ') {
            Some((name, section)) => (name, Some(section)),
            None => (marker, None),
        };
        renewed.push('\n');
        renewed.push_str(&print(name, section));
        while lines
            .next_if(|line| line.is_empty() || is_of_a_table(line))
            .is_some()
        {}
        if lines.peek().is_some() {
            renewed.push('\n');
        }
    }
    renewed
}

/// Whether a line can stand in a printed table or list.
fn is_of_a_table(line: &str) -> bool {
    ["- ", "  ", "|"]
        .iter()
        .any(|start| line.starts_with(start))
}

#[test]
fn documents_show_the_tables_that_are_printed() {
    let renew = std::env::var_os("RENEW").is_some();
    for document in documents() {
        let path = root().join(&document.path);
        let print = |name: &str, section: Option<&str>| match name {
            "crates" => crates(),
            name => table::shown(name, section)
                .unwrap_or_else(|| panic!("{}: no table {name} {section:?}", path.display())),
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

#[test]
fn a_table_behind_its_marker_is_renewed_and_nothing_else() {
    let print = |name: &str, section: Option<&str>| format!("- {name} {section:?}\n");
    let page = "a\n\n<!-- table x y -->\n\n- old\n  old\n\nb\n";
    let text = renewed(page, print);
    assert_eq!(text, "a\n\n<!-- table x y -->\n\n- x Some(\"y\")\n\nb\n");
    assert_eq!(renewed(&text, print), text);
}

#[test]
fn no_line_of_a_document_is_longer_than_160_letters() {
    for document in documents() {
        let long = document
            .text
            .lines()
            .find(|line| line.chars().count() > 160);
        assert_eq!(long, None, "{}", document.path.display());
    }
}

#[test]
fn the_guide_has_at_most_14000_words() {
    let words: usize = GUIDE
        .iter()
        .map(|page| page.text.split_whitespace().count())
        .sum();
    assert!(words <= 14_000, "{words} words");
}

#[test]
fn every_test_that_a_figure_names_exists() {
    let tests: String = fs::read_dir(root().join("tests"))
        .unwrap()
        .filter_map(|entry| fs::read_to_string(entry.unwrap().path()).ok())
        .collect();
    let named = "cargo test -p firsthand ";
    let code = documents().into_iter().flat_map(|document| document.code());
    for line in code.filter(|line| line.starts_with(named)) {
        let test = line[named.len()..].split(' ').next().unwrap();
        let exists = test.starts_with('-') || tests.contains(&format!("fn {test}"));
        assert!(exists, "{line}");
    }
}

/// The crates of the workspace and what each is, by their manifests.
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
        "| crate | content |\n|---|---|\n{rows}| `tests` | Whole runs through real processes |\n"
    )
}

#[test]
fn every_page_is_listed_in_the_help_the_readme_and_the_package() {
    let help = commands::command_line().render_long_help().to_string();
    let readme = fs::read_to_string(root().join("README.md")).unwrap();
    let package = fs::read_to_string(root().join(".ci/package-files")).unwrap();
    for page in GUIDE {
        let name = page.name();
        assert!(page.text.starts_with("# "), "{name} has no title");
        assert!(help.contains(page.title()), "{name}");
        assert!(readme.contains(&format!("`{name}`")), "{name}");
        let file = format!("supervisor/guide/{}.md", page.file);
        assert!(package.contains(&file), "{file}");
        let commands = commands::command_line();
        assert!(commands.find_subcommand(&name).is_none(), "{name}");
    }
    let files = fs::read_dir(root().join("supervisor/guide")).unwrap();
    let written = files.filter(|file| {
        let path = file.as_ref().unwrap().path();
        path.extension().is_some_and(|extension| extension == "md")
    });
    assert_eq!(
        written.count(),
        GUIDE.len(),
        "a page that is not in the list"
    );
}

#[test]
fn the_readme_is_shorter_than_200_lines() {
    let readme = fs::read_to_string(root().join("README.md")).unwrap();
    assert!(readme.lines().count() < 200);
}

#[test]
fn the_guides_values_of_the_simulation_are_the_presets() {
    let physics = |realism: &str, setting: &str| {
        let set = [
            format!("simulation.realism='{realism}'"),
            setting.to_owned(),
        ];
        let mission = missions::load("obstacle-course", &set);
        mission
            .unwrap_or_else(|error| panic!("{setting}: {error}"))
            .simulation
            .physics()
    };
    let mut values = 0;
    for line in page("mission-file").unwrap().text.lines() {
        let cells: Vec<_> = line.trim_matches('|').split('|').map(str::trim).collect();
        let (key, columns) = match *cells.as_slice() {
            [key, value, _] => (format!("heights.{}", key.trim_matches('`')), [value, value]),
            [key, laboratory, measured, _] => {
                (key.trim_matches('`').to_owned(), [laboratory, measured])
            }
            _ => continue,
        };
        for (realism, value) in ["laboratory", "measured"].into_iter().zip(columns) {
            if value.parse::<f64>().is_ok() {
                let written = physics(realism, &format!("simulation.{key}={value}"));
                assert_eq!(written, physics(realism, "seed=1"), "{key} = {value}");
                values += 1;
            }
        }
    }
    assert_eq!(values, 28, "values were found");
}
