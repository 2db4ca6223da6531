//! Samples of external sources that a tick takes with its wheels.

use common::{
    bus::{BusError, Reader, Stamped},
    found_response::if_there,
    readers,
    samples::{CountsSample, FixSample, PlaceSample, TurnSample},
    stage::Further,
    topics::{COUNTS, FIX, IMU_TURN, PLACE, SCAN_FIX, TURN},
};
use serde::{Deserialize, Serialize};

/// Limits per tick; the rest waits for the next.
const MOST_FIXES: usize = 16;
const MOST_TURNS: usize = 128;
const MOST_COUNTS: usize = 128;

#[derive(Debug, Default, Serialize, Deserialize)]
pub struct Sources {
    pub fixes: Vec<FixSample>,
    pub turns: Vec<TurnSample>,
    /// Older recordings have none.
    #[serde(deserialize_with = "if_there")]
    pub counts: Vec<CountsSample>,
    #[serde(deserialize_with = "if_there")]
    pub place: Option<PlaceSample>,
}

readers! {
    pub struct SourceReaders {
        feedback {
            fixes: Reader<FixSample> = FIX,
            scan_fixes: Reader<FixSample> = SCAN_FIX,
            turns: Reader<TurnSample> = TURN,
            imu_turns: Reader<TurnSample> = IMU_TURN,
            counts: Reader<CountsSample> = COUNTS,
            places: Reader<PlaceSample> = PLACE,
        }
    }
}

impl Further for Sources {
    type Readers = SourceReaders;

    fn take_samples(readers: &mut SourceReaders) -> Result<Self, BusError> {
        let mut fixes = some(&mut readers.fixes, MOST_FIXES)?;
        fixes.extend(some(&mut readers.scan_fixes, MOST_FIXES)?);
        let outside = some(&mut readers.turns, MOST_TURNS)?;
        let own = some(&mut readers.imu_turns, MOST_TURNS)?;
        let counts = some(&mut readers.counts, MOST_COUNTS)?;
        let place = readers.places.newest()?;
        // Sequences of two gyros do not continue each other.
        Ok(Self { fixes, turns: if own.is_empty() { outside } else { own }, counts, place })
    }
}

fn some<H: Stamped>(reader: &mut Reader<H>, most: usize) -> Result<Vec<H>, BusError> {
    std::iter::from_fn(|| reader.next_sample().transpose()).take(most).collect()
}
