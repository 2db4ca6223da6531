//! The methods of the experiments.

use common::mission::Realism;

use crate::setting::{HARMONIC, Setting};

/// Share of the time of radio outage except with laboratory realism. The paper's link fades; the paper gives no number.
const OUTAGE_SHARE: f64 = 0.2;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// The paper's method, with its dead reckoning, (21).
    Paper,
    /// The default method.
    Evidential,
}

impl Method {
    pub const ALL: [Self; 2] = [Self::Paper, Self::Evidential];

    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Evidential => "evidential",
        }
    }

    /// The setting of the method for every mission.
    pub fn setting(self, realism: Realism) -> Setting {
        let own: &[&str] = match self {
            Self::Paper => &["method='paper'", "dead_reckoning.integration='euler'"],
            Self::Evidential => &["method='evidential'"],
        };
        let mut set: Vec<String> = own.iter().map(|&text| text.to_owned()).collect();
        if realism != Realism::Laboratory {
            set.push(format!("simulation.realism='{}'", realism.as_str()));
            set.push(format!("simulation.radio.outage_share={OUTAGE_SHARE}"));
        }
        Setting { name: self.as_str().to_owned(), planner: HARMONIC.to_owned(), set }
    }
}
