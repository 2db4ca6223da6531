//! `firsthand help [PAGE]`: a page of the guide, or the options of a subcommand.

mod markdown;
mod pager;

use std::fmt::Write as _;

use clap::{Args, Command, error::ErrorKind};

use console::{failure::Failure, output::print_text};

/// Print a page of the guide, or the options of a subcommand; without a name, list both.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// A page of the guide, or the words of a subcommand: `stage kill`.
    page: Vec<String>,
}

struct Page {
    /// The name of its file in `supervisor/guide/`, without `.md`. In small letters it is the name of the page.
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
    "your-robot",
    "operate",
    "attach",
    "recordings",
    "break-it",
    "evaluation",
    "results",
    "capabilities",
    "tables",
    "CONTRIBUTING",
    "add-a-stage",
};

impl Page {
    fn name(&self) -> String {
        self.file.to_ascii_lowercase()
    }

    fn title(&self) -> &'static str {
        self.text.lines().next().unwrap_or_default().trim_start_matches("# ")
    }
}

fn page(name: &str) -> Option<&'static Page> {
    GUIDE.iter().find(|page| page.file.eq_ignore_ascii_case(name))
}

pub(crate) fn page_names() -> Vec<String> {
    GUIDE.iter().map(Page::name).collect()
}

/// The pages, one a line, for the help of the whole command line.
pub(crate) fn pages() -> String {
    let mut list = String::from("Guide (firsthand help PAGE):\n");
    for page in GUIDE {
        // Writing to a String cannot fail.
        let _ = writeln!(list, "  {:<22} {}", page.name(), page.title());
    }
    list
}

/// `whole` is the command line of the executable.
pub(crate) fn main(arguments: &Arguments, mut whole: Command) -> Result<(), Failure> {
    if let [name] = &arguments.page[..]
        && let Some(page) = page(name)
    {
        match pager::width() {
            Some(width) => pager::show(&markdown::render(page.text, width))?,
            None => print_text(page.text)?,
        }
        return Ok(());
    }
    // Usage lines name the whole command only once it is built.
    whole.build();
    match subcommand(&mut whole, &arguments.page) {
        Some(command) => print_text(&command.render_long_help().to_string())?,
        None => {
            let name = arguments.page.join(" ");
            let message = format!(
                "{name:?} is neither a page of the guide nor a subcommand; `firsthand help` lists both"
            );
            whole.error(ErrorKind::InvalidValue, message).exit();
        }
    }
    Ok(())
}

fn subcommand<'a>(whole: &'a mut Command, words: &[String]) -> Option<&'a mut Command> {
    words.iter().try_fold(whole, |command, word| command.find_subcommand_mut(word))
}

#[cfg(test)]
mod tests;
