//! The options of this process as the parameters of its node, and the services by which `ros2 param` reads them. Pure.

use std::any::TypeId;

use clap::{Arg, ArgMatches, Command};
use ros2::cdr::{Malformed, Reader, Writer};

/// The options with which nothing is served.
const OTHERS: [&str; 4] = ["help", "version", "topics", "rviz"];
/// The most names, or elements of a value, in a request.
const MOST: usize = 256;

#[derive(Clone, Copy)]
pub enum Service {
    List,
    Describe,
    Get,
    Types,
    Set,
    SetAtomically,
}

pub const SERVICES: [(Service, &str, &str); 6] = [
    (Service::List, "list_parameters", "ListParameters"),
    (Service::Describe, "describe_parameters", "DescribeParameters"),
    (Service::Get, "get_parameters", "GetParameters"),
    (Service::Types, "get_parameter_types", "GetParameterTypes"),
    (Service::Set, "set_parameters", "SetParameters"),
    (Service::SetAtomically, "set_parameters_atomically", "SetParametersAtomically"),
];

#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    Bool(bool),
    Integer(i64),
    Double(f64),
    Text(String),
    Texts(Vec<String>),
}

#[derive(Clone)]
pub struct Parameter {
    name: String,
    value: Value,
    meaning: String,
}

pub fn of_options(mut command: &Command, mut matches: &ArgMatches) -> Vec<Parameter> {
    if let Some((name, of_it)) = matches.subcommand()
        && let Some(subcommand) = command.find_subcommand(name)
    {
        (command, matches) = (subcommand, of_it);
    }
    let options = command.get_arguments().filter(|it| !OTHERS.contains(&it.get_id().as_str()));
    let parameter = |option: &Arg| {
        Some(Parameter {
            name: option.get_id().to_string(),
            value: value(option, matches)?,
            meaning: option.get_help().map(ToString::to_string).unwrap_or_default(),
        })
    };
    options.filter_map(parameter).collect()
}

/// An option that takes no value is a flag. A text is what was written.
fn value(option: &Arg, matches: &ArgMatches) -> Option<Value> {
    let id = option.get_id().as_str();
    if !option.get_action().takes_values() {
        return matches.try_get_one(id).ok().flatten().copied().map(Value::Bool);
    }
    let written = matches.get_raw(id).into_iter().flatten();
    let mut texts = written.map(|text| text.to_string_lossy().into_owned());
    if option.get_value_delimiter().is_some() {
        return Some(Value::Texts(texts.collect()));
    }
    let text = texts.next()?;
    let is = |of: &[TypeId]| of.iter().any(|of| option.get_value_parser().type_id() == *of);
    let number = if is(&[TypeId::of::<u8>(), TypeId::of::<u16>()]) {
        text.parse().map(Value::Integer).ok()
    } else if is(&[TypeId::of::<f64>()]) {
        text.parse().map(Value::Double).ok()
    } else {
        None
    };
    Some(number.unwrap_or(Value::Text(text)))
}

/// The reply to a request. The error says why the payload is none.
pub fn reply(
    parameters: &[Parameter],
    service: Service,
    payload: &[u8],
) -> Result<Vec<u8>, Malformed> {
    let mut reader = Reader::new(payload)?;
    let is_set = matches!(service, Service::Set | Service::SetAtomically);
    let mut names = Vec::new();
    for _ in 0..reader.length(MOST)? {
        names.push(reader.text()?);
        if is_set {
            skip_value(&mut reader)?;
        }
    }
    let of = |name: &str| parameters.iter().find(|parameter| parameter.name == name);
    let mut writer = Writer::default();
    let refuse = |writer: &mut Writer, name: &str| {
        writer.u8(0).text(&match of(name) {
            Some(_) => format!(
                "no parameter changes while the node runs; start it with --{}",
                name.replace('_', "-")
            ),
            None => "the node has no such parameter".to_owned(),
        });
    };
    match service {
        Service::List => {
            let asked = parameters.iter().map(|parameter| parameter.name.as_str());
            let asked = asked.filter(|name| names.is_empty() || names.contains(name));
            writer.list(asked.collect::<Vec<_>>(), |writer, name| {
                writer.text(name);
            });
            // No name has a prefix.
            writer.length(0);
        }
        Service::Describe => {
            writer.list(names, |writer, name| {
                let parameter = of(name);
                writer.text(name).u8(code(parameter));
                writer.text(parameter.map_or("", |parameter| &parameter.meaning)).text("");
                // It is read-only, has one type, and no ranges are told.
                writer.u8(1).u8(0).length(0).length(0);
            });
        }
        Service::Get => {
            writer.list(names, |writer, name| write_value(writer, of(name)));
        }
        Service::Types => {
            writer.list(names, |writer, name| {
                writer.u8(code(of(name)));
            });
        }
        Service::Set => {
            writer.list(names, refuse);
        }
        Service::SetAtomically => refuse(&mut writer, names.first().unwrap_or(&"")),
    }
    Ok(writer.take())
}

