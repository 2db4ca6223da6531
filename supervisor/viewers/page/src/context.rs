use std::sync::Arc;

use crate::{access::Access, orders::Operator, places::Places, shared::Shared};

pub struct Context {
    pub access: Arc<Access>,
    pub shared: Arc<Shared>,
    pub operator: Operator,
    /// For browsers that watch, and for those that drive.
    pub watching: Places,
    pub driving: Places,
}
