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
    /// The viapoints of a single goal come before it.
    pub goals: Vec<Placed>,
    /// None for the robot's own place.
    pub start: Option<Placed>,
    /// Whether the client is of Nav2 1.5 or later; none if the request does not say.
    pub is_1_5: Option<bool>,
}

/// What the goal of an action has before the planner's name.
#[derive(Clone, Copy)]
enum Layout {
    /// `ComputePathToPose`, up to Kilted.
    One,
    /// `ComputePathToPose` with viapoints, from Nav2 1.5 on.
    OneByWay,
    /// `ComputePathThroughPoses`, up to Jazzy.
    Several,
    /// `ComputePathThroughPoses` with `nav_msgs/Goals`, from Kilted on.
    SeveralWithHeader,
}

/// Reads the goal of `ComputePathToPose`, or of `ComputePathThroughPoses`, in the layout in which its bytes are a whole message.
///
/// # Errors
/// When no layout, or more than one, fits.
pub fn read(payload: &[u8], has_one: bool) -> Result<Asked, String> {
    let layouts = match has_one {
        true => [Layout::OneByWay, Layout::One],
        false => [Layout::SeveralWithHeader, Layout::Several],
    };
    let reader = Reader::new(payload)?;
    match layouts.map(|layout| read_as(reader.clone(), layout)) {
        [Ok(Some(asked)), Err(_) | Ok(None)] | [Err(_) | Ok(None), Ok(Some(asked))] => Ok(asked),
        [Ok(Some(_)), Ok(Some(_))] => {
            Err("a goal that two releases of Nav2 read differently".to_owned())
        }
        _ => Err("no goal of Nav2 from Jazzy to 1.5; is the client of another release?".to_owned()),
    }
}

/// Returns none if bytes are left over.
fn read_as(mut reader: Reader<'_>, layout: Layout) -> Result<Option<Asked>, String> {
    let id = uuid(&mut reader)?;
    if matches!(layout, Layout::SeveralWithHeader) {
        reader.header()?;
    }
    let is_one = matches!(layout, Layout::One | Layout::OneByWay);
    let several = |reader: &mut Reader<'_>| {
        let count = reader.length(MOST_GOALS)?;
        (0..count).map(|_| placed(reader)).collect::<Result<Vec<_>, _>>()
    };
    let goal = is_one.then(|| placed(&mut reader)).transpose()?;
    let mut goals = if is_one { Vec::new() } else { several(&mut reader)? };
    let start = placed(&mut reader)?;
    if matches!(layout, Layout::OneByWay) {
        goals = several(&mut reader)?;
    }
    goals.extend(goal);
    let _planner = reader.text()?;
    let uses_start = reader.u8()?;
    let is_1_5 = match layout {
        Layout::OneByWay => Some(true),
        Layout::One | Layout::Several => Some(false),
        Layout::SeveralWithHeader => None,
    };
    let start = (uses_start == 1).then_some(start);
    Ok((uses_start <= 1 && reader.is_at_end()).then_some(Asked { id, goals, start, is_1_5 }))
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
/// With `has_index`, it has the index of the last goal that the path reaches, as `ComputePathThroughPoses` of Nav2 1.5.
pub fn result(state: u8, outcome: &Outcome, codes: u16, has_index: bool) -> Vec<u8> {
    const ALL_GOALS: i16 = -1;
    let mut writer = Writer::default();
    writer.u8(state);
    write_path(&mut writer, Header(outcome.at_ns, &outcome.frame), &outcome.path);
    if has_index {
        writer.i16(ALL_GOALS);
    }
    writer.time(outcome.took_ns);
    match &outcome.failure {
        Some((reason, text)) => writer.u16(codes + *reason as u16).text(text),
        None => writer.u16(0).text(""),
    };
    writer.take()
}
