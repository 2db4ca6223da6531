//! Single table of the topics read, and its readers.

use common::{
    bus::{AnyReader, Bus, BusError, decode_sample, decode_slice},
    clock::MissionTime,
    samples::{
        CommandSample, ComplaintSample, DeathSample, DirectiveSample, FaultSample, FieldCell,
        FieldHeader, FollowingSample, GridHeader, GuidanceSample, LinkSample, MirrorSample,
        PoseSample, PowerSample, RangeReading, RangesHeader, RequestSample, RosterEntry,
        RosterHeader, ScanHeader, StallSample, TargetSample, WheelSample,
    },
    topics::{self, AnyTopic, OPERATOR, Spec},
};

macro_rules! samples {
    ($($name:ident($($part:ty),+): $topic:ident by $decode:ident,)*) => {
        /// Sample of one of [`TOPICS`].
        #[allow(clippy::large_enum_variant, reason = "one at a time is held")]
        #[derive(Clone, Debug, PartialEq)]
        pub enum Sample { $($name($($part),+)),* }

        /// Topics to read. A link sample ends a tick, so the link follows the tick's topics. The
        /// supervisor repeats trouble to a new reader of the roster, so the roster comes last.
        pub static TOPICS: &[&dyn AnyTopic] = &[$(&topics::$topic),*];

        impl Sample {
            /// Returns the sample of `topic` recorded as `message`; `None` if unread or malformed.
            pub fn decoded(topic: &str, message: &[u8]) -> Option<Self> {
                $(if topic == topics::$topic.spec().name {
                    return samples!(@$decode $name, message);
                })*
                None
            }

            pub const fn time(&self) -> MissionTime {
                match self { $(Self::$name(sample, ..) => sample.stamp.time()),* }
            }
        }
    };
    (@one $name:ident, $message:ident) => { decode_sample($message).map(Self::$name) };
    (@slice $name:ident, $message:ident) => {
        decode_slice($message).map(|(header, elements)| Self::$name(header, elements))
    };
}

samples! {
    Pose(PoseSample): POSE by one,
    Ranges(RangesHeader, Vec<RangeReading>): RANGES by slice,
    Scan(ScanHeader, Vec<f32>): SCAN by slice,
    Wheels(WheelSample): WHEELS by one,
    Command(CommandSample): COMMAND by one,
    Guidance(GuidanceSample): GUIDANCE by one,
    Target(TargetSample): TARGET by one,
    Following(FollowingSample): FOLLOWING by one,
    Power(PowerSample): POWER by one,
    Grid(GridHeader, Vec<u8>): GRID by slice,
    Field(FieldHeader, Vec<FieldCell>): FIELD by slice,
    Mirror(MirrorSample): MIRROR by one,
    Death(DeathSample): DEATHS by one,
    Directive(DirectiveSample): DIRECTIVE by one,
    Stall(StallSample): STALLS by one,
    Order(RequestSample): ORDERS by one,
    Fault(FaultSample): FAULTS by one,
    Complaint(ComplaintSample): COMPLAINTS by one,
    Link(LinkSample): LINK by one,
    Roster(RosterHeader, Vec<RosterEntry>): ROSTER by slice,
}

struct OneTopic {
    spec: &'static Spec,
    reader: Box<dyn AnyReader>,
    generation: u32,
}

pub struct Feed {
    readers: Vec<OneTopic>,
    message: Vec<u8>,
}

impl Feed {
    /// Opens readers of some of [`TOPICS`] on `bus`, in this order.
    ///
    /// # Errors
    /// Fails if a topic is missing or has no place left for a reader.
    pub fn open(bus: &Bus, topics: &[&'static dyn AnyTopic]) -> Result<Self, BusError> {
        let open = |topic: &&'static dyn AnyTopic| {
            Ok(OneTopic { spec: topic.spec(), reader: topic.recorder_reader(bus)?, generation: 0 })
        };
        let readers = topics.iter().map(open).collect::<Result<_, BusError>>()?;
        Ok(Self { readers, message: Vec::new() })
    }

    /// Passes all new samples to `each`.
    ///
    /// # Errors
    /// Fails if the connection to a writer breaks.
    pub fn read(&mut self, each: &mut dyn FnMut(Sample)) -> Result<(), BusError> {
        for OneTopic { spec, reader, generation } in &mut self.readers {
            while let Some(stamp) = reader.next_message(&mut self.message)? {
                // An older generation's sample may come after the next one's.
                if spec.writer != OPERATOR && stamp.generation < *generation {
                    continue;
                }
                *generation = stamp.generation;
                if let Some(sample) = Sample::decoded(spec.name, &self.message) {
                    each(sample);
                }
            }
        }
        Ok(())
    }
}
