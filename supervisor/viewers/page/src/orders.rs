//! Orders from the browser, and the rights for them.

use std::sync::Arc;

use serde::Deserialize;

use crate::access::Role;

const MOST_TARGETS: usize = 16;

/// Function that carries out an order and waits for its confirmation. Returns it, or the reason for
/// a failure.
pub type Operator = Arc<dyn Fn(&Order) -> Result<String, String> + Send + Sync>;

#[derive(Clone, Deserialize)]
pub struct Asked {
    pub id: u64,
    #[serde(flatten)]
    pub order: Order,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "order", rename_all = "snake_case")]
pub enum Order {
    Stop,
    Resume,
    Restart {
        stage: String,
    },
    Kill {
        stage: String,
    },
    GoTo {
        targets: Vec<[f64; 2]>,
    },
    GoBack,
    Hand {
        ahead: f64,
        left: f64,
    },
    /// Shows the field of a target without driving there.
    Preview {
        x: f64,
        y: f64,
    },
}

impl Order {
    /// Returns why a browser of `role` may not give this order to a robot that is `simulated` or
    /// not.
    pub fn refusal(&self, role: Role, simulated: bool) -> Option<&'static str> {
        match self {
            Self::Stop => None,
            _ if role < Role::Drive => Some(
                "this page may only watch and stop; to drive, open it with the `drive` address",
            ),
            Self::Restart { .. } | Self::Kill { .. } if !simulated => {
                Some("the page kills and restarts stages only in simulation")
            }
            Self::GoTo { targets } if targets.is_empty() || targets.len() > MOST_TARGETS => {
                Some("an order has 1 to 16 targets")
            }
            _ => None,
        }
    }
}
