use std::collections::{BTreeMap, VecDeque};

use common::{domain::RobotName, process_usage::Usage, samples::name_str};
use robot_state::{Event, RobotState, Sample};

const MOST_EVENTS: usize = 50;

#[derive(Default)]
pub struct View {
    pub robot: RobotName,
    pub connected: bool,
    pub state: RobotState,
    /// Usage of each stage's process, then of the supervisor's. Empty before the first look.
    pub usage: Vec<Usage>,
    /// Samples per second on each stage's first output. Empty before the first count.
    pub rates_hz: BTreeMap<&'static str, f64>,
    pub chosen: usize,
    /// Deaths and stalls, newest first.
    pub events: VecDeque<Event>,
    pub message: String,
}

impl View {
    pub fn new(robot: RobotName) -> Self {
        Self { robot, ..Self::default() }
    }

    pub fn on_connected(&mut self) {
        let Self { robot, chosen, .. } = std::mem::take(self);
        *self = Self { robot, connected: true, chosen, ..Self::default() };
    }

    pub fn chosen_stage(&self) -> Option<&str> {
        self.state.stages.get(self.chosen).map(|entry| name_str(&entry.stage))
    }

    pub fn choose(&mut self, down: isize) {
        let last = self.state.stages.len().saturating_sub(1);
        self.chosen = self.chosen.saturating_add_signed(down).min(last);
    }

    pub fn apply(&mut self, sample: &Sample) {
        self.state.apply(sample);
        if let Sample::Roster(..) = sample {
            self.choose(0);
        }
        for event in self.state.take_events() {
            if event.is_recovery() {
                self.events.push_front(event);
            }
        }
        self.events.truncate(MOST_EVENTS);
    }
}
