//! Operator requests to inject faults into this process.

use crate::{
    bus::{Bus, BusError, Reader},
    faults::admit,
    samples::{FaultAnswer, FaultKind, FaultSample, name_str},
    topics,
};

#[derive(Clone, Copy, Debug)]
pub(super) struct Asked {
    pub(super) id: u64,
    pub(super) fault: Result<FaultKind, FaultAnswer>,
}

#[derive(Debug)]
pub(super) struct Requests {
    requests: Reader<FaultSample>,
    stage: &'static str,
    simulated: bool,
}

impl Requests {
    pub(super) fn open(bus: &Bus, stage: &'static str, simulated: bool) -> Result<Self, BusError> {
        Ok(Self { requests: bus.reader(&topics::FAULTS)?, stage, simulated })
    }

    pub(super) fn take(&mut self) -> Result<Option<Asked>, BusError> {
        while let Some(request) = self.requests.next_sample()? {
            if name_str(&request.stage) == self.stage {
                return Ok(Some(Asked {
                    id: request.id,
                    fault: admit(&request, self.stage, self.simulated),
                }));
            }
        }
        Ok(None)
    }
}
