//! The Markdown of the guide as text for a terminal: headings, paragraphs, lists, tables, code, links.

/// Marks around bold text and code, as zero-width characters until a line is painted.
const BOLD: char = '\u{1}';
const CODE: char = '\u{2}';
/// Blanks before a line of code.
const INDENT: &str = "    ";
/// Blanks between the columns of a table.
const GAP: usize = 2;
/// The least width to which a column is made narrower so that a table fits.
const NARROWEST: usize = 4;

/// `text` with lines of at most `width` characters, except lines of code.
pub(super) fn render(text: &str, width: usize) -> String {
    let mut rendered = String::new();
    let mut lines = text.lines().peekable();
    while let Some(line) = lines.next() {
        if line.starts_with("```") {
            for code in lines.by_ref().take_while(|line| !line.starts_with("```")) {
                rendered += &format!("{INDENT}{code}\n");
            }
        } else if line.starts_with('#') {
            let heading = spans(line.trim_start_matches('#').trim());
            rendered += &painted(&wrapped(&format!("{BOLD}{heading}{BOLD}"), width), "", "");
        } else if line.starts_with("<!--") {
            lines.next_if(|line| line.is_empty());
        } else if line.starts_with('|') {
            let mut rows = vec![cells(line)];
            while let Some(row) = lines.next_if(|line| line.starts_with('|')) {
                rows.push(cells(row));
            }
            rendered += &table(rows, width);
        } else if line.trim().is_empty() {
            rendered.push('\n');
        } else {
            let (first, rest, start) = item(line);
            let mut paragraph = line[start..].to_owned();
            while let Some(more) = lines.next_if(|line| continues(line)) {
                paragraph += " ";
                paragraph += more.trim();
            }
            let text = wrapped(&spans(&paragraph), width.saturating_sub(rest.len()).max(1));
            rendered += &painted(&text, &first, &rest);
        }
    }
    rendered
}

/// The beginnings of the first and of the further lines of a paragraph, and where its text starts in `line`.
fn item(line: &str) -> (String, String, usize) {
    let blanks = line.len() - line.trim_start().len();
    let word = line.trim_start().split(' ').next().unwrap_or_default();
    let number = word.strip_suffix('.').unwrap_or_default();
    let marker = match word {
        "-" | "*" => "•",
        _ if !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit()) => word,
        _ => return (String::new(), String::new(), blanks),
    };
    let first = format!("{}{marker} ", " ".repeat(blanks));
    let rest = " ".repeat(first.chars().count());
    (first, rest, line.len().min(blanks + word.len() + 1))
}

/// Whether `line` belongs to the paragraph before it.
fn continues(line: &str) -> bool {
    let starts_block = ["```", "#", "|"].iter().any(|start| line.starts_with(start));
    !line.trim().is_empty() && !starts_block && item(line).0.is_empty()
}

/// The text of `markdown` with marks for bold and code; a link to a page names its command.
fn spans(markdown: &str) -> String {
    let mut text = String::new();
    let mut rest = markdown;
    while let Some(letter) = rest.chars().next() {
        if letter == '`' {
            let ticks = &rest[..rest.len() - rest.trim_start_matches('`').len()];
            if let Some((code, after)) = rest[ticks.len()..].split_once(ticks) {
                text += &format!("{CODE}{}{CODE}", code.trim());
                rest = after;
                continue;
            }
        } else if let Some(after) = rest.strip_prefix("**") {
            text.push(BOLD);
            rest = after;
            continue;
        } else if let Some((label, target, after)) = link(rest) {
            let page = target.rsplit('/').next().unwrap_or_default();
            let page = page.split('#').next().unwrap_or_default();
            text += &spans(label);
            if target.contains("://") {
                text += &format!(" ({target})");
            } else if let Some(page) = page.strip_suffix(".md") {
                text += &format!(" ({CODE}firsthand help {}{CODE})", page.to_lowercase());
            }
            rest = after;
            continue;
        } else if letter == '\\' && rest[1..].starts_with(|next: char| next.is_ascii_punctuation())
        {
            rest = &rest[1..];
        }
        let next = rest.chars().next().map_or(1, char::len_utf8);
        text += &rest[..next];
        rest = &rest[next..];
    }
    text
}

