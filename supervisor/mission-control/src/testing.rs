use common::mission::Mission;

pub(crate) fn mission(text: &str) -> Mission {
    Mission::parse(text, "test.toml").unwrap()
}
