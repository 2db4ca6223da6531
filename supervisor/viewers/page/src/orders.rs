//! The orders that an operator may give in the browser, and their execution.

use serde::Deserialize;

use crate::access::Role;

const MOST_TARGETS: usize = 16;

/// Carries out orders, and waits until each is confirmed. The result is the confirmation, or the reason why it was not
/// carried out.
pub trait Operator: Send + Sync + 'static {
    fn stop(&self) -> Result<String, String>;
    /// Let a stopped robot go on.
    fn resume(&self) -> Result<String, String>;
    fn restart(&self, stage: &str) -> Result<String, String>;
    fn kill(&self, stage: &str) -> Result<String, String>;
    /// Go to these places, one after the other; metres in the mission frame.
    fn go_to(&self, targets: &[[f64; 2]]) -> Result<String, String>;
    /// Go back to the place where the run began.
    fn go_back(&self) -> Result<String, String>;
    /// Push the stick, ahead and to the left, in shares of full speed. The robot stands soon unless this is asked again.
    fn hand(&self, stick: [f64; 2]) -> Result<String, String>;
}

/// A message of a browser that has shown its token.
#[derive(Clone, Deserialize)]
pub struct Asked {
    /// The number of the message, which the answer has, too.
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
    /// Show the field of a target, without going there.
    Preview {
        x: f64,
        y: f64,
    },
}

impl Order {
    /// The reason why a browser of `role` may not give this order to a robot that is `simulated` or not.
    pub fn refusal(&self, role: Role, simulated: bool) -> Option<&'static str> {
        match self {
            Self::Stop => None,
            _ if role < Role::Drive => {
                Some("this page may watch and stop; open it with the address for driving")
            }
            Self::Restart { .. } | Self::Kill { .. } if !simulated => {
                Some("stages are killed and restarted here only in simulation")
            }
            Self::GoTo { targets } if targets.is_empty() || targets.len() > MOST_TARGETS => {
                Some("an order has 1 to 16 targets")
            }
            _ => None,
        }
    }

    pub fn perform(&self, operator: &dyn Operator) -> Result<String, String> {
        match self {
            Self::Stop => operator.stop(),
            Self::Resume => operator.resume(),
            Self::Restart { stage } => operator.restart(stage),
            Self::Kill { stage } => operator.kill(stage),
            Self::GoTo { targets } => operator.go_to(targets),
            Self::GoBack => operator.go_back(),
            Self::Hand { ahead, left } => operator.hand([*ahead, *left]),
            Self::Preview { .. } => Ok(String::new()),
        }
    }
}
