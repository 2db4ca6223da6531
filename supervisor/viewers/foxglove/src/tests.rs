//! Tests of the messages for viewers, decoded by Foxglove's SDK.
#![allow(clippy::unwrap_used)]

use std::{
    collections::BTreeMap,
    f64::consts::FRAC_PI_2,
    io::{Read as _, Write as _},
    net::TcpStream,
    time::Duration,
};

use common::{
    bus::{encode_sample, encode_slice},
    grid::{CellState, Part},
    mission::Mission,
    samples::*,
};
use foxglove::{
    Decode, Encode,
    messages::{
        FrameTransforms, Grid, LaserScan, Log, Odometry, Pose, PoseInFrame, SceneUpdate,
        packed_element_field::NumericType,
    },
};
use recording::viewers::{self, Drawn};

use crate::{LAYOUT, live::Live};

/// Messages by topic.
type Sent = BTreeMap<String, Vec<u8>>;

fn mission(robot: &str) -> Mission {
    let text = format!("target = [4, 0]\nrobot.model = '{robot}'");
    Mission::parse(&text, "m.toml").unwrap()
}

/// Returns the messages for a robot at (1, 2) that senses an obstacle at 0.5 m.
fn sent() -> Sent {
    let mut sent = Sent::new();
    let mut sink = |topic: &str, message: &[u8]| {
        sent.insert(topic.to_owned(), message.to_vec());
    };
    let mission = mission("x80");
    let mut drawn = Drawn::new(Some(mission.clone()));
    let pose = PoseSample {
        x_m: 1.0,
        y_m: 2.0,
        heading_rad: FRAC_PI_2,
        v_m_s: 0.5,
        covariance: [0.04, 0.0, 0.0, 0.01, 0.0, 0.0],
        ..PoseSample::default()
    };
    let reading = RangeReading {
        range_m: 0.5,
        status: RangeStatus::Measured.into(),
        ..RangeReading::default()
    };
    let mut say = |topic: &str, encode: &mut dyn FnMut(&mut Vec<u8>)| {
        let mut message = Vec::new();
        encode(&mut message);
        drawn.message(topic, &message, 7_000_000_009, &mut sink);
    };
    say("pose", &mut |to| encode_sample(&pose, to));
    say("ranges", &mut |to| encode_slice(&RangesHeader::default(), &[reading], to));
    let frame = mission.grid_frame();
    let mut header = GridHeader { part: Part::whole(frame, 1), ..GridHeader::default() };
    let mover = Mover { x_m: 3.0, vy_m_s: 0.5, radius_m: 0.25, doubt_m: 0.1, ..Mover::default() };
    (header.movers[0], header.mover_count) = (mover, 1);
    let cells = vec![CellState::Sensed as u8; frame.area()];
    say("grid", &mut |to| encode_slice(&header, &cells, to));
    let log = viewers::log("mapper", "12.5  WARN missed a grid version", 7_000_000_009);
    sink(viewers::LOG, &log);
    sent
}

fn decoded<M: Decode>(sent: &Sent, topic: &str) -> M {
    M::decode(&sent[topic][..]).unwrap()
}

#[test]
fn schemas_are_those_of_the_sdk() {
    let known = [
        FrameTransforms::get_schema(),
        PoseInFrame::get_schema(),
        Odometry::get_schema(),
        Grid::get_schema(),
        SceneUpdate::get_schema(),
        Log::get_schema(),
        LaserScan::get_schema(),
    ];
    for channel in viewers::channels(Some(&mission("x80"))) {
        let schema = known.iter().flatten().find(|schema| schema.name == channel.schema).unwrap();
        assert_eq!((&*schema.encoding, &*schema.data), ("protobuf", channel.descriptors));
    }
}

fn is_to_the_left(pose: Option<Pose>) -> bool {
    let turned = pose.unwrap().orientation.unwrap();
    (2.0 * turned.z.atan2(turned.w) - FRAC_PI_2).abs() < 1e-12
}

