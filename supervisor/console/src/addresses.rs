//! Default addresses at which viewers listen.

pub const PAGE: &str = "127.0.0.1:8080";
pub const FOXGLOVE: &str = "127.0.0.1:8765";
