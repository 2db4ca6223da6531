//! Formats samples by their layouts: text with one field per line, or one JSON object.

use common::bus::Value;

/// Key for the elements, beside the fields of the header.
const ELEMENTS: &str = "elements";
/// Number of array elements in text, unless all are requested.
const SHOWN: usize = 16;

pub fn text(fields: &Fields, whole: bool) -> String {
    let most = if whole { usize::MAX } else { SHOWN };
    let mut text = String::new();
    for (name, value) in fields {
        write_field(&mut text, 0, name, value, most);
    }
    text
}

/// Formats a sample. Non-finite numbers are null.
pub fn json(fields: Fields) -> serde_json::Result<String> {
    serde_json::to_string(&Value::Struct(fields))
}

pub type Fields = Vec<(&'static str, Value)>;

pub fn fields(header: Value, elements: Option<Vec<Value>>) -> Fields {
    let mut fields = match header {
        Value::Struct(fields) => fields,
        other => vec![("value", other)],
    };
    fields.extend(elements.map(|elements| (ELEMENTS, Value::Array(elements))));
    fields
}

fn write_field(to: &mut String, indent: usize, name: &str, value: &Value, most: usize) {
    match value {
        Value::Struct(fields) => {
            *to += &format!("{:indent$}{name}:\n", "");
            for (name, value) in fields {
                write_field(to, indent + 2, name, value, most);
            }
        }
        Value::Array(elements) if matches!(elements.first(), Some(Value::Struct(_))) => {
            *to += &format!("{:indent$}{name}:\n", "");
            for element in elements.iter().take(most) {
                *to += &format!("{:indent$}- {}\n", "", on_one_line(element, most));
            }
            if elements.len() > most {
                *to += &format!("{:indent$}# {} more\n", "", elements.len() - most);
            }
        }
        other => *to += &format!("{:indent$}{name}: {}\n", "", on_one_line(other, most)),
    }
}

fn on_one_line(value: &Value, most: usize) -> String {
    match value {
        Value::Unsigned(number) => number.to_string(),
        Value::Signed(number) => number.to_string(),
        Value::Single(number) => format!("{number:?}"),
        Value::Double(number) => format!("{number:?}"),
        Value::Text(text) => format!("{text:?}"),
        Value::Array(elements) => {
            let shown: Vec<_> =
                elements.iter().take(most).map(|element| on_one_line(element, most)).collect();
            let more = match elements.len().saturating_sub(most) {
                0 => String::new(),
                more => format!("  # {more} more"),
            };
            format!("[{}]{more}", shown.join(", "))
        }
        Value::Struct(fields) => {
            let fields =
                fields.iter().map(|(name, value)| format!("{name}: {}", on_one_line(value, most)));
            format!("{{{}}}", fields.collect::<Vec<_>>().join(", "))
        }
    }
}

#[cfg(test)]
mod tests {
    use common::{
        bus::Layout as _,
        samples::{GuidanceSample, HealthSample, InfraredSample, name},
    };

    use super::*;

    #[test]
    fn text_has_one_field_a_line_in_the_order_of_the_layout() {
        let infrared = InfraredSample { range_m: [0.5; 7], ..InfraredSample::default() };
        let shown = text(&fields(infrared.value(), None), false);
        let lines: Vec<_> = shown.lines().collect();
        assert_eq!(lines[..2], ["stamp:", "  tick: 0"]);
        assert_eq!(lines[5], "range_m: [0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5]");
        assert_eq!(lines.len(), 7);
    }

    #[test]
    fn names_are_text_and_numbers_that_are_not_finite_are_null() {
        let health = HealthSample { stage: name("mapper"), ..HealthSample::default() };
        assert!(text(&fields(health.value(), None), false).contains("\nstage: \"mapper\"\n"));
        let guidance =
            GuidanceSample { speed_limit_m_s: f64::INFINITY, ..GuidanceSample::default() };
        let line = json(fields(guidance.value(), None)).unwrap();
        let read: serde_json::Value = serde_json::from_str(&line).unwrap();
        assert!(read["speed_limit_m_s"].is_null() && read["stamp"]["tick"] == 0, "{line}");
    }

    #[test]
    fn long_arrays_are_cut_in_text_unless_all_is_asked_for() {
        let array = Value::Array(vec![Value::Unsigned(1); 20]);
        let line = |most| on_one_line(&array, most);
        assert!(line(SHOWN).ends_with("1]  # 4 more"), "{}", line(SHOWN));
        assert_eq!(line(usize::MAX).matches('1').count(), 20);
        let structs = Value::Array(vec![Value::Struct(vec![("x", Value::Signed(-2))]); 18]);
        let mut text = String::new();
        write_field(&mut text, 0, "beams", &structs, SHOWN);
        assert!(text.starts_with("beams:\n- {x: -2}\n") && text.ends_with("# 2 more\n"), "{text}");
    }
}
