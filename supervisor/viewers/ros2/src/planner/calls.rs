//! The calls of Nav2's two actions: a goal in, the result out. Pure.

use glam::DAffine2;
use ros2::{
    cdr::{Malformed, Reader, Writer},
    parts::Pose,
};

use super::planning::Failure;
use crate::{
    goals::{Uuid, uuid},
    messages::{Header, write_path},
};

const MOST_GOALS: usize = 256;

/// A pose in the frame of this name; in that of the map without one.
pub type Placed = (String, DAffine2);

pub struct Asked {
    pub id: Uuid,
    pub goals: Vec<Placed>,
    /// None for the robot's own place.
    pub start: Option<Placed>,
}

/// The goal of `ComputePathToPose`, or of `ComputePathThroughPoses`. The error says why the payload is none.
pub fn read(payload: &[u8], has_one: bool) -> Result<Asked, String> {
    let mut reader = Reader::new(payload)?;
    let id = uuid(&mut reader)?;
    let ask = |mut reader: Reader<'_>, has_header: bool| {
        if has_header {
            reader.header()?;
        }
        let count = if has_one { 1 } else { reader.length(MOST_GOALS)? };
        let goals = (0..count).map(|_| placed(&mut reader)).collect::<Result<_, _>>()?;
        let start = placed(&mut reader)?;
        let _planner = reader.text()?;
        let uses_start = reader.u8()? != 0;
        Ok::<_, Malformed>(Asked { id, goals, start: uses_start.then_some(start) })
    };
    // Since Kilted a list of goals has a header.
    let asked = match has_one {
        true => ask(reader, false),
        false => ask(reader.clone(), true).or_else(|_| ask(reader, false)),
    };
    Ok(asked?)
}

fn placed(reader: &mut Reader<'_>) -> Result<Placed, Malformed> {
    let (_stamp_ns, frame) = reader.header()?;
    let (at, heading) = reader.pose()?;
    let pose = DAffine2::from_angle_translation(heading.unwrap_or_default(), at.into());
    Ok((frame.to_owned(), pose))
}

#[derive(Debug, Default)]
pub struct Outcome {
    pub frame: String,
    pub at_ns: u64,
    pub took_ns: u64,
    pub path: Vec<Pose>,
    pub failure: Option<Failure>,
}

/// The reply to a request for the result of a goal with this state; Nav2's error codes of the action begin at `codes`.
pub fn result(state: u8, outcome: &Outcome, codes: u16) -> Vec<u8> {
    let mut writer = Writer::default();
    writer.u8(state);
    write_path(&mut writer, Header(outcome.at_ns, &outcome.frame), &outcome.path);
    writer.time(outcome.took_ns);
    match &outcome.failure {
        Some((reason, text)) => writer.u16(codes + *reason as u16).text(text),
        None => writer.u16(0).text(""),
    };
    writer.take()
}
