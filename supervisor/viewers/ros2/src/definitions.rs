//! The definitions of the messages that are written, those of ROS 2 Kilted without comments.

/// Each begins with `MSG: ` and its name.
const ALL: &str = include_str!("definitions.msg");
const RULE: &str =
    "================================================================================\n";

/// Add to `text` the fields of the message `name`, then the messages in it that are not there yet.
pub fn define(name: &str, text: &mut String) {
    let own = |part: &'static str| part.strip_prefix(name)?.strip_prefix('\n');
    let fields = ALL.split("MSG: ").find_map(own).unwrap_or_default();
    *text += fields;
    for kind in fields.lines().filter_map(|line| line.split([' ', '[']).next()) {
        let head = format!("{RULE}MSG: {kind}\n");
        if kind.contains('/') && !text.contains(&head) {
            *text += &head;
            define(kind, text);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topics::TABLE;

    #[test]
    fn every_message_that_is_written_has_the_definitions_of_all_that_is_in_it() {
        for row in TABLE.iter().filter(|row| row.accepted_by.is_none()) {
            let mut whole = String::new();
            define(&row.message.join("/"), &mut whole);
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
