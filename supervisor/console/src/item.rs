//! Wrapped text, and items of a Markdown list.

/// Line width, which only longer code spans exceed.
const WIDTH: usize = 120;

/// Formats a list item and keeps code spans on one line.
pub fn item(text: &str) -> String {
    format!("- {}\n", wrapped(text, WIDTH - "- ".len(), true).join("\n  "))
}

/// Wraps `text` at `width` letters. Longer words, and code spans if `whole_code`, stay whole.
pub fn wrapped(text: &str, width: usize, whole_code: bool) -> Vec<String> {
    let mut in_code = false;
    let words = text.split_inclusive(|letter| {
        in_code ^= whole_code && letter == '`';
        letter == ' ' && !in_code
    });
    let mut lines = vec![String::new()];
    let mut column = 0;
    for word in words {
        let letters = word.trim_end().chars().count();
        if column > 0 && column + letters > width {
            lines.push(String::new());
            column = 0;
        }
        if let Some(line) = lines.last_mut() {
            line.push_str(word);
        }
        column += word.chars().count();
    }
    lines.iter().map(|line| line.trim_end().to_owned()).collect()
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
