//! The data that every connection needs.

use std::sync::Arc;

use crate::{access::Access, orders::Operator, places::Places, shared::Shared};

pub struct Context {
    pub access: Arc<Access>,
    pub shared: Arc<Shared>,
    pub operator: Operator,
    /// Places of browsers that may watch, and of those that may drive.
    pub watching: Places,
    pub driving: Places,
}
