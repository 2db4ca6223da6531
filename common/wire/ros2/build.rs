//! Writes `msg.rs`: a Rust type for each message in `interfaces`, whose folders are a release and a
//! package.
//!
//! A release without a file of an interface uses the next one's; `common` has those of Lyrical and
//! later. One type serves all releases: it has the fields of all, and encodes those of one.

use std::{
    collections::{BTreeMap, BTreeSet},
    env, fs,
    io::{Error, Result},
    path::Path,
};

/// Releases, the oldest first.
const RELEASES: [&str; 5] = ["Humble", "Iron", "Jazzy", "Kilted", "Common"];
/// Messages of each action beside its own three; `@` is its name.
const OF_ACTIONS: [(&str, &str); 5] = [
    ("SendGoalRequest", "unique_identifier_msgs/UUID goal_id\n@Goal goal"),
    ("SendGoalResponse", "bool accepted\nbuiltin_interfaces/Time stamp"),
    ("GetResultRequest", "unique_identifier_msgs/UUID goal_id"),
    ("GetResultResponse", "int8 status\n@Result result"),
    ("FeedbackMessage", "unique_identifier_msgs/UUID goal_id\n@Feedback feedback"),
];
const RULE: &str =
    "================================================================================\n";

/// Type, name and suffix: `=` and the value of a constant, a space and a field's default, or empty.
type Line = [String; 3];
/// Lines of messages by name with package. Each version has its last release; the newest is first.
type Messages = BTreeMap<String, Vec<(&'static str, Vec<Line>)>>;

fn add(messages: &mut Messages, release: &'static str, name: String, text: &str) {
    let lines = text.lines().map(|line| line.split('#').next().unwrap_or_default());
    let lines = lines.map(|line| line.split_whitespace().collect::<Vec<_>>().join(" "));
    let mut lines: Vec<_> =
        lines.filter(|line| !line.is_empty()).map(|line| parse(&line)).collect();
    if fields(&lines).next().is_none() {
        lines.push(parse("uint8 structure_needs_at_least_one_member"));
    }
    messages.entry(name).or_default().push((release, lines));
}

/// Splits a line. A malformed line becomes Rust that the compiler rejects.
fn parse(line: &str) -> Line {
    let line = line.replace(" = ", "=");
    let (kind, rest) = line.split_once(' ').unwrap_or((&line, ""));
    let (name, value) = rest.split_at(rest.find([' ', '=']).unwrap_or(rest.len()));
    [kind, name, value].map(str::to_owned)
}

fn fields(lines: &[Line]) -> impl Iterator<Item = &Line> {
    lines.iter().filter(|[_, _, value]| !value.starts_with('='))
}

/// Adds the definition of a message in the form of recordings: its lines, then those of nested
/// messages not yet included.
fn define(messages: &Messages, name: &str, text: &mut String) {
    let lines = &messages[name][0].1;
    *text += &lines
        .iter()
        .map(|[kind, name, value]| format!("{kind} {name}{value}\n"))
        .collect::<String>();
    for [kind, ..] in lines {
        let part = kind.split('[').next().unwrap_or(kind);
        let head = format!("{RULE}MSG: {part}\n");
        if messages.contains_key(part) && !text.contains(&head) {
            *text += &head;
            define(messages, part, text);
        }
    }
}

fn rust(kind: &str) -> String {
    if let Some((element, count)) = kind.strip_suffix(']').and_then(|kind| kind.split_once('[')) {
        let element = rust(element);
        let is_array = count.parse::<usize>().is_ok();
        return if is_array { format!("[{element}; {count}]") } else { format!("Vec<{element}>") };
    }
    match kind.split("<=").next().unwrap_or(kind) {
        "byte" | "char" => "u8".to_owned(),
        "string" => "String".to_owned(),
        message if let Some((_, name)) = message.split_once('/') => name.to_owned(),
        number => number.replace("uint", "u").replace("int", "i").replace("float", "f"),
    }
}

fn pass([kind, name, _]: &Line) -> String {
    let most = match kind.split_once("<=") {
        Some((_, most)) => most.trim_end_matches(']'),
        None if kind == "string" => "LONGEST_TEXT",
        None => "usize::MAX",
    };
    format!("self.r#{name}.pass(pass, {most})?;")
}

fn write(messages: &Messages, name: &str, layouts: &[(&str, Vec<Line>)]) -> String {
    let (mut members, mut values, mut constants) = <(String, String, String)>::default();
    let mut known = BTreeSet::new();
    for line in layouts.iter().flat_map(|(_, lines)| lines).filter(|line| known.insert(*line)) {
        let kind = rust(&line[0]);
        let [_, name, value] = line;
        let array =
            kind.rsplit_once("; ").map(|(_, count)| format!("[Default::default(); {count}"));
        let default = match value.as_str() {
            "" => array.unwrap_or("Default::default()".to_owned()),
            value => format!("{value} as {kind}"),
        };
        if value.starts_with('=') {
            constants += &format!("pub const {name}: {kind} {value};");
        } else {
            members += &format!("pub r#{name}: {kind},");
            values += &format!("r#{name}: {default},");
        }
    }
    let passes = layouts.iter().rev().map(|(release, lines)| {
        let fields: String = fields(lines).map(pass).collect();
        format!("if pass.release() <= Release::{release} {{ {fields} return Ok(()); }}")
    });
    let passes: String = passes.collect();
    let mut definition = String::new();
    define(messages, name, &mut definition);
    let name = rust(name);
    format!(
        "#[derive(Clone, Debug, PartialEq)] pub struct {name} {{ {members} }}
        impl Default for {name} {{ fn default() -> Self {{ Self {{ {values} }} }} }}
        impl {name} {{ pub const DEFINITION: &str = {definition:?}; {constants} }}
        impl Cdr for {name} {{
            fn pass<P: Pass>(&mut self, pass: &mut P, _: usize) -> Result<(), Malformed> {{ {passes} Ok(()) }}
        }}\n"
    )
}

fn main() -> Result<()> {
    println!("cargo::rerun-if-changed=interfaces");
    let mut messages = Messages::new();
    for release in RELEASES.into_iter().rev() {
        let folder = Path::new("interfaces").join(release.to_lowercase());
        for package in fs::read_dir(&folder).into_iter().flatten() {
            for file in fs::read_dir(package?.path())? {
                let path = file?.path();
                let name = path.with_extension("");
                let name = name.strip_prefix(&folder).map_err(Error::other)?.display().to_string();
                let parts: &[&str] = match path.extension().and_then(|kind| kind.to_str()) {
                    Some("srv") => &["Request", "Response"],
                    Some("action") => &["Goal", "Result", "Feedback"],
                    _ => &[""],
                };
                for (part, text) in parts.iter().zip(fs::read_to_string(&path)?.split("---")) {
                    add(&mut messages, release, name.clone() + part, text);
                }
                for (part, text) in OF_ACTIONS.iter().filter(|_| parts.len() == 3) {
                    add(&mut messages, release, name.clone() + part, &text.replace('@', &name));
                }
            }
        }
    }
    let write = |(name, layouts): (&String, &Vec<_>)| write(&messages, name, layouts);
    let types: String = messages.iter().map(write).collect();
    let each: String = messages.keys().map(|name| format!("$test::<{}>();", rust(name))).collect();
    let all = RELEASES.map(|release| format!("({:?}, Self::{release}),", release.to_lowercase()));
    let releases = RELEASES.join(", ");
    let text = format!(
        "#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)] pub enum Release {{ {releases} }}
        impl Default for Release {{ fn default() -> Self {{ Self::Common }} }}
        impl Release {{ pub const ALL: [(&str, Self); {}] = [{}]; }}
        #[cfg(test)] macro_rules! each_message {{ ($test:ident) => {{ {each} }} }}\n{types}",
        RELEASES.len(),
        all.concat()
    );
    let folder = env::var_os("OUT_DIR").ok_or_else(|| Error::other("cargo names no OUT_DIR"))?;
    fs::write(Path::new(&folder).join("msg.rs"), text)
}
