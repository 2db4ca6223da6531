//! The data that every connection needs.

use std::sync::Arc;

use crate::{access::Access, orders::Operator, places::Places, shared::Shared};

pub(crate) struct Context {
    pub(crate) access: Arc<Access>,
    pub(crate) shared: Arc<Shared>,
    pub(crate) operator: Arc<dyn Operator>,
    /// Places of browsers that may watch, and of those that may drive.
    pub(crate) watching: Places,
    pub(crate) driving: Places,
}
