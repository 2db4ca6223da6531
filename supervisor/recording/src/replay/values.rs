//! Fields of a message as text, to describe a difference.

use common::{bus::Value, topics::AnyTopic};

/// Returns the first field in which two messages of `topic` differ, with both values, except fields
/// that end with one of `left_out`.
pub fn first_difference(
    topic: &dyn AnyTopic,
    messages: [&[u8]; 2],
    left_out: &[&str],
) -> Option<(String, [String; 2])> {
    let [first, second] = messages.map(|message| {
        let mut values = of(topic, message);
        values.retain(|(field, _)| !left_out.iter().any(|end| field.ends_with(end)));
        values
    });
    let counts = [first.len(), second.len()];
    match first.into_iter().zip(second).find(|(one, other)| one != other) {
        Some(((field, one), (_, other))) => Some((field, [one, other])),
        None => (counts[0] != counts[1])
            .then(|| ("number of elements".to_owned(), counts.map(|count| count.to_string()))),
    }
}

fn of(topic: &dyn AnyTopic, message: &[u8]) -> Vec<(String, String)> {
    let mut fields = Vec::new();
    if let Some((header, elements)) = topic.decoded(message) {
        flatten("", &header, &mut fields);
        flatten("elements", &Value::Array(elements.unwrap_or_default()), &mut fields);
    }
    fields
}

fn flatten(path: &str, value: &Value, fields: &mut Vec<(String, String)>) {
    let text = match value {
        Value::Unsigned(number) => number.to_string(),
        Value::Signed(number) => number.to_string(),
        // This format distinguishes any two values.
        Value::Single(number) => format!("{number:?}"),
        Value::Double(number) => format!("{number:?}"),
        Value::Text(text) => text.clone(),
        Value::Array(items) => {
            for (index, item) in items.iter().enumerate() {
                flatten(&format!("{path}[{index}]"), item, fields);
            }
            return;
        }
        Value::Struct(members) => {
            for (name, member) in members {
                let within = if path.is_empty() { "" } else { "." };
                flatten(&format!("{path}{within}{name}"), member, fields);
            }
            return;
        }
    };
    fields.push((path.to_owned(), text));
}

#[cfg(test)]
mod tests {
    use super::*;
    use common::{bus::encode_slice, samples::GridHeader, topics};

    #[test]
    fn the_element_that_differs_is_named_with_both_values() {
        let [one, other] = [0_u8, 3].map(|cell| {
            let mut message = Vec::new();
            encode_slice(&GridHeader::default(), &[0, cell], &mut message);
            message
        });
        let difference = first_difference(&topics::GRID, [&one, &other], &[]);
        let expected = ("elements[1]".to_owned(), ["0", "3"].map(str::to_owned));
        assert_eq!(difference, Some(expected));
    }
}
