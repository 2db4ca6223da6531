//! Splits a command into words, with a shell's quotes and nothing else of a shell.

use thiserror::Error;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub(crate) enum WordsError {
    #[error("there is nothing in it")]
    Nothing,
    /// A quote or escape is open at its end.
    #[error("it ends within {0}")]
    Unfinished(&'static str),
    /// No program takes such a word.
    #[error("it contains a zero byte")]
    Zero,
}

/// The words of `command`. White space separates them, except between '...' or "..."; a backslash takes the next character
/// literally, except between '...'. Variables, patterns and pipes are ordinary characters.
pub(crate) fn split(command: &str) -> Result<Vec<String>, WordsError> {
    if command.contains('\0') {
        return Err(WordsError::Zero);
    }
    let mut words = Vec::new();
    // The current word. It may be empty, as "" is.
    let mut word: Option<String> = None;
    let mut quote: Option<char> = None;
    let mut characters = command.chars();
    while let Some(character) = characters.next() {
        match (character, quote) {
            ('\\', None | Some('"')) => {
                let next = characters.next();
                let next = next.ok_or(WordsError::Unfinished("a backslash"))?;
                word.get_or_insert_default().push(next);
            }
            (_, Some(open)) if open == character => quote = None,
            ('\'' | '"', None) => {
                quote = Some(character);
                word.get_or_insert_default();
            }
            (_, None) if character.is_whitespace() => words.extend(word.take()),
            _ => word.get_or_insert_default().push(character),
        }
    }
    if quote.is_some() {
        return Err(WordsError::Unfinished("quotes"));
    }
    words.extend(word);
    if words.is_empty() {
        return Err(WordsError::Nothing);
    }
    Ok(words)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_parted_by_white_space_but_not_between_quotes_and_nothing_is_expanded() {
        for (command, words) in [
            ("  a  b\tc\n", &["a", "b", "c"][..]),
            ("a 'b  c' \"d 'e\"", &["a", "b  c", "d 'e"]),
            ("a\\ b '\\' \"\\\"\" ''", &["a b", "\\", "\"", ""]),
            ("x=\"y z\"w", &["x=y zw"]),
            ("echo $HOME *.rs | sh; `id`", &["echo", "$HOME", "*.rs", "|", "sh;", "`id`"]),
        ] {
            assert_eq!(split(command).unwrap(), words, "{command}");
        }
    }

    #[test]
    fn a_command_that_does_not_end_or_has_no_words_is_refused() {
        for (command, error) in [
            ("", WordsError::Nothing),
            (" \t", WordsError::Nothing),
            ("a 'b", WordsError::Unfinished("quotes")),
            ("a \"b\\", WordsError::Unfinished("a backslash")),
            ("a\0b", WordsError::Zero),
        ] {
            assert_eq!(split(command), Err(error), "{command:?}");
        }
    }
}
