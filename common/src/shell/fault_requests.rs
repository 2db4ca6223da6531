//! Operator requests to inject faults into this process.

use crate::{
    bus::{Bus, BusError, Reader},
    faults::admit,
    samples::{FaultAnswer, FaultKind, FaultSample, name_str},
    topics,
};

/// Number of a request, and its fault or the refusal.
pub(super) type Asked = (u64, Result<FaultKind, FaultAnswer>);

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
                return Ok(Some((request.id, admit(&request, self.stage, self.simulated))));
            }
        }
        Ok(None)
    }
}
