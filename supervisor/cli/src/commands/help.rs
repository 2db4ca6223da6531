use std::{
    io::{self, IsTerminal as _},
    iter,
};

use clap::{Args, Command, error::ErrorKind};

use console::{failure::Result, item, output::print_text};

/// Print a page of the guide, or the options of a subcommand.
///
/// Without a name, list both.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Page of the guide, or the words of a subcommand: `stage kill`.
    page: Vec<String>,
}

struct Page {
    /// File in `supervisor/guide/` without `.md`. In lower case, the page's name.
    file: &'static str,
    /// Markdown text, whose first line is the title.
    text: &'static str,
}

/// Pages for one kind of question, as divided by <https://diataxis.fr>.
struct Part {
    title: &'static str,
    pages: &'static [Page],
}

macro_rules! guide {
    ($($title:literal: $($file:literal),* ;)*) => {
        &[$(Part {
            title: $title,
            pages: &[$(Page {
                file: $file,
                text: include_str!(concat!("../../../guide/", $file, ".md")),
            }),*],
        }),*]
    };
}

/// Pages in reading order. No page has the name of a subcommand. `.ci/site` reads this table.
static GUIDE: &[Part] = guide! {
    "Tutorial":
    "tutorial";
    "How-to":
    "try-a-log",
    "operate",
    "json-robot",
    "ros2-robot",
    "arduino-robot",
    "calibration",
    "service",
    "viewers",
    "another-machine",
    "attach",
    "recordings",
    "break-it",
    "evaluation",
    "nav2-planner",
    "write-a-planner",
    "add-a-stage";
    "Reference":
    "mission-file",
    "simulation",
    "tables",
    "results",
    "capabilities";
    "Explanation":
    "method",
    "architecture",
    "limits",
    "what-moves",
    "small-machine",
    "testing",
    "read-the-code",
    "CONTRIBUTING";
};

impl Page {
    fn name(&self) -> String {
        self.file.to_ascii_lowercase()
    }

    fn title(&self) -> &'static str {
        self.text.lines().next().unwrap_or_default().trim_start_matches("# ")
    }
}

fn all_pages() -> impl Iterator<Item = &'static Page> {
    GUIDE.iter().flat_map(|part| part.pages)
}

fn page(name: &str) -> Option<&'static Page> {
    all_pages().find(|page| page.file.eq_ignore_ascii_case(name))
}

pub fn page_names() -> Vec<String> {
    all_pages().map(Page::name).collect()
}

pub fn pages() -> String {
    let mut list = String::from("Guide (firsthand help PAGE):\n");
    for Part { title, pages } in GUIDE {
        list += &format!(" {title}\n");
        for page in *pages {
            list += &format!("  {:<22} {}\n", page.name(), page.title());
        }
    }
    list
}

pub fn main(arguments: &Arguments, mut whole: Command) -> Result {
    if let [name] = &arguments.page[..]
        && let Some(page) = page(name)
    {
        let text = terminal_width().map_or(page.text.to_owned(), |width| wrapped(page.text, width));
        return print_text(text);
    }
    // Usage lines are complete only after `build`.
    whole.build();
    match subcommand(&mut whole, &arguments.page) {
        Some(command) => print_text(command.render_long_help()),
        None => {
            let name = arguments.page.join(" ");
            let message = format!(
                "{name:?} is neither a page of the guide nor a subcommand; `firsthand help` lists both"
            );
            whole.error(ErrorKind::InvalidValue, message).exit()
        }
    }
}

/// Returns `None` without a terminal: other programs get raw Markdown.
fn terminal_width() -> Option<usize> {
    let stdout = io::stdout();
    let size = stdout.is_terminal().then(|| rustix::termios::tcgetwinsize(&stdout).ok())??;
    (size.ws_col > 0).then_some(size.ws_col.into())
}

/// Wraps paragraphs, draws tables, and leaves code unchanged.
fn wrapped(markdown: &str, width: usize) -> String {
    let mut all = Vec::new();
    let mut is_code = false;
    let mut lines = markdown.lines().peekable();
    while let Some(line) = lines.next() {
        let is_fence = line.starts_with("```");
        is_code ^= is_fence;
        if is_code || is_fence || line.starts_with('#') || line.is_empty() {
            all.push(line.to_owned());
        } else if line.starts_with('|') {
            // The second row only separates the header.
            let rest = iter::from_fn(|| lines.next_if(|next| next.starts_with('|'))).skip(1);
            all.extend(drawn(iter::once(line).chain(rest), width));
        } else {
            let mut paragraph = line.to_owned();
            while let Some(more) = lines.next_if(|next| goes_on(next)) {
                paragraph = paragraph + " " + more.trim_start();
            }
            let hang = if line.trim_start().starts_with("- ") { "  " } else { "" };
            let parts = item::wrapped(&paragraph, width.saturating_sub(hang.len()).max(1), true);
            all.push(parts.join(&format!("\n{hang}")));
        }
    }
    all.join("\n") + "\n"
}

/// Returns whether a line continues the paragraph or item before it.
fn goes_on(line: &str) -> bool {
    let line = line.trim_start();
    !line.is_empty()
        && !["#", "|", "- ", "```", "<", "!["].iter().any(|start| line.starts_with(start))
        && line.split_once(". ").is_none_or(|(number, _)| number.parse::<u32>().is_err())
}

/// Least width of a column, in characters.
const NARROWEST: usize = 8;

/// Draws table `rows` in columns that fit into `width`.
fn drawn<'a>(rows: impl Iterator<Item = &'a str>, width: usize) -> Vec<String> {
    let cells = |row: &str| -> Vec<String> {
        row.trim()
            .trim_matches('|')
            .replace("\\|", "\u{1}")
            .split('|')
            .map(|cell| cell.trim().replace('\u{1}', "|"))
            .collect()
    };
    let rows: Vec<Vec<String>> = rows.map(cells).collect();
    let columns = rows.iter().map(Vec::len).max().unwrap_or_default();
    let longest =
        |column: usize| rows.iter().filter_map(|row| Some(row.get(column)?.chars().count())).max();
    let mut widths: Vec<usize> = (0..columns).filter_map(longest).collect();
    let most = width.saturating_sub(2 * columns.saturating_sub(1)).max(columns * NARROWEST);
    while widths.iter().sum::<usize>() > most
        && let Some(widest) = widths.iter_mut().max()
    {
        *widest -= 1;
    }
    let line = |cells: &[String]| {
        cells
            .iter()
            .zip(&widths)
            .map(|(cell, &width)| format!("{cell:<width$}"))
            .collect::<Vec<_>>()
            .join("  ")
            .trim_end()
            .to_owned()
    };
    let mut drawn = Vec::new();
    for (nth, row) in rows.iter().enumerate() {
        let cells: Vec<Vec<String>> = row
            .iter()
            .zip(&widths)
            .map(|(cell, &width)| item::wrapped(cell, width, false))
            .collect();
        let height = cells.iter().map(Vec::len).max().unwrap_or_default();
        for at in 0..height {
            let parts = cells.iter().map(|cell| cell.get(at).cloned().unwrap_or_default());
            drawn.push(line(&parts.collect::<Vec<_>>()));
        }
        if nth == 0 {
            let rules: Vec<_> = widths.iter().map(|&width| "─".repeat(width)).collect();
            drawn.push(line(&rules));
        }
    }
    drawn
}

fn subcommand<'a>(whole: &'a mut Command, words: &[String]) -> Option<&'a mut Command> {
    words.iter().try_fold(whole, |command, word| command.find_subcommand_mut(word))
}

#[cfg(test)]
mod tests;