/// The label and the target of the link or picture that `text` begins with, and what follows it.
fn link(text: &str) -> Option<(&str, &str, &str)> {
    let inside = text.strip_prefix('!').unwrap_or(text).strip_prefix('[')?;
    let (label, rest) = inside.split_once("](")?;
    let (target, after) = rest.split_once(')')?;
    (!label.contains(']')).then_some((label, target, after))
}

/// The number of visible characters.
fn width_of(text: &str) -> usize {
    text.chars().filter(|&letter| letter != BOLD && letter != CODE).count()
}

fn longest_word(text: &str) -> usize {
    let words = text.split_whitespace().map(width_of);
    words.max().unwrap_or_default()
}

/// `text` in lines of at most `width` characters; only a longer word is cut.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    let mut used = 0;
    for word in text.split_whitespace() {
        if used > 0 && used + 1 + width_of(word) > width {
            lines.push(String::new());
            used = 0;
        }
        if used > 0 {
            push(&mut lines, ' ');
            used += 1;
        }
        for letter in word.chars() {
            if used == width && width_of(letter.encode_utf8(&mut [0; 4])) > 0 {
                lines.push(String::new());
                used = 0;
            }
            push(&mut lines, letter);
            used += width_of(letter.encode_utf8(&mut [0; 4]));
        }
    }
    lines
}

fn push(lines: &mut [String], letter: char) {
    if let Some(line) = lines.last_mut() {
        line.push(letter);
    }
}

/// Replaces the marks in `lines` of one text by the styles of a terminal, each of which ends with its line.
fn styled(lines: &[String]) -> Vec<String> {
    let (mut bold, mut code) = (false, false);
    let start = |bold: bool, code: bool| match (bold, code) {
        (false, false) => "",
        (true, false) => "\x1b[1m",
        (_, true) => "\x1b[36m",
    };
    lines
        .iter()
        .map(|line| {
            let mut text = start(bold, code).to_owned();
            for letter in line.chars() {
                let before = start(bold, code);
                match letter {
                    BOLD => bold = !bold,
                    CODE => code = !code,
                    _ => text.push(letter),
                }
                if matches!(letter, BOLD | CODE) {
                    text += if before.is_empty() { "" } else { "\x1b[0m" };
                    text += start(bold, code);
                }
            }
            if bold || code {
                text += "\x1b[0m";
            }
            text
        })
        .collect()
}

/// The styled `lines`, of which the first begins with `first` and the others with `rest`.
fn painted(lines: &[String], first: &str, rest: &str) -> String {
    let lines = styled(lines).into_iter().enumerate();
    lines.map(|(at, line)| format!("{}{line}\n", if at == 0 { first } else { rest })).collect()
}

/// The cells of a row, which are parted by bars outside of code.
fn cells(row: &str) -> Vec<String> {
    let mut cells = vec![String::new()];
    let (mut code, mut escaped) = (false, false);
    for letter in row.trim().trim_matches('|').chars() {
        code ^= letter == '`';
        if letter == '|' && !code && !escaped {
            cells.push(String::new());
        } else if let Some(cell) = cells.last_mut() {
            cell.push(letter);
        }
        escaped = letter == '\\';
    }
    cells.iter().map(|cell| spans(cell.trim())).collect()
}

