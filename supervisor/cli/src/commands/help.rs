//! `firsthand help [TOPIC]`: a page of the guide, or the options of a subcommand.

use std::{fmt::Write as _, process::ExitCode};

use clap::{Args, Command, error::ErrorKind};

use super::{Failure, print_text};

/// Print a page of the guide, or the options of a subcommand; without a topic, list both.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// A page of the guide or a subcommand.
    topic: Option<String>,
}

/// A page of the guide.
struct Page {
    /// Its name below `supervisor/guide/`, without `.md`; the topic is the same in small letters.
    file: &'static str,
    /// Markdown; the first line is its title.
    text: &'static str,
}

macro_rules! guide {
    ($($file:literal),* $(,)?) => {
        &[$(Page {
            file: $file,
            text: include_str!(concat!("../../../guide/", $file, ".md")),
        }),*]
    };
}

/// Every page, in the order to read them. None has the name of a subcommand.
static GUIDE: &[Page] = guide! {
    "method",
    "mission-file",
    "simulation",
    "at-the-prompt",
    "attach",
    "deploy",
    "recordings",
    "break-it",
    "field-tool",
    "evaluate-worlds",
    "evaluation-results",
    "the-papers-experiments",
    "figures",
    "capabilities",
    "tables",
    "glossary",
    "CONTRIBUTING",
    "add-a-stage",
    "write-a-planner",
    "CHANGELOG",
};

impl Page {
    fn topic(&self) -> String {
        self.file.to_ascii_lowercase()
    }

    fn title(&self) -> &'static str {
        self.text
            .lines()
            .next()
            .unwrap_or_default()
            .trim_start_matches("# ")
    }
}

fn page(topic: &str) -> Option<&'static Page> {
    GUIDE
        .iter()
        .find(|page| page.file.eq_ignore_ascii_case(topic))
}

/// The pages, one a line, as the help of the whole command line lists them.
pub(crate) fn topics() -> String {
    let mut list = String::from("Guide (firsthand help TOPIC):\n");
    for page in GUIDE {
        // Writing to a String cannot fail.
        let _ = writeln!(list, "  {:<22} {}", page.topic(), page.title());
    }
    list
}

/// `whole` is the command line of the executable.
pub(crate) fn main(arguments: &Arguments, mut whole: Command) -> Result<ExitCode, Failure> {
    // Usage lines name the whole command only once it is built.
    whole.build();
    let text = match arguments.topic.as_deref() {
        None => whole.render_long_help().to_string(),
        Some(topic) => match (page(topic), whole.find_subcommand_mut(topic)) {
            (Some(page), _) => page.text.to_owned(),
            (None, Some(subcommand)) => subcommand.render_long_help().to_string(),
            (None, None) => {
                let message = format!(
                    "{topic:?} is neither a page of the guide nor a subcommand; `firsthand help` lists both"
                );
                whole.error(ErrorKind::InvalidValue, message).exit();
            }
        },
    };
    print_text(&text)?;
    Ok(ExitCode::SUCCESS)
}

#[cfg(all(test, feature = "simulator", feature = "tools"))]
mod tests;
