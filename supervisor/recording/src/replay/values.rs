//! The fields of a message as text, to describe a difference.

use common::{
    bus::{Kind, Layout as _, cdr::Decoder},
    topics::AnyTopic,
};

/// The first field in which two messages of `topic` differ, and both values. Fields with an end among `left_out` do not count.
pub(crate) fn first_difference(
    topic: &dyn AnyTopic,
    messages: [&[u8]; 2],
    left_out: &[&str],
) -> Option<(String, [String; 2])> {
    let [first, second] = messages.map(|message| {
        let mut values = of(topic, message);
        values.retain(|(field, _)| !left_out.iter().any(|end| field.ends_with(end)));
        values
    });
    let differs = first.iter().zip(&second).find(|(one, other)| one != other);
    let counts = [first.len(), second.len()];
    match differs {
        Some(((field, one), (_, other))) => Some((field.clone(), [one.clone(), other.clone()])),
        None => (counts[0] != counts[1])
            .then(|| ("number of elements".to_owned(), counts.map(|count| count.to_string()))),
    }
}

/// The fields of a message of `topic`: names and values, in order. They end where the message ends.
fn of(topic: &dyn AnyTopic, message: &[u8]) -> Vec<(String, String)> {
    let Some(from) = Decoder::new(message) else {
        return Vec::new();
    };
    let mut walk = Walk { from, values: Vec::new() };
    let (sample, element) = topic.layout();
    if walk.kind("", &sample).is_some()
        && let Some(element) = element
        && let Some(length) = u32::decode(&mut walk.from)
    {
        for index in 0..length {
            if walk.kind(&format!("elements[{index}]"), &element).is_none() {
                break;
            }
        }
    }
    walk.values
}

struct Walk<'a> {
    from: Decoder<'a>,
    values: Vec<(String, String)>,
}

impl Walk<'_> {
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
                let before = if path.is_empty() { String::new() } else { format!("{path}.") };
                for field in &structure.fields {
                    self.kind(&format!("{before}{}", field.name), &field.kind)?;
                }
            }
        }
        Some(())
    }

    fn value(&mut self, name: &str) -> Option<String> {
        let from = &mut self.from;
        Some(match name {
            "u8" => u8::decode(from)?.to_string(),
            "u16" => u16::decode(from)?.to_string(),
            "u32" => u32::decode(from)?.to_string(),
            "u64" => u64::decode(from)?.to_string(),
            "i32" => i32::decode(from)?.to_string(),
            "i64" => i64::decode(from)?.to_string(),
            // The format has the digits that distinguish any two values.
            "f32" => format!("{:?}", f32::decode(from)?),
            "f64" => format!("{:?}", f64::decode(from)?),
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
        let difference = |topic, [one, other]: &[Vec<u8>; 2]| {
            first_difference(topic, [one, other], &[]).unwrap()
        };
        let expected = ("x_m".to_owned(), ["1.5", "1.25"].map(str::to_owned));
        assert_eq!(difference(&topics::POSE as _, &messages), expected);
        let mut messages = [Vec::new(), Vec::new()];
        for (message, cell) in messages.iter_mut().zip([0_u8, 3]) {
            encode_slice(&GridHeader::default(), &[0, cell], message);
        }
        let expected = ("elements[1]".to_owned(), ["0", "3"].map(str::to_owned));
        assert_eq!(difference(&topics::GRID, &messages), expected);
    }
}
