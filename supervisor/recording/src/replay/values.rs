//! The fields of a message as text, to describe a difference.

use common::{
    bus::{Kind, cdr},
    topics::AnyTopic,
};

/// The fields of a message of `topic`: names and values, in order. They end where the message ends.
pub fn of(topic: &dyn AnyTopic, message: &[u8]) -> Vec<(String, String)> {
    let Some(bytes) = message.strip_prefix(&cdr::HEADER) else {
        return Vec::new();
    };
    let mut walk = Walk { bytes, at: 0, values: Vec::new() };
    let (sample, element) = topic.layout();
    if walk.kind("", &sample).is_some()
        && let Some(element) = element
        && let Some(length) = walk.number(4)
    {
        let length = length.first_chunk().map_or(0, |bytes| u32::from_le_bytes(*bytes));
        for index in 0..length {
            if walk.kind(&format!("elements[{index}]"), &element).is_none() {
                break;
            }
        }
    }
    walk.values
}

/// The first field in which two messages of `topic` differ: its name, and both values.
pub fn first_difference(
    topic: &dyn AnyTopic,
    first: &[u8],
    second: &[u8],
) -> (String, String, String) {
    let (first, second) = (of(topic, first), of(topic, second));
    let differs = first.iter().zip(&second).find(|(one, other)| one != other);
    match differs {
        Some(((field, one), (_, other))) => (field.clone(), one.clone(), other.clone()),
        None => {
            ("number of elements".to_owned(), first.len().to_string(), second.len().to_string())
        }
    }
}

struct Walk<'a> {
    bytes: &'a [u8],
    at: usize,
    values: Vec<(String, String)>,
}

impl<'a> Walk<'a> {
    fn number(&mut self, size: usize) -> Option<&'a [u8]> {
        let start = self.at.next_multiple_of(size);
        let number = self.bytes.get(start..start + size)?;
        self.at = start + size;
        Some(number)
    }

    fn kind(&mut self, path: &str, kind: &Kind) -> Option<()> {
        match kind {
            Kind::Number(name) => {
                let value = self.value(name)?;
                self.values.push((path.to_owned(), value));
            }
            Kind::Array(item, length) => {
                for index in 0..*length {
                    self.kind(&format!("{path}[{index}]"), item)?;
                }
            }
            Kind::Struct(structure) => {
                for field in &structure.fields {
                    let name = if path.is_empty() {
                        field.name.to_owned()
                    } else {
                        format!("{path}.{}", field.name)
                    };
                    self.kind(&name, &field.kind)?;
                }
            }
        }
        Some(())
    }

    fn value(&mut self, name: &str) -> Option<String> {
        Some(match name {
            "u8" => self.number(1)?.first()?.to_string(),
            "u16" => u16::from_le_bytes(*self.number(2)?.first_chunk()?).to_string(),
            "u32" => u32::from_le_bytes(*self.number(4)?.first_chunk()?).to_string(),
            "u64" => u64::from_le_bytes(*self.number(8)?.first_chunk()?).to_string(),
            "i32" => i32::from_le_bytes(*self.number(4)?.first_chunk()?).to_string(),
            // Digits that distinguish any two values.
            "f32" => format!("{:?}", f32::from_le_bytes(*self.number(4)?.first_chunk()?)),
            "f64" => format!("{:?}", f64::from_le_bytes(*self.number(8)?.first_chunk()?)),
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use common::{
        bus::{encode_sample, encode_slice},
        samples::{GridHeader, PoseSample},
        topics,
    };

    #[test]
    fn the_field_that_differs_is_named_with_both_values() {
        let mut messages = [Vec::new(), Vec::new()];
        for (message, x_m) in messages.iter_mut().zip([1.5, 1.25]) {
            encode_sample(&PoseSample { x_m, ..PoseSample::default() }, message);
        }
        let difference = first_difference(&topics::POSE, &messages[0], &messages[1]);
        assert_eq!(difference, ("x_m".into(), "1.5".into(), "1.25".into()));
        let mut messages = [Vec::new(), Vec::new()];
        for (message, cell) in messages.iter_mut().zip([0_u8, 3]) {
            encode_slice(&GridHeader::default(), &[0, cell], message);
        }
        let difference = first_difference(&topics::GRID, &messages[0], &messages[1]);
        assert_eq!(difference, ("elements[1]".into(), "0".into(), "3".into()));
    }
}
