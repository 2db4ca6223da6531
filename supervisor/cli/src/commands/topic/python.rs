//! `firsthand topic list --python`: a module for consumers in Python.

use std::collections::BTreeSet;

use common::{
    VERSION,
    bus::{Kind, Structure},
    grid::CellState,
    samples::*,
    topics,
};

/// Lists byte enums that comments of structs name, and that of the bytes of `grid`.
macro_rules! enums {
    ($($name:ident)*) => {
        const ENUMS: &[(&str, &[(&str, u8)])] = &[$((stringify!($name), $name::VALUES)),*];
    };
}

enums! {
    Action BeaconRefusal Cause CommandState DeathCause Direction FaultAnswer FaultKind FixRefusal FollowState GuidanceStatus HealthState
    HoldReason Maneuver NextStep Order RangeStatus RecoveryStep RequestAnswer RequestKind Rest StageState StallCause
    CellState
}

/// Returns the module: structs with layouts checked on import, and a follower.
pub fn module() -> String {
    let mut module = include_str!("topics.py").to_owned();
    for (name, values) in ENUMS {
        module += &format!("class {name}(enum.IntEnum):\n");
        for (value, byte) in *values {
            // `None` is a keyword of Python.
            let value = if *value == "None" { "Nothing" } else { value };
            module += &format!("    {value} = {byte}\n");
        }
        module += "\n\n";
    }
    let (mut known, mut table) = (BTreeSet::new(), String::new());
    for topic in topics::TABLE {
        let (payload, element) = topic.layout();
        for kind in [Some(&payload), element.as_ref()].into_iter().flatten() {
            declare(kind, &mut known, &mut module);
        }
        let element = element.map_or("None".to_owned(), |element| python(&element));
        let (name, payload) = (topic.spec().name, python(&payload));
        table += &format!("    \"{name}\": ({payload}, {element}),\n");
    }
    module += &format!(
        "# What each sample is: a struct; or a header, and what a slice is made of.\nTOPICS = {{\n{table}}}\nVERSION = {VERSION:?}\n"
    );
    module
}

/// Declares the class once, after the classes of its fields.
fn declare(kind: &Kind, known: &mut BTreeSet<&'static str>, module: &mut String) {
    let structure = match kind {
        Kind::Number(_) => return,
        Kind::Array(element, _) => return declare(element, known, module),
        Kind::Struct(structure) => structure,
    };
    if !known.insert(structure.name) {
        return;
    }
    for field in &structure.fields {
        declare(&field.kind, known, module);
    }
    let class = class(structure);
    *module += &format!("class {class}(Struct):\n");
    let commented = || structure.fields.iter().filter(|field| !field.doc.is_empty());
    if commented().count() > 0 {
        *module += "    \"\"\"\n";
        for field in commented() {
            *module += &format!("    {}:{}\n", field.name, plain(field.doc));
        }
        *module += "    \"\"\"\n\n";
    }
    *module += "    _fields_ = [\n";
    for field in &structure.fields {
        *module += &format!("        (\"{}\", {}),\n", field.name, python(&field.kind));
    }
    *module += &format!(
        "    ]\n\n    @staticmethod\n    def type_name():\n        return \"{}\"\n\n\n",
        structure.name
    );
    *module += &format!("assert ctypes.sizeof({class}) == {}\n", structure.size);
    for field in &structure.fields {
        let (name, offset) = (field.name, field.offset);
        *module += &format!("assert {class}.{name}.offset == {offset}\n");
    }
    *module += "\n\n";
}

/// Returns a comment without link markup.
fn plain(doc: &str) -> String {
    let mut parts = doc.split("](");
    let mut text = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        text += part.split_once(')').map_or(part, |(_, rest)| rest);
    }
    text.replace(['[', ']', '`'], "").replace("super::", "").replace("crate::", "")
}

/// Strips the project's name.
fn class(structure: &Structure) -> &'static str {
    let name = structure.name;
    name.rsplit_once('.').map_or(name, |(_, name)| name)
}

fn python(kind: &Kind) -> String {
    match kind {
        Kind::Number("f32") => "ctypes.c_float".to_owned(),
        Kind::Number("f64") => "ctypes.c_double".to_owned(),
        Kind::Number(integer) => {
            let (sign, bits) = integer.split_at(1);
            let unsigned = if sign == "u" { "u" } else { "" };
            format!("ctypes.c_{unsigned}int{bits}")
        }
        // Arrays of bytes are texts.
        Kind::Array(element, length) if **element == Kind::Number("u8") => {
            format!("ctypes.c_char * {length}")
        }
        Kind::Array(element, length) => format!("{} * {length}", python(element)),
        Kind::Struct(structure) => class(structure).to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns size and alignment in C.
    fn in_c(kind: &Kind) -> (usize, usize) {
        match kind {
            Kind::Number(number) => {
                let bits: usize = number[1..].parse().unwrap();
                (bits / 8, bits / 8)
            }
            Kind::Array(element, length) => {
                let (size, align) = in_c(element);
                (size * length, align)
            }
            Kind::Struct(structure) => {
                let (mut end, mut most) = (0_usize, 1);
                for field in &structure.fields {
                    let (size, align) = in_c(&field.kind);
                    let offset = end.next_multiple_of(align);
                    assert_eq!(field.offset, offset, "{}.{}", structure.name, field.name);
                    (end, most) = (offset + size, most.max(align));
                }
                let size = end.next_multiple_of(most);
                assert_eq!(structure.size, size, "{}", structure.name);
                (size, most)
            }
        }
    }

    #[test]
    fn every_payload_has_the_size_and_the_offsets_that_its_declared_fields_have_in_c() {
        for topic in topics::TABLE {
            let (payload, element) = topic.layout();
            in_c(&payload);
            element.as_ref().map(in_c);
        }
    }

    #[test]
    fn python_takes_the_layouts_of_the_module_for_the_same_prints_fields_and_joins_a_series() {
        let module = module();
        for topic in topics::TABLE {
            let row = format!("\"{}\": (", topic.spec().name);
            assert!(module.contains(&row), "{row}");
        }
        assert!(module.contains(&format!("\nVERSION = {VERSION:?}\n")));
        let checks = "
assert series('0.1.0') == series('0.1.7') != series('0.2.0')
assert series('1.2.0') == series('1.3.0') != series('2.2.0') != series('')
said = repr(TOPICS['pose'][0](x_m=1.5))
assert 'x_m=1.5' in said and 'stamp=Stamp(tick=0' in said, said";
        let ran = std::process::Command::new("python3").args(["-c", &(module + checks)]).output();
        // Without Python here, only imports check the layouts.
        if let Ok(output) = ran {
            assert!(output.status.success(), "{output:?}");
        }
    }

    #[test]
    fn every_enum_that_the_comment_of_a_byte_names_is_in_the_python_module() {
        fn check(kind: &Kind, module: &str) {
            let Kind::Struct(structure) = kind else { return };
            for field in &structure.fields {
                check(&field.kind, module);
                let named = field.doc.split("A [`").nth(1).and_then(|rest| rest.split('`').next());
                if let (Some(name), Kind::Number("u8")) = (named, &field.kind) {
                    assert!(module.contains(&format!("class {name}(enum.IntEnum):")), "{name}");
                }
            }
        }
        let module = module();
        for topic in topics::TABLE {
            check(&topic.layout().0, &module);
        }
        assert!(module.contains("GuidanceStatus.\n"), "comments lose the marks of links");
    }
}
