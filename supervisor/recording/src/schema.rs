//! Schema of a topic, made from its layout: the text of a ROS 2 message and its nested messages.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::LazyLock,
};

use common::{
    bus::{Kind, Structure},
    topics::{self, AnyTopic},
};

#[derive(Debug)]
pub struct Schema {
    /// For example `firsthand/msg/Pose`.
    pub name: String,
    /// Fields of the message, then the nested messages.
    pub text: String,
}

/// All schemas by name, without comments.
static OWN: LazyLock<BTreeMap<String, String>> = LazyLock::new(|| {
    topics::TABLE
        .iter()
        .map(|topic| of(*topic))
        .map(|Schema { name, text }| (name, uncommented(&text)))
        .collect()
});

/// Returns whether a recorded schema has the name of a known one and other fields.
pub(crate) fn differs(name: &str, text: &[u8]) -> bool {
    OWN.get(name).is_some_and(|own| uncommented(&String::from_utf8_lossy(text)) != *own)
}

fn uncommented(text: &str) -> String {
    text.lines().filter(|line| !line.starts_with('#')).flat_map(|line| [line, "\n"]).collect()
}

const RULE: &str =
    "================================================================================\n";

pub fn of(topic: &dyn AnyTopic) -> Schema {
    let (header, element) = topic.layout();
    let mut parts = Vec::new();
    let mut text = format!("# {}\n", topic.spec().meaning.trim());
    let name = match (header, element) {
        (Kind::Struct(sample), None) => {
            text += &fields(&sample, &mut parts);
            sample.name
        }
        (header, element) => {
            text += &format!("{} header\n", kind(&header, &mut parts));
            if let Some(element) = element {
                text += &format!("{}[] elements\n", kind(&element, &mut parts));
            }
            match header {
                Kind::Struct(header) => header.name.trim_end_matches("Header"),
                _ => topic.spec().name,
            }
        }
    };
    let mut written = BTreeSet::new();
    while let Some(part) = parts.pop() {
        if written.insert(part.name) {
            let body = fields(&part, &mut parts);
            text += &format!("{RULE}MSG: {}\n{body}", part.name.replace('.', "/"));
        }
    }
    Schema { name: name.replacen('.', "/msg/", 1), text }
}

fn fields(structure: &Structure, parts: &mut Vec<Structure>) -> String {
    structure
        .fields
        .iter()
        .map(|field| format!("{} {}\n", kind(&field.kind, parts), field.name))
        .collect()
}

fn kind(of: &Kind, parts: &mut Vec<Structure>) -> String {
    match of {
        Kind::Number(name) => number(name).to_owned(),
        // A schema has no arrays of arrays; they become one array.
        Kind::Array(inner, length) => match &**inner {
            Kind::Array(inner, more) => kind(&Kind::Array(inner.clone(), length * more), parts),
            inner => format!("{}[{length}]", kind(inner, parts)),
        },
        Kind::Struct(structure) => {
            parts.push(structure.clone());
            structure.name.replace('.', "/")
        }
    }
}

fn number(rust: &str) -> &str {
    match rust {
        "u8" => "uint8",
        "u16" => "uint16",
        "u32" => "uint32",
        "u64" => "uint64",
        "i32" => "int32",
        "i64" => "int64",
        "f32" => "float32",
        "f64" => "float64",
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_schema_lists_the_fields_of_the_layout_in_their_order() {
        let schema = of(&topics::STALLS);
        assert_eq!(schema.name, "firsthand/msg/Stall");
        let first: Vec<_> = schema.text.lines().skip(1).take(3).collect();
        assert_eq!(first, ["firsthand/Stamp stamp", "float64 x_m", "float64 y_m"]);
        assert!(schema.text.contains("MSG: firsthand/Stamp\nuint64 tick\n"));
    }

    #[test]
    fn a_schema_of_slices_has_the_header_and_the_elements() {
        let schema = of(&topics::GRID);
        assert_eq!(schema.name, "firsthand/msg/Grid");
        assert!(schema.text.contains("firsthand/GridHeader header\nuint8[] elements\n"));
        assert_eq!(schema.text.matches("MSG: firsthand/ClearBeam").count(), 1);
    }

    #[test]
    fn no_schema_holds_a_type_that_messages_do_not_have() {
        for topic in topics::TABLE {
            for line in of(*topic).text.lines() {
                let known = ["uint", "int32", "int64", "float", "firsthand/", "#", "=", "MSG: "];
                assert!(known.iter().any(|start| line.starts_with(start)), "{line}");
            }
        }
    }
}
