//! The data that every connection needs.

use std::sync::Arc;

use super::{access::Access, orders::Operator, shared::Shared};

pub(super) struct Context {
    pub(super) access: Arc<Access>,
    pub(super) shared: Arc<Shared>,
    pub(super) operator: Arc<dyn Operator>,
}
