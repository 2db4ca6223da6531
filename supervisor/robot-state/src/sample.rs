//! THE table of what is read of a robot, and its readers.

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
        /// A sample of one of [`TOPICS`]: a struct, or a header and its slice.
        #[allow(clippy::large_enum_variant, reason = "one at a time is held")]
        #[derive(Clone, Debug, PartialEq)]
        pub enum Sample { $($name($($part),+)),* }

        /// The topics that are read. A sample of the link ends a tick, so it is read last.
        pub static TOPICS: &[&dyn AnyTopic] = &[$(&topics::$topic),*];

        impl Sample {
            /// The sample of `topic` that a recording has as `message`; none if the topic is not read, or the message does not match it.
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
    Roster(RosterHeader, Vec<RosterEntry>): ROSTER by slice,
    Death(DeathSample): DEATHS by one,
    Directive(DirectiveSample): DIRECTIVE by one,
    Stall(StallSample): STALLS by one,
    Order(RequestSample): ORDERS by one,
    Fault(FaultSample): FAULTS by one,
    Complaint(ComplaintSample): COMPLAINTS by one,
    Link(LinkSample): LINK by one,
}

struct OneTopic {
    spec: &'static Spec,
    reader: Box<dyn AnyReader>,
    /// The newest generation of its writer.
    generation: u32,
}

pub struct Feed {
    readers: Vec<OneTopic>,
    message: Vec<u8>,
}

impl Feed {
    /// Read some of [`TOPICS`] on `bus`, in this order.
    ///
    /// # Errors
    /// When a topic is missing or has no place left for a reader.
    pub fn open(bus: &Bus, topics: &[&'static dyn AnyTopic]) -> Result<Self, BusError> {
        let open = |topic: &&'static dyn AnyTopic| {
            Ok(OneTopic { spec: topic.spec(), reader: topic.recorder_reader(bus)?, generation: 0 })
        };
        let readers = topics.iter().map(open).collect::<Result<_, BusError>>()?;
        Ok(Self { readers, message: Vec::new() })
    }

    /// Give `each` all samples that were published since the last time.
    ///
    /// # Errors
    /// When the connection to a writer breaks.
    pub fn read(&mut self, each: &mut dyn FnMut(Sample)) -> Result<(), BusError> {
        for OneTopic { spec, reader, generation } in &mut self.readers {
            while let Some(stamp) = reader.next_message(&mut self.message)? {
                // A sample of an older generation may come behind those of the next one.
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
