//! Tests that the commands, files and tests named in README and guide exist.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::{
    fs,
    path::{Path, PathBuf},
};

mod printed;

use common::mission::{Realism, Simulation};

use super::*;
use console::missions;

use crate::{
    commands::{self, parse},
    companions,
};

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
}

/// Document with its path from the root.
struct Document {
    path: PathBuf,
    text: String,
}

fn documents() -> Vec<Document> {
    let pages = all_pages().map(|page| PathBuf::from(format!("supervisor/guide/{}.md", page.file)));
    iter::once(PathBuf::from("README.md"))
        .chain(pages)
        .map(|path| Document { text: fs::read_to_string(root().join(&path)).unwrap(), path })
        .collect()
}

impl Document {
    /// Returns the lines of shell blocks, and the code spans elsewhere.
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
                    // A code span between longer rows of backticks may contain backticks.
                    for (at, text) in line.split("``").enumerate() {
                        if at % 2 == 1 {
                            code.push(text.to_owned());
                        } else {
                            code.extend(text.split('`').skip(1).step_by(2).map(str::to_owned));
                        }
                    }
                }
            }
        }
        code
    }

    /// Returns the link targets, as paths from the root.
    fn links(&self) -> Vec<PathBuf> {
        let targets = self.text.split("](").skip(1).map(|rest| rest.split(')').next().unwrap());
        let files = targets
            .filter(|target| !target.contains("://"))
            .map(|target| target.split('#').next().unwrap());
        files.map(|file| self.path.parent().unwrap().join(file)).collect()
    }
}

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
                commands.last_mut().unwrap().extend(word.take().map(|word| filled_in(&word)));
                if letter != ' ' {
                    commands.push(Vec::new());
                }
            }
            _ => word.get_or_insert_default().push(letter),
        }
    }
    commands
}

fn filled_in(word: &str) -> String {
    let parts = word.split_inclusive('=').map(|part| match part {
        "S" | "N" | "H" | "K" | "$s" => "256",
        "NAME" | "STAGE" => "planner",
        "FAULT" => "saddle",
        "TOPIC" => "pose",
        "PAGE" => "method",
        part => part,
    });
    parts.collect()
}

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

/// Parses words as `firsthand` does, with `None` for those of a companion.
fn understood(words: &[String]) -> Result<Option<commands::Command>, clap::Error> {
    fn by<A: clap::Parser>(words: &[String]) -> Result<Option<commands::Command>, clap::Error> {
        let executable = "companion".to_owned();
        A::try_parse_from(iter::once(&executable).chain(words)).map(|_| None)
    }
    match words.first().map(String::as_str) {
        Some("top") => by::<firsthand_top::Arguments>(&words[1..]),
        Some("page") => by::<firsthand_page::Arguments>(&words[1..]),
        Some("ros2") => by::<firsthand_ros2::Arguments>(&words[1..]),
        Some("remote") => by::<firsthand_remote::Arguments>(&words[1..]),
        Some("foxglove") => by::<firsthand_foxglove::Arguments>(&words[1..]),
        Some(name) if companions::find(name.as_ref()).is_some() => {
            by::<firsthand_lab::Arguments>(words)
        }
        _ => parse(words).map(Some),
    }
}

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
            let parsed = match understood(command) {
                // A subcommand without arguments is a name in the text.
                Err(error) if is_incomplete(&error) && command.len() <= 2 => continue,
                parsed => parsed.unwrap_or_else(|error| panic!("{at}: firsthand {line}: {error}")),
            };
            let evaluates = command.first().is_some_and(|word| word == "evaluate");
            let set: Vec<String> = command
                .windows(2)
                .filter_map(|pair| match pair[0].as_str() {
                    "--set" => Some(pair[1].clone()),
                    "--robot" if evaluates => Some(format!("robot.model='{}'", pair[1])),
                    _ => None,
                })
                .collect();
            missions::load("obstacle-course", &set)
                .unwrap_or_else(|error| panic!("{at}: firsthand {line}: {error}"));
            if let Some(commands::Command::Help(Arguments { page: words })) = parsed {
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
        // The reader creates the crate of the odometer.
        for path in paths.filter(|path| !path.contains("odometer")) {
            assert!(root().join(path).exists(), "{at}: {path}");
        }
    }
}

