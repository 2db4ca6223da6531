use std::{
    fmt::Write as _,
    io::{self, IsTerminal as _},
};

use clap::{Args, Command, error::ErrorKind};

use console::{failure::Failure, output::print_text};

/// Print a page of the guide, or the options of a subcommand; without a name, list both.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// A page of the guide, or the words of a subcommand: `stage kill`.
    page: Vec<String>,
}

struct Page {
    /// A file in `supervisor/guide/`, without `.md`; in small letters, the page's name.
    file: &'static str,
    /// The first line is the title.
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

/// The order is that of reading. None has the name of a subcommand.
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

/// One a line, for the help of the whole command line.
pub(crate) fn pages() -> String {
    let mut list = String::from("Guide (firsthand help PAGE):\n");
    for page in GUIDE {
        // Writing to a String cannot fail.
        let _ = writeln!(list, "  {:<22} {}", page.name(), page.title());
    }
    list
}

pub(crate) fn main(arguments: &Arguments, mut whole: Command) -> Result<(), Failure> {
    if let [name] = &arguments.page[..]
        && let Some(page) = page(name)
    {
        let text = terminal_width().map_or(page.text.to_owned(), |width| wrapped(page.text, width));
        return Ok(print_text(&text)?);
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

/// None where standard output is no terminal: another program gets the Markdown as it is.
fn terminal_width() -> Option<usize> {
    let stdout = io::stdout();
    let size = stdout.is_terminal().then(|| rustix::termios::tcgetwinsize(&stdout).ok())??;
    (size.ws_col > 0).then_some(size.ws_col.into())
}

/// Rows of tables and code stay as they are.
fn wrapped(markdown: &str, width: usize) -> String {
    let mut text = String::new();
    let mut is_code = false;
    for line in markdown.lines() {
        is_code ^= line.starts_with("```");
        let mut column = 0;
        if is_code || line.starts_with('|') {
            text.push_str(line);
        } else {
            for word in line.split_inclusive(' ') {
                let letters = word.trim_end().chars().count();
                if column > 0 && column + letters > width {
                    text.truncate(text.trim_end().len());
                    text.push('\n');
                    column = 0;
                }
                text.push_str(word);
                column += word.chars().count();
            }
        }
        text.push('\n');
    }
    text
}

fn subcommand<'a>(whole: &'a mut Command, words: &[String]) -> Option<&'a mut Command> {
    words.iter().try_fold(whole, |command, word| command.find_subcommand_mut(word))
}

#[cfg(test)]
mod tests;