/// A table whose columns are made narrower until it fits; its second row parts the heading from the rest.
fn table(mut rows: Vec<Vec<String>>, width: usize) -> String {
    let columns = rows[0].len();
    let widest = |column: usize, width: fn(&str) -> usize| {
        let cells = rows.iter().filter_map(|row| row.get(column));
        // The row of dashes has no width of its own.
        let cells = cells.filter(|cell| !is_rule(cell));
        cells.map(|cell| width(cell)).max().unwrap_or(1)
    };
    let mut widths: Vec<usize> = (0..columns).map(|column| widest(column, width_of)).collect();
    let words: Vec<usize> = (0..columns).map(|column| widest(column, longest_word)).collect();
    let room = width.saturating_sub(GAP * columns.saturating_sub(1));
    // Words are cut only if the table does not fit otherwise.
    for least in [words, vec![NARROWEST; columns]] {
        while widths.iter().sum::<usize>() > room
            && let Some((widest, _)) =
                widths.iter_mut().zip(&least).filter(|(width, least)| **width > **least).max()
        {
            *widest -= 1;
        }
    }
    for cell in &mut rows[0] {
        *cell = format!("{BOLD}{cell}{BOLD}");
    }
    let mut text = String::new();
    for row in rows.iter().filter(|row| !row.iter().all(|cell| is_rule(cell))) {
        let cells = row.iter().zip(&widths);
        let cells: Vec<_> = cells.map(|(cell, &width)| wrapped(cell, width)).collect();
        let height = cells.iter().map(Vec::len).max().unwrap_or_default();
        // These are the lines of a cell as they are shown, and the blanks after each.
        let cells = cells.iter().zip(&widths).map(|(cell, width)| {
            let blanks = cell.iter().map(|line| width - width_of(line));
            styled(cell).into_iter().zip(blanks.collect::<Vec<_>>())
        });
        let mut cells: Vec<_> = cells.collect();
        for _ in 0..height {
            let mut shown = String::new();
            for (cell, width) in cells.iter_mut().zip(&widths) {
                let (part, blank) = cell.next().unwrap_or((String::new(), *width));
                shown += &part;
                shown += &" ".repeat(blank + GAP);
            }
            text += shown.trim_end();
            text.push('\n');
        }
    }
    text
}

/// Whether a cell belongs to the row that parts the heading from the rest.
fn is_rule(cell: &str) -> bool {
    cell.contains("---") && cell.chars().all(|letter| "-: ".contains(letter))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `text` without styles.
    fn plain(text: &str) -> String {
        let mut parts = text.split('\x1b');
        let first = parts.next().unwrap_or_default().to_owned();
        parts.fold(first, |plain, part| plain + part.split_once('m').map_or("", |(_, rest)| rest))
    }

    #[test]
    fn text_is_wrapped_and_lists_are_indented_and_code_stays_as_it_is() {
        let page = "# A title\n\nOne two\nthree **four** five.\n\n- an item that is\n  long\n1. `a|b`\n\n```sh\ncode  that is longer than a line\n```\n";
        let shown = "A title\n\nOne two three\nfour five.\n\n• an item\n  that is\n  long\n1. a|b\n\n    code  that is longer than a line\n";
        assert_eq!(plain(&render(page, 13)), shown);
    }

    #[test]
    fn a_link_to_a_page_names_its_command_and_one_elsewhere_its_address() {
        let shown =
            plain(&render("[Add one](sub/A-stage.md#x), [site](http://a.b), [code](../x.rs)", 100));
        assert_eq!(shown, "Add one (firsthand help a-stage), site (http://a.b), code\n");
    }

    #[test]
    fn a_table_fits_the_width_and_no_style_leaves_its_cell() {
        let page = "| key | meaning |\n|---|---|\n| `a` | **many words that take two lines** |\n";
        let shown = render(page, 24);
        assert_eq!(plain(&shown), "key  meaning\na    many words that\n     take two lines\n");
        for line in shown.lines() {
            assert!(width_of(&plain(line)) <= 24, "{line}");
            assert!(!line.contains("\x1b[1m") || line.ends_with("\x1b[0m"), "{line:?}");
        }
    }

    #[test]
    fn every_page_fits_a_terminal_but_for_lines_of_code() {
        for page in super::super::GUIDE {
            for line in plain(&render(page.text, 80)).lines() {
                let is_code = line.starts_with(INDENT);
                assert!(is_code || width_of(line) <= 80, "{}: {line}", page.file);
            }
        }
    }
}