#[test]
fn every_subcommand_is_listed_in_the_help() {
    let command = commands::command_line();
    let help = command.clone().render_long_help().to_string();
    let shown = command.get_subcommands().filter(|it| !it.is_hide_set());
    let unlisted = shown.filter(|it| !help.contains(&format!("\n  {} ", it.get_name())));
    assert_eq!(unlisted.map(|it| it.get_name()).collect::<Vec<_>>(), [""; 0]);
}

#[test]
fn every_page_is_listed_in_the_help_and_the_package_and_the_readme_leads_to_each_part() {
    let help = commands::command_line().render_long_help().to_string();
    let readme = fs::read_to_string(root().join("README.md")).unwrap();
    let package = fs::read_to_string(root().join(".ci/package-files")).unwrap();
    for part in GUIDE {
        let leads = |page: &Page| readme.contains(&format!("supervisor/guide/{}.md", page.file));
        assert!(part.pages.iter().any(leads), "{}", part.title);
    }
    for page in all_pages() {
        let name = page.name();
        assert!(page.text.starts_with("# "), "{name} has no title");
        assert!(help.contains(page.title()), "{name}");
        let file = format!("supervisor/guide/{}.md", page.file);
        assert!(package.contains(&file), "{file}");
        let commands = commands::command_line();
        assert!(commands.find_subcommand(&name).is_none(), "{name}");
    }
    let files = fs::read_dir(root().join("supervisor/guide")).unwrap();
    let names = files.map(|file| file.unwrap().file_name().into_string().unwrap());
    // The changelog is not a page.
    let written = names.filter(|name| name.ends_with(".md") && name != "CHANGELOG.md");
    assert_eq!(written.count(), all_pages().count(), "a page that is not in the list");
}

#[test]
fn the_guide_has_the_three_presets_of_every_key_of_the_simulation_and_its_source() {
    let rows: Vec<Vec<&str>> = page("simulation")
        .unwrap()
        .text
        .lines()
        .map(|line| line.trim_matches('|').split('|').map(str::trim).collect())
        .collect();
    let presets = [Realism::Laboratory, Realism::Measured, Realism::Harsh]
        .map(|realism| Simulation { realism, ..Default::default() }.ranges());
    for (index, (key, ..)) in presets[0].iter().enumerate() {
        let presets = [0, 1, 2].map(|realism| presets[realism][index].1);
        let key = format!("`{}`", key.trim_start_matches("simulation."));
        let row = rows.iter().find(|row| row[0] == key).unwrap_or_else(|| panic!("no row {key}"));
        let values: Vec<f64> = row[1..4].iter().map(|value| value.parse().unwrap()).collect();
        assert_eq!(values, presets, "{key}");
        let told = ["nominal", "1", "2", "3"].iter().any(|start| row[5].starts_with(start));
        assert!(told, "{key}: {}", row[5]);
    }
}

#[test]
fn a_page_is_wrapped_to_the_terminal_its_tables_are_drawn_and_code_stays() {
    let page =
        "# Title\n\none two three\nfour\n\n- an item\n  of two\n\n```sh\nfirsthand run trap\n```\n";
    let expected = "# Title\n\none two\nthree\nfour\n\n- an\n  item of\n  two\n\n```sh\nfirsthand run trap\n```\n";
    assert_eq!(wrapped(page, 9), expected);
    let table =
        "| key | what it is for |\n|---|---|\n| `a` | one two three four |\n| b \\| c | x |\n";
    let narrow = wrapped(table, 21);
    assert!(narrow.lines().all(|line| line.chars().count() <= 21), "{narrow}");
    assert_eq!(wrapped(table, 80).lines().count(), 4);
    for page in all_pages() {
        let text = wrapped(page.text, 80);
        let lines = text.lines().filter(|line| line.contains("───")).count();
        assert_eq!(lines, page.text.matches("\n|---").count(), "{}", page.file);
        assert!(!text.contains("\n|"), "{}", page.file);
    }
}