#[test]
fn messages_have_what_viewers_draw() {
    let sent = sent();
    let pose: PoseInFrame = decoded(&sent, "foxglove/pose");
    let stamp = pose.timestamp.unwrap();
    assert_eq!((stamp.sec(), stamp.nsec(), &*pose.frame_id), (7, 9, "map"));
    let at = pose.pose.unwrap().position.unwrap();
    assert_eq!((at.x, at.y, at.z), (1.0, 2.0, 0.0));
    assert!(is_to_the_left(pose.pose));
    let odometry: Odometry = decoded(&sent, "foxglove/odometry");
    assert_eq!((odometry.pose_covariance.len(), odometry.pose_covariance[0]), (36, 0.04));
    assert_eq!(
        (odometry.velocity_covariance.len(), odometry.linear_velocity.unwrap().x),
        (36, 0.5)
    );
    assert_eq!(odometry.body_frame_id, "base_link");
    let mounts: FrameTransforms = decoded(&sent, "foxglove/transforms");
    let sensors: Vec<_> =
        mission("x80").sensor_table().into_iter().map(|sensor| sensor.name).collect();
    let frames = mounts.transforms.iter().map(|mount| mount.child_frame_id.clone());
    assert_eq!(frames.collect::<Vec<_>>(), sensors);
    let scan: LaserScan = decoded(&sent, &format!("foxglove/scan/{}", sensors[0]));
    assert_eq!((scan.ranges, scan.frame_id), (vec![0.5; 9], sensors[0].clone()));
    assert!(scan.end_angle > 0.0 && scan.start_angle == -scan.end_angle);
    let grid: Grid = decoded(&sent, "foxglove/grid");
    assert_eq!(grid.data.len() as u32, grid.column_count * grid.row_stride);
    assert_eq!((grid.cell_stride, &grid.data[..5]), (5, &[1, 225, 120, 20, 255][..]));
    let fields = grid.fields.iter().map(|field| (&*field.name, field.offset, field.r#type));
    let uint8 = NumericType::Uint8 as i32;
    let names = ["state", "red", "green", "blue", "alpha"];
    let wanted = (0..).zip(names).map(|(offset, name)| (name, offset, uint8));
    assert_eq!(fields.collect::<Vec<_>>(), wanted.collect::<Vec<_>>());
    let scene: SceneUpdate = decoded(&sent, "foxglove/scene");
    let ids: Vec<_> = scene.entities.iter().map(|entity| &*entity.id).collect();
    assert_eq!(ids, ["trajectory", "targets", "robot"]);
    assert_eq!(scene.entities[0].lines[0].points[0].y, 2.0);
    assert_eq!(scene.entities[1].cylinders[0].pose.unwrap().position.unwrap().x, 4.0);
    assert_eq!(scene.entities[2].cylinders[0].size.unwrap().x, 0.8);
    assert_eq!(scene.entities[2].cylinders[0].color.unwrap().a, 0.4);
    let movers: SceneUpdate = decoded(&sent, "foxglove/movers");
    let [mover] = &movers.entities[..] else { panic!("{movers:?}") };
    assert!(is_to_the_left(mover.arrows[0].pose));
    assert_eq!(mover.arrows[0].shaft_length + mover.arrows[0].head_length, 0.5, "of 1 s");
    let widths = mover.cylinders.iter().map(|disc| disc.size.unwrap().x);
    assert!(widths.zip([0.5, 0.9]).all(|(width, wanted)| (width - wanted).abs() < 1e-6));
    assert_eq!(
        (&*mover.texts[0].text, mover.cylinders[0].pose.unwrap().position.unwrap().x),
        ("0.5 m/s", 3.0)
    );
    let log: Log = decoded(&sent, "log");
    assert_eq!((log.level, &*log.name), (3, "mapper"));
    assert_eq!(log.message, "12.5  WARN missed a grid version");
}

#[test]
fn a_web_page_of_another_origin_is_refused_and_a_viewer_is_served() {
    let own = ["https://lichtblick.example".to_owned()];
    let robot = "foxglove-test".parse().unwrap();
    let (_live, address) = Live::open(&robot, "127.0.0.1:0".parse().unwrap(), &own).unwrap();
    for (origin, status) in [
        ("", "101"),
        ("Origin: https://lichtblick.example\r\n", "101"),
        ("Origin: https://evil.example\r\n", "403"),
        ("origin:null\r\n", "403"),
        ("Origin: https://lichtblick.example\r\nOrigin: https://evil.example\r\n", "403"),
    ] {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
        let head = "GET / HTTP/1.1\r\nHost: x\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: foxglove.sdk.v1\r\n";
        stream.write_all(format!("{head}{origin}\r\n").as_bytes()).unwrap();
        let mut answer = [0; 12];
        stream.read_exact(&mut answer).unwrap();
        assert_eq!(std::str::from_utf8(&answer[9..]).unwrap(), status, "{origin}");
    }
}

#[test]
fn the_layout_shows_topics_that_there_are() {
    let channels = viewers::channels(Some(&mission("kobuki")));
    let channels = channels.into_iter().map(|channel| channel.topic);
    let bus = common::topics::TABLE.iter().map(|topic| topic.spec().name.to_owned());
    let known: Vec<_> = channels.chain(bus).collect();
    let shown: Vec<_> = LAYOUT
        .split('"')
        .filter(|word| word.contains('/') && !word.contains(' ') || word.starts_with("command."))
        .map(|word| word.split_once('.').map_or(word, |(topic, _)| topic))
        .collect();
    assert!(shown.len() > 6, "{shown:?}");
    assert!(shown.iter().all(|topic| known.iter().any(|it| it == topic)), "{shown:?}");
}
