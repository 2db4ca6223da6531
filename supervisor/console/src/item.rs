//! A wrapped item of a Markdown list.

/// A line's columns, unless a code span alone is longer.
const WIDTH: usize = 120;

/// No line ends within a code span.
pub fn item(text: &str) -> String {
    let mut item = String::from("-");
    let mut column = 1;
    let mut rest = text;
    while !rest.is_empty() {
        let mut ends = rest.match_indices(' ').map(|(at, _)| at);
        let outside_code = |at: &usize| rest[..*at].matches('`').count().is_multiple_of(2);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_item_is_wrapped_and_its_code_spans_are_whole() {
        let text = format!("{} `a b` c", "word ".repeat(23).trim_end());
        let wrapped = item(&text);
        assert!(wrapped.ends_with("\n  `a b` c\n"), "{wrapped}");
        assert!(wrapped.lines().all(|line| line.len() <= WIDTH));
    }
}
