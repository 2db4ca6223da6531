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
    let mut texts =
        matches.get_raw(id).into_iter().flatten().map(|text| text.to_string_lossy().into_owned());
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
        Ok(SetParametersRequest::decode(payload)?.parameters.iter().map(refuse).collect::<Vec<_>>())
    };
    Ok(match service {
        Service::List => {
            let asked = ListParametersRequest::decode(payload)?.prefixes;
            let names = parameters
                .iter()
                .map(|parameter| parameter.name.clone())
                .filter(|name| asked.is_empty() || asked.contains(name))
                .collect();
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
        let told = |words: &[&str], names: &str| {
            let parameters = parameters(words);
            assert!(parameters.iter().all(|parameter| !parameter.meaning.is_empty()));
            let told = names.split(' ').map(|name| {
                let found = parameters.iter().find(|parameter| parameter.name == name);
                let value = found.map(|parameter| parameter.value.clone()).unwrap_or_default();
                let ParameterValue { r#type, bool_value, integer_value, double_value, .. } = value;
                let (text, list) = (value.string_value, value.string_array_value);
                format!("{type} {bool_value} {integer_value} {double_value} {text:?} {list:?}")
            });
            told.collect::<Vec<_>>()
        };
        let words = ["--accept", "goals,stop", "--domain", "7", "--clock"];
        let bridge = told(&words, "robot domain clock frames accept topics");
        let want = [
            r#"4 false 0 0 "x80" []"#,
            r#"2 false 7 0 "" []"#,
            r#"1 true 0 0 "" []"#,
            r#"4 false 0 0 "all" []"#,
            r#"9 false 0 0 "" ["goals", "stop"]"#,
            r#"0 false 0 0 "" []"#,
        ];
        assert_eq!(bridge, want);
        let words = ["--namespace", "a", "planner", "--footprint", "[[1, 1], [-1, 1], [0, -1]]"];
        let planner = told(&words, "namespace footprint occupied screening avoid_unknown accept");
        let want = [
            r#"4 false 0 0 "a" []"#,
            r#"4 false 0 0 "[[1, 1], [-1, 1], [0, -1]]" []"#,
            r#"2 false 99 0 "" []"#,
            r#"3 false 0 2 "" []"#,
            r#"1 false 0 0 "" []"#,
            r#"0 false 0 0 "" []"#,
        ];
        assert_eq!(planner, want);
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
