//! Link as a stage: records and publishes the step, telemetry and wire bytes.

use common::{
    mission::Mission,
    outputs::Outputs,
    samples::{
        Direction, DoubtsSample, InfraredSample, PowerSample, RangesHeader, ScanHeader,
        SurroundingsSample, WireHeader,
    },
    shell::{Context, Progress},
    stage::{ForeignState, Stage},
    start::Result,
    topics::{
        BASE_RESPONSE, CONTACT, COUNTS, DOUBTS, IMU_TURN, INFRARED, POWER, RANGES, SCAN,
        SURROUNDINGS, WHEELS, WIRE, WIRE_PIECE,
    },
};

use crate::step::{Effect, Entry, Event, Link, State};

/// Step, and samples that wait until the pipeline is idle.
#[derive(Debug)]
pub struct LinkStage {
    pub(crate) link: Link,
    lasers: Vec<(ScanHeader, usize)>,
    infrared: Option<InfraredSample>,
    power: Option<PowerSample>,
    surroundings: Option<SurroundingsSample>,
    doubts: DoubtsSample,
    /// Unpublished bytes, oldest first.
    wire: Vec<(Progress, WireHeader, Vec<u8>)>,
}

impl LinkStage {
    pub(crate) const fn has_telemetry(&self) -> bool {
        self.infrared.is_some() || self.power.is_some() || self.surroundings.is_some()
    }

    pub(crate) fn longest(&self) -> usize {
        self.lasers.iter().map(|(_, beams)| *beams).fold(WIRE_PIECE, usize::max)
    }

    fn carry(&mut self, at: Progress, bytes: &[u8], machine_ns: u64, direction: Direction) {
        let header =
            WireHeader { machine_ns, direction: direction.into(), ..WireHeader::default() };
        self.wire.push((at, header, bytes.to_vec()));
    }

    /// Publishes an effect's sample. Returns effects for the process.
    fn carry_out(
        &mut self,
        effect: Effect,
        machine_ns: u64,
        out: &mut Outputs,
    ) -> Result<Option<Effect>> {
        match effect {
            Effect::Tick {
                tick,
                time,
                ranges,
                scans,
                turn,
                wheels,
                endless,
                contact,
                response,
            } => {
                out.at = Progress { tick, time };
                out.publish(&CONTACT, contact.map(|contact| *contact))?;
                out.publish(&BASE_RESPONSE, response.map(|response| *response))?;
                for scan in scans {
                    let mut lasers = self.lasers.iter();
                    let header = lasers.find(|(header, _)| header.sensor == scan.row as u64);
                    if let Some((header, _)) = header {
                        out.publish_slice(&SCAN, header.swept(scan.sweep), &scan.beams)?;
                    }
                }
                out.publish(&IMU_TURN, turn)?;
                out.publish_slice(&RANGES, RangesHeader::default(), &ranges)?;
                out.publish(&COUNTS, endless)?;
                out.publish(&WHEELS, wheels)?;
                let doubts = self.link.doubts();
                let is_new = std::mem::replace(&mut self.doubts, doubts) != doubts;
                out.publish(&DOUBTS, is_new.then_some(doubts))?;
            }
            Effect::Infrared(sample) => self.infrared = Some(sample),
            Effect::Power(sample) => self.power = Some(sample),
            Effect::Surroundings(sample) => self.surroundings = Some(sample),
            Effect::Send(bytes) => {
                self.carry(out.at, &bytes, machine_ns, Direction::Sent);
                return Ok(Some(Effect::Send(bytes)));
            }
            other => return Ok(Some(other)),
        }
        Ok(None)
    }

    fn publish_telemetry(&mut self, out: &mut Outputs) -> Result {
        out.publish(&INFRARED, self.infrared.take())?;
        out.publish(&POWER, self.power.take())?;
        out.publish(&SURROUNDINGS, self.surroundings.take())
    }
}

impl Stage for LinkStage {
    type Start = State;
    type Entry<'a> = Entry<'a>;
    /// Effects for the process, in order.
    type Outcome = Vec<Effect>;

    fn new(mission: &Mission) -> Self {
        let lasers = mission.lasers().into_iter();
        Self {
            link: Link::new(mission),
            lasers: lasers.map(|(row, laser)| (ScanHeader::of(row, &laser), laser.beams)).collect(),
            infrared: None,
            power: None,
            surroundings: None,
            doubts: DoubtsSample::default(),
            wire: Vec::new(),
        }
    }

    fn start(&self, context: &mut Context) -> Result<State> {
        Ok(State::new(context.run.clock, context.generation.first_tick))
    }

    fn begin(&mut self, start: State) -> Result<(), ForeignState> {
        self.link.restore(start);
        Ok(())
    }

    fn take_entry(&mut self, entry: Entry<'_>, out: &mut Outputs) -> Result<Vec<Effect>> {
        match entry.event {
            Event::Datagram(bytes) => {
                self.carry(out.at, bytes, entry.machine_ns, Direction::Received);
            }
            Event::Telemetry => self.publish_telemetry(out)?,
            _ => {}
        }
        let effects = self.link.step(entry);
        if !effects.is_empty() {
            out.publish_inputs()?;
        }
        let mut left = Vec::new();
        for effect in effects {
            left.extend(self.carry_out(effect, entry.machine_ns, out)?);
        }
        Ok(left)
    }

    fn publish_rest(&mut self, out: &mut Outputs) -> Result {
        let now = out.at;
        for (at, header, bytes) in self.wire.drain(..) {
            out.at = at;
            for piece in bytes.chunks(WIRE_PIECE) {
                out.publish_quietly(&WIRE, header, piece)?;
            }
        }
        out.at = now;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::mission;

    #[test]
    fn voltages_alone_are_telemetry_and_bytes_on_the_wire_have_the_time_of_the_machine() {
        let mut stage = LinkStage::new(&mission(""));
        stage.power = Some(PowerSample::default());
        assert!(stage.has_telemetry());
        stage.carry(Progress::default(), &[1], 7, Direction::Sent);
        assert_eq!(stage.wire[0].1.machine_ns, 7);
    }
}
