//! Identified response of the base, as planner and controller take it.

use serde::{Deserialize, Deserializer, Serialize};

use crate::{
    bus::{BusError, Reader},
    mission::Mission,
    readers,
    samples::BaseResponseSample,
    stage::Further,
    topics::BASE_RESPONSE,
};

/// Newest response, if any: dead time, seconds, and acceleration, m/s^2.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FoundResponse {
    /// Older recordings have none.
    #[serde(deserialize_with = "if_there")]
    response: Option<[f64; 2]>,
}

impl FoundResponse {
    /// Returns `None` if it does not differ; `stated` is the original mission.
    pub fn changed(&mut self, newer: &Self, stated: &Mission) -> Option<Mission> {
        let [dead_time_s, acceleration] = newer.response.filter(|_| newer != self)?;
        *self = *newer;
        stated.with_response(dead_time_s, acceleration)
    }
}

impl From<BaseResponseSample> for FoundResponse {
    fn from(sample: BaseResponseSample) -> Self {
        Self { response: Some([sample.dead_time_s, sample.acceleration_m_s2]) }
    }
}

readers! {
    pub struct FoundResponseReader {
        feedback {
            samples: Reader<BaseResponseSample> = BASE_RESPONSE,
        }
    }
}

impl Further for FoundResponse {
    type Readers = FoundResponseReader;

    fn take_samples(readers: &mut FoundResponseReader) -> Result<Self, BusError> {
        Ok(readers.samples.newest()?.map(Self::from).unwrap_or_default())
    }
}

/// Deserializes the last part of an encoding; the default if an earlier version ends before it.
pub fn if_there<'a, T, D>(from: D) -> Result<T, D::Error>
where
    T: Deserialize<'a> + Default,
    D: Deserializer<'a>,
{
    Ok(T::deserialize(from).unwrap_or_default())
}
