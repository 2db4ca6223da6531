//! The definitions of the messages that are written, those of ROS 2 Kilted without comments.

/// Each begins with `MSG: ` and its name.
const ALL: &str = include_str!("definitions.msg");
const RULE: &str =
    "================================================================================\n";

/// The fields of a message, then the messages that it contains.
pub(crate) fn definition([package, message]: [&str; 2]) -> String {
    let mut names = vec![format!("{package}/{message}")];
    let (mut whole, mut at) = (String::new(), 0);
    while let Some(name) = names.get(at).cloned() {
        if at > 0 {
            whole += &format!("{RULE}MSG: {name}\n");
        }
        at += 1;
        let own = |text: &'static str| text.strip_prefix(&name)?.strip_prefix('\n');
        let text = ALL.split("MSG: ").find_map(own).unwrap_or_default();
        whole += text;
        for kind in text.lines().filter_map(|line| line.split([' ', '[']).next()) {
            if kind.contains('/') && !names.iter().any(|name| name == kind) {
                names.push(kind.to_owned());
            }
        }
    }
    whole
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topics::TABLE;

    #[test]
    fn every_message_that_is_written_has_the_definitions_of_all_that_is_in_it() {
        for row in TABLE.iter().filter(|row| row.accepted_by.is_none()) {
            let whole = definition(row.message);
            for part in whole.split(RULE) {
                let fields = part.lines().filter(|line| !line.starts_with("MSG: "));
                assert!(fields.clone().count() > 0, "{whole}");
                for kind in fields.filter_map(|line| line.split([' ', '[']).next()) {
                    let is_there = whole.contains(&format!("{RULE}MSG: {kind}\n"));
                    assert!(is_there || !kind.contains('/'), "{kind} in {whole}");
                }
            }
        }
    }
}
