//! Edits keys of a mission file and keeps its comments.

use console::failure::Result;
use toml_edit::{DocumentMut, Item, Table, value};

/// Sets `keys`, dotted paths and values, in the mission file `text`. Rows of `robot.sensor` go by
/// name.
///
/// # Errors
/// The text is not TOML, or the parent of a key is not a table.
pub fn with_keys(text: &str, keys: &[&(String, String)]) -> Result<String> {
    let mut document: DocumentMut = text.parse()?;
    for (path, new) in keys {
        let words: Vec<&str> = path.split('.').collect();
        let Some((last, tables)) = words.split_last() else { continue };
        let refused = || format!("cannot write {path}: its parent is not a table");
        let mut table = document.as_table_mut() as &mut dyn toml_edit::TableLike;
        let mut words = tables.iter();
        while let Some(word) = words.next() {
            let item = table.entry(word).or_insert_with(|| Item::Table(Table::new()));
            table = match item {
                Item::ArrayOfTables(rows) => {
                    let name = words.next().copied().unwrap_or_default();
                    let named =
                        |row: &&mut Table| row.get("name").and_then(Item::as_str) == Some(name);
                    rows.iter_mut().find(named).ok_or_else(refused)?
                }
                item => item.as_table_like_mut().ok_or_else(refused)?,
            };
        }
        let new = match (new.parse::<i64>(), new.parse::<f64>(), new.parse::<bool>()) {
            (_, _, Ok(flag)) => value(flag),
            (Ok(whole), ..) if matches!(*last, "channel") => value(whole),
            (_, Ok(number), _) => value(number),
            _ => value(new.as_str()),
        };
        table.insert(last, new);
    }
    Ok(document.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn found_keys_are_written_where_they_belong_and_comments_stay() {
        let text = "target = [1, 0] # there\n[robot]\nrate_hz = 10.0 # mine\n[[robot.sensor]]\nname = \"a\"\n[[robot.sensor]]\nname = \"b\" # left\nbearing_deg = 3.0\n";
        let keys = [
            ("robot.track_m", "0.31"),
            ("robot.response.delay_s", "0.2"),
            ("robot.sensor.b.bearing_deg", "90"),
            ("robot.left.reversed", "true"),
        ]
        .map(|(key, value)| (key.to_owned(), value.to_owned()));
        let written = with_keys(text, &keys.iter().collect::<Vec<_>>()).unwrap();
        for kept in [
            "# there",
            "# mine",
            "# left",
            "track_m = 0.31",
            "[robot.response]\ndelay_s = 0.2",
            "bearing_deg = 90.0",
        ] {
            assert!(written.contains(kept), "{kept}: {written}");
        }
        let parsed: toml::Table = written.parse().unwrap();
        assert_eq!(parsed["robot"]["left"]["reversed"].as_bool(), Some(true));
        let missing = ("robot.sensor.c.bearing_deg".to_owned(), "1".to_owned());
        assert!(with_keys(text, &[&missing]).is_err());
    }
}
