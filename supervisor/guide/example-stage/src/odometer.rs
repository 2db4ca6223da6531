//! The odometer: poses to metres driven and seconds in motion.

use common::{
    bus::Topic,
    clock::MissionTime,
    mission::Mission,
    samples::PoseSample,
    stage::{Answer, Answering, ForeignState},
    topics::POSE,
    wiring::Persists,
};

use crate::rows::{DISTANCE, DistanceSample};

/// Slower than this the robot stands, m/s: encoder noise.
const STANDS_M_S: f64 = 0.005;

/// Its state is all it has: tick, time and place of the newest pose, and the sums.
#[derive(Default)]
pub struct Odometer(State);

type State = (Option<(u64, MissionTime, [f64; 2])>, f64, f64);

impl Answering for Odometer {
    type State = State;
    type In = PoseSample;
    type Out = DistanceSample;
    type Further = ();
    const NAME: &'static str = "odometer";
    const INPUT: &'static Topic<PoseSample> = &POSE;
    const OUTPUT: &'static Topic<DistanceSample> = &DISTANCE;
    const PERSISTS: Persists = Persists::State(128);

    fn new(_: &Mission) -> Self {
        Self::default()
    }

    fn state(&self) -> &State {
        &self.0
    }

    fn restore(&mut self, state: State) -> Result<(), ForeignState> {
        self.0 = state;
        Ok(())
    }

    fn answer(&mut self, pose: &PoseSample, (): &(), now: MissionTime) -> Answer<DistanceSample> {
        let (last, driven_m, moving_s) = &mut self.0;
        let here = [pose.x_m, pose.y_m];
        // A tick that is given again adds nothing.
        if let Some((_, time, there)) = last.filter(|(tick, ..)| *tick != pose.stamp.tick) {
            let way_m = (here[0] - there[0]).hypot(here[1] - there[1]);
            let elapsed_s = now.since(time).as_secs_f64();
            *driven_m += way_m;
            *moving_s += if way_m > STANDS_M_S * elapsed_s { elapsed_s } else { 0.0 };
        }
        *last = Some((pose.stamp.tick, now, here));
        DistanceSample { driven_m: *driven_m, moving_s: *moving_s, ..Default::default() }.into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use common::samples::Stamp;

    /// The sums after the robot is at x metres, two ticks a second.
    fn step(odometer: &mut Odometer, tick: u64, x_m: f64) -> (f64, f64) {
        let stamp = Stamp { tick, stamp_ns: tick * 500_000_000, ..Stamp::default() };
        let pose = PoseSample { stamp, x_m, ..PoseSample::default() };
        let sums = odometer.answer(&pose, &(), stamp.time()).sample;
        (sums.driven_m, sums.moving_s)
    }

    #[test]
    fn forth_and_back_adds_up_standing_and_a_tick_given_twice_add_nothing() {
        let mut odometer = Odometer::default();
        let steps = [(0, 1.0), (1, 1.5), (2, 1.5), (3, 1.25), (3, 1.25)];
        let sums = steps.map(|(tick, x_m)| step(&mut odometer, tick, x_m));
        assert_eq!(sums, [(0.0, 0.0), (0.5, 0.5), (0.5, 0.5), (0.75, 1.0), (0.75, 1.0)]);
    }

    #[test]
    fn the_next_process_goes_on_where_the_last_one_was_killed() {
        let (mut first, mut second) = (Odometer::default(), Odometer::default());
        step(&mut first, 0, 0.0);
        step(&mut first, 1, 0.5);
        second.restore(*first.state()).unwrap();
        assert_eq!(step(&mut second, 2, 0.75), (0.75, 1.0));
    }
}