/// The type of a value in a `rcl_interfaces/ParameterValue`; 0 if there is no such parameter.
fn code(parameter: Option<&Parameter>) -> u8 {
    match parameter.map(|parameter| &parameter.value) {
        None => 0,
        Some(Value::Bool(_)) => 1,
        Some(Value::Integer(_)) => 2,
        Some(Value::Double(_)) => 3,
        Some(Value::Text(_)) => 4,
        Some(Value::Texts(_)) => 9,
    }
}

/// A `rcl_interfaces/ParameterValue` has a field of each type.
fn write_value(writer: &mut Writer, parameter: Option<&Parameter>) {
    let value = parameter.map(|parameter| &parameter.value);
    writer.u8(code(parameter)).u8(matches!(value, Some(Value::Bool(true))).into());
    writer.i64(if let Some(Value::Integer(number)) = value { *number } else { 0 });
    writer.f64(if let Some(Value::Double(number)) = value { *number } else { 0.0 });
    writer.text(if let Some(Value::Text(text)) = value { text } else { "" });
    // There are no lists of bytes, flags, integers and numbers.
    writer.length(0).length(0).length(0).length(0);
    let texts = if let Some(Value::Texts(texts)) = value { texts.as_slice() } else { &[] };
    writer.list(texts, |writer, text| {
        writer.text(text);
    });
}

fn skip_value(reader: &mut Reader<'_>) -> Result<(), Malformed> {
    let (_kind, _flag) = (reader.u8()?, reader.u8()?);
    let [_integer, _double] = reader.f64s()?;
    reader.text()?;
    for _bytes_and_flags in 0..2 {
        let length = reader.length(MOST)?;
        reader.raw(length)?;
    }
    for _integers_and_doubles in 0..2 {
        for _ in 0..reader.length(MOST)? {
            reader.f64()?;
        }
    }
    for _ in 0..reader.length(MOST)? {
        reader.text()?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;
    use crate::Arguments;

    fn parameters(words: &[&str]) -> Vec<Parameter> {
        let mut command = Arguments::command();
        let matches = command.try_get_matches_from_mut([&["firsthand-ros2"], words].concat());
        of_options(&command, &matches.unwrap())
    }

    #[test]
    fn parameters_are_the_options_with_their_types_and_values_and_those_of_a_subcommand_its_own() {
        let value = |parameters: &[Parameter], name: &str| {
            let found = parameters.iter().find(|parameter| parameter.name == name);
            found.map(|parameter| parameter.value.clone())
        };
        let text = |text: &str| Some(Value::Text(text.to_owned()));
        let bridge = parameters(&["--accept", "goals,stop", "--domain", "7", "--clock"]);
        assert_eq!(value(&bridge, "robot"), text("x80"));
        assert_eq!(value(&bridge, "domain"), Some(Value::Integer(7)));
        assert_eq!(value(&bridge, "clock"), Some(Value::Bool(true)));
        assert_eq!(value(&bridge, "frames"), text("all"));
        let accepted = ["goals", "stop"].map(str::to_owned).to_vec();
        assert_eq!(value(&bridge, "accept"), Some(Value::Texts(accepted)));
        assert_eq!(value(&bridge, "topics"), None);
        let planner = parameters(&[
            "--namespace",
            "a",
            "planner",
            "--footprint",
            "[[1, 1], [-1, 1], [0, -1]]",
        ]);
        assert_eq!(value(&planner, "namespace"), text("a"));
        assert_eq!(value(&planner, "footprint"), text("[[1, 1], [-1, 1], [0, -1]]"));
        assert_eq!(value(&planner, "occupied"), Some(Value::Integer(99)));
        assert_eq!(value(&planner, "screening"), Some(Value::Double(2.0)));
        assert_eq!(value(&planner, "avoid_unknown"), Some(Value::Bool(false)));
        assert_eq!(value(&planner, "accept"), None);
        assert!(planner.iter().all(|parameter| !parameter.meaning.is_empty()));
    }

    #[test]
    fn a_parameter_is_not_set_and_the_reason_names_the_option() {
        let mut request = Writer::default();
        request.list(["robot_radius", "other"], |writer, name| {
            writer.text(name);
            write_value(writer, None);
        });
        let reply = reply(&parameters(&["planner"]), Service::Set, &request.take()).unwrap();
        let mut reader = Reader::new(&reply).unwrap();
        assert_eq!(reader.length(MOST), Ok(2));
        for reason in ["start it with --robot-radius", "no such parameter"] {
            assert_eq!(reader.u8(), Ok(0));
            assert!(reader.text().unwrap().ends_with(reason));
        }
    }

    #[test]
    fn requests_that_are_cut_are_refused() {
        let mut request = Writer::default();
        request.length(1).text("clock");
        write_value(&mut request, None);
        let request = request.take();
        for length in 0..request.len() {
            assert!(reply(&[], Service::Set, &request[..length]).is_err(), "{length}");
        }
    }
}
