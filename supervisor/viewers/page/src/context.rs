//! The data that every connection needs.

use std::sync::Arc;

use crate::{access::Access, orders::Operator, shared::Shared};

pub(crate) struct Context {
    pub(crate) access: Arc<Access>,
    pub(crate) shared: Arc<Shared>,
    pub(crate) operator: Arc<dyn Operator>,
}
