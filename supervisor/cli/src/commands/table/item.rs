//! An item of a Markdown list, wrapped.

/// Columns that a line of a list has, unless a code span alone is longer.
const WIDTH: usize = 120;

/// `text` as an item of a Markdown list. No line ends within a code span.
pub(super) fn item(text: &str) -> String {
    let mut item = String::from("-");
    let mut column = 1;
    let mut rest = text;
    while !rest.is_empty() {
        let mut ends = rest.match_indices(' ').map(|(at, _)| at);
        let outside_code = |at: &usize| rest[..*at].matches('`').count() % 2 == 0;
        let word = &rest[..ends.find(outside_code).unwrap_or(rest.len())];
        rest = rest[word.len()..].trim_start();
        let width = word.chars().count();
        if column + 1 + width > WIDTH {
            item.push_str("\n ");
            column = 1;
        }
        item.push(' ');
        item.push_str(word);
        column += 1 + width;
    }
    item + "\n"
}
