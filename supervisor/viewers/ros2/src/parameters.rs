//! Options as node parameters, and the services for `ros2 param`. Pure.

use std::any::TypeId;

use clap::{Arg, ArgMatches, Command};
use ros2::{
    cdr::{Cdr, Malformed},
    msg::{
        self, DescribeParametersResponse, GetParameterTypesResponse, GetParametersRequest,
        GetParametersResponse, ListParametersRequest, ListParametersResponse, ListParametersResult,
        ParameterDescriptor, ParameterType, ParameterValue, SetParametersAtomicallyResponse,
        SetParametersRequest, SetParametersResponse, SetParametersResult,
    },
};

const OTHERS: [&str; 4] = ["help", "version", "topics", "rviz"];

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
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

#[derive(Clone)]
pub struct Parameter {
    name: String,
    value: ParameterValue,
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

/// Converts an option; one without values is a flag.
fn value(option: &Arg, matches: &ArgMatches) -> Option<ParameterValue> {
    let id = option.get_id().as_str();
    let mut value = ParameterValue::default();
    let written = matches.get_raw(id).into_iter().flatten();
    let mut texts = written.map(|text| text.to_string_lossy().into_owned());
    let is = |of: &[TypeId]| of.iter().any(|of| option.get_value_parser().type_id() == *of);
    value.r#type = if !option.get_action().takes_values() {
        value.bool_value = matches.try_get_one(id).ok().flatten().copied()?;
        ParameterType::PARAMETER_BOOL
    } else if option.get_value_delimiter().is_some() {
        value.string_array_value = texts.collect();
        ParameterType::PARAMETER_STRING_ARRAY
    } else {
        let text = texts.next()?;
        if is(&[TypeId::of::<u8>(), TypeId::of::<u16>()])
            && let Ok(number) = text.parse()
        {
            value.integer_value = number;
            ParameterType::PARAMETER_INTEGER
        } else if is(&[TypeId::of::<f64>()])
            && let Ok(number) = text.parse()
        {
            value.double_value = number;
            ParameterType::PARAMETER_DOUBLE
        } else {
            value.string_value = text;
            ParameterType::PARAMETER_STRING
        }
    };
    Some(value)
}

/// Returns the reply to a request. Fails on a malformed payload.
pub fn reply(
    parameters: &[Parameter],
    service: Service,
    payload: &[u8],
) -> Result<Vec<u8>, Malformed> {
    let of = |name: &str| parameters.iter().find(|parameter| parameter.name == name);
    let value = |name: &String| of(name).map(|it| it.value.clone()).unwrap_or_default();
    let names = || GetParametersRequest::decode(payload).map(|request| request.names);
    let refuse = |msg::Parameter { name, .. }: &msg::Parameter| SetParametersResult {
        successful: false,
        reason: match of(name) {
            Some(_) => format!(
                "parameters are fixed while the node runs; start it with --{}",
                name.replace('_', "-")
            ),
            None => "the node has no such parameter".to_owned(),
        },
    };
    let refused = || {
        let asked = SetParametersRequest::decode(payload)?.parameters;
        Ok(asked.iter().map(refuse).collect::<Vec<_>>())
    };
    Ok(match service {
        Service::List => {
            let asked = ListParametersRequest::decode(payload)?.prefixes;
            let names = parameters.iter().map(|parameter| parameter.name.clone());
            let names = names.filter(|name| asked.is_empty() || asked.contains(name)).collect();
            let result = ListParametersResult { names, prefixes: Vec::new() };
            ListParametersResponse { result }.encode()
        }
        Service::Describe => {
            let descriptor = |name: String| ParameterDescriptor {
                r#type: value(&name).r#type,
                description: of(&name).map(|it| it.meaning.clone()).unwrap_or_default(),
                read_only: true,
                name,
                ..ParameterDescriptor::default()
            };
            let descriptors = names()?.into_iter().map(descriptor).collect();
            DescribeParametersResponse { descriptors }.encode()
        }
        Service::Get => {
            GetParametersResponse { values: names()?.iter().map(value).collect() }.encode()
        }
        Service::Types => {
            let types = names()?.iter().map(|name| value(name).r#type).collect();
            GetParameterTypesResponse { types }.encode()
        }
        Service::Set => SetParametersResponse { results: refused()? }.encode(),
        Service::SetAtomically => {
            let result = refused()?.into_iter().next().unwrap_or_default();
            SetParametersAtomicallyResponse { result }.encode()
        }
    })
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
            found.map(|parameter| parameter.value.clone()).unwrap_or_default()
        };
        let text = |value: ParameterValue| (value.r#type, value.string_value);
        let bridge = parameters(&["--accept", "goals,stop", "--domain", "7", "--clock"]);
        assert_eq!(text(value(&bridge, "robot")), (4, "x80".to_owned()));
        let domain = value(&bridge, "domain");
        assert_eq!((domain.r#type, domain.integer_value), (2, 7));
        let clock = value(&bridge, "clock");
        assert_eq!((clock.r#type, clock.bool_value), (1, true));
        assert_eq!(text(value(&bridge, "frames")).1, "all");
        let accept = value(&bridge, "accept");
        assert_eq!(
            (accept.r#type, accept.string_array_value.join(" ")),
            (9, "goals stop".to_owned())
        );
        assert_eq!(value(&bridge, "topics"), ParameterValue::default());
        let planner = parameters(&[
            "--namespace",
            "a",
            "planner",
            "--footprint",
            "[[1, 1], [-1, 1], [0, -1]]",
        ]);
        assert_eq!(text(value(&planner, "namespace")).1, "a");
        assert_eq!(text(value(&planner, "footprint")).1, "[[1, 1], [-1, 1], [0, -1]]");
        assert_eq!(value(&planner, "occupied").integer_value, 99);
        let screening = value(&planner, "screening");
        assert_eq!((screening.r#type, screening.double_value), (3, 2.0));
        assert_eq!(value(&planner, "avoid_unknown").r#type, 1);
        assert_eq!(value(&planner, "accept").r#type, 0);
        assert!(planner.iter().all(|parameter| !parameter.meaning.is_empty()));
    }

    #[test]
    fn a_parameter_is_not_set_and_the_reason_names_the_option() {
        let of = |name: &str| msg::Parameter { name: name.to_owned(), ..Default::default() };
        let request = SetParametersRequest { parameters: ["robot_radius", "other"].map(of).into() };
        let reply = reply(&parameters(&["planner"]), Service::Set, &request.encode()).unwrap();
        let results = SetParametersResponse::decode(&reply).unwrap().results;
        assert_eq!(results.len(), 2);
        for (result, reason) in
            results.iter().zip(["start it with --robot-radius", "no such parameter"])
        {
            assert!(!result.successful && result.reason.ends_with(reason), "{result:?}");
        }
    }
}
