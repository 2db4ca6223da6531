//! The figures of a report.

use common::{
    bus::Stamp,
    kinematics::Pose2,
    latency::BUCKETS,
    samples::{CommandSample, FieldCell, PoseSample, RangeStatus, WheelSample},
};
use picture::{Axis, Chart, Facts, Mark, Scene, Series, Timeline};

use crate::{beliefs::Belief, content::Content};

/// Buckets of the latency's histogram in an octave.
const PER_OCTAVE: f64 = 8.0;

pub(crate) struct Figure {
    /// Name of its file, without ending.
    pub(crate) name: &'static str,
    pub(crate) caption: String,
    pub(crate) svg: String,
}

pub(crate) fn all(content: &Content) -> Vec<Figure> {
    let [first, second] = wheels(content);
    let end = Belief::of(&content.grid_header, &content.grid);
    let field = end.as_ref().and_then(|belief| belief.field(&content.mission));
    let mut all = vec![trajectory(content, end.as_ref(), field.as_ref())];
    all.extend(map_and_field(content, end.as_ref(), field.as_ref()));
    all.extend([
        timeline(content),
        sonar(content),
        speed(content),
        turning(content),
        first,
        second,
        latency(content),
    ]);
    all
}

fn seconds(stamp: &Stamp) -> f64 {
    stamp.time().seconds()
}

fn series(name: &str, mark: Mark, points: Vec<[f64; 2]>) -> Series {
    Series { name: name.to_owned(), mark, points }
}

fn over_time(
    name: &'static str,
    title: &str,
    unit: &str,
    caption: String,
    series: Vec<Series>,
) -> Figure {
    let chart = Chart {
        title: title.to_owned(),
        description: caption.clone(),
        x: Axis::linear("mission time, s"),
        y: Axis::linear(unit),
        series,
    };
    Figure { name, caption, svg: chart.svg() }
}

/// The scene of `belief`, its `field` and the `poses` until then.
fn scene<'a>(
    content: &'a Content,
    belief: Option<&'a Belief>,
    field: Option<&'a Vec<FieldCell>>,
    poses: &'a [Pose2],
) -> Scene<'a> {
    Scene {
        mission: &content.mission,
        grid: belief.map(|belief| (belief.frame, &belief.cells[..])),
        field: belief.zip(field).map(|(belief, field)| (belief.frame, &field[..])),
        believed: poses,
        covariance: None,
        truth: &[],
        targets: &[],
        facts: Facts {
            outcome: content.outcome().unwrap_or("unknown"),
            reached: content.outcome() == Some("reached"),
            mission_time_s: content.duration_s(),
            path_length_m: content.measured.path_m,
            straight_m: content.mission.target.length(),
            safety_events: content.measured.safety_events,
            seed: content.simulated.then_some(content.mission.seed),
        },
        captions: &[],
    }
}

fn path(poses: &[PoseSample]) -> Vec<Pose2> {
    poses.iter().map(PoseSample::pose).collect()
}

/// The trajectory on the map at the `end` and its `field`.
fn trajectory(content: &Content, end: Option<&Belief>, field: Option<&Vec<FieldCell>>) -> Figure {
    let poses = path(content.poses.items());
    let mut scene = scene(content, end, field, &poses);
    scene.covariance = content.measured.last_pose().map(|pose| {
        let [xx, xy, _, yy, ..] = pose.covariance;
        [xx, xy, yy]
    });
    let over = if field.is_some() { " over the guidance field of the map at the end" } else { "" };
    Figure {
        name: "trajectory",
        caption: format!(
            "Trajectory by dead reckoning{over}, with what was believed hazardous at the end (areas) and what really stands \
             there (outlines)."
        ),
        svg: picture::figure_svg(&scene),
    }
}

/// Map and field during the run and at the `end`; none if no earlier map was recorded.
fn map_and_field(
    content: &Content,
    end: Option<&Belief>,
    field: Option<&Vec<FieldCell>>,
) -> Option<Figure> {
    let on_the_way = content.beliefs.on_the_way(content.duration_s());
    if on_the_way.is_empty() {
        return None;
    }
    let samples = content.poses.items();
    let until = |belief: &Belief| {
        let end = samples.partition_point(|pose| seconds(&pose.stamp) <= belief.time_s);
        path(&samples[..end])
    };
    let solved = on_the_way.iter().map(|belief| belief.field(&content.mission));
    let solved: Vec<_> = solved.collect();
    let fields = solved.iter().map(Option::as_ref).chain([field]);
    let beliefs: Vec<_> = on_the_way.into_iter().chain(end).collect();
    let paths: Vec<_> = beliefs.iter().map(|belief| until(belief)).collect();
    let panels = beliefs.iter().zip(fields).zip(&paths);
    let panels = panels.map(|((belief, field), poses)| {
        let title = format!("{:.0} s", belief.time_s);
        (title, scene(content, Some(belief), field, poses))
    });
    Some(Figure {
        name: "map-and-field",
        caption: "Map, guidance field of that map, and trajectory, by mission time. Frame and symbols are those of the \
                  trajectory's figure; levels of the field are each panel's own."
            .to_owned(),
        svg: picture::panels_svg("Map and field over time", &panels.collect::<Vec<_>>()),
    })
}

fn timeline(content: &Content) -> Figure {
    let caption =
        "Ends of processes, recoveries and other events; the list at the end says what each was.";
    let lanes = content.events.lanes(content.duration_s());
    let all = lanes.iter().flat_map(|lane| {
        let spans = lane.spans.iter().map(|[_, to]| *to);
        spans.chain(lane.marks.iter().map(|(time, _)| *time))
    });
    let timeline = Timeline {
        title: "Events, deaths and recoveries".to_owned(),
        description: caption.to_owned(),
        duration_s: all.fold(content.duration_s(), f64::max),
        span: "no process; failsafe: robot stopped".to_owned(),
        lanes,
    };
    Figure { name: "timeline", caption: caption.to_owned(), svg: timeline.svg() }
}

fn sonar(content: &Content) -> Figure {
    let ranges = content.ranges.items();
    let of = |is_shown: fn(RangeStatus) -> bool, metres: fn(f64, u16) -> f64| -> Vec<[f64; 2]> {
        let shown = ranges.iter().filter(|(_, reading)| is_shown(reading.status()));
        shown.map(|(at, reading)| [seconds(at), metres(reading.range_m, reading.raw)]).collect()
    };
    let is_distance = |status| matches!(status, RangeStatus::Measured | RangeStatus::AtContact);
    let is_none = |status| matches!(status, RangeStatus::Nothing | RangeStatus::Invalid);
    let within = content.mission.map_within_m();
    let ends = [0.0, content.duration_s()];
    over_time(
        "sonar",
        "Front sonar",
        "range, m",
        "Readings of the front sonar. The bytes 255 (nothing in range) and 0 (not valid) are drawn as 2.55 m and 0 m."
            .to_owned(),
        vec![
            series("distance", Mark::Discs, of(is_distance, |range, _| range)),
            series(
                "no distance",
                Mark::Crosses,
                of(is_none, |_, raw| f64::from(raw) / 100.0),
            ),
            series(
                "mapped within",
                Mark::Dashed,
                ends.map(|time| [time, within]).to_vec(),
            ),
        ],
    )
}

fn believed(content: &Content, value: fn(&PoseSample) -> f64) -> Series {
    let poses = content.poses.items().iter();
    let points = poses.map(|pose| [seconds(&pose.stamp), value(pose)]);
    series("by dead reckoning", Mark::Dashed, points.collect())
}

fn commanded(content: &Content, value: fn(&CommandSample) -> f64) -> Series {
    let commands = content.commands.items().iter();
    let points = commands.map(|command| [seconds(&command.stamp), value(command)]);
    series("commanded", Mark::Solid, points.collect())
}

fn speed(content: &Content) -> Figure {
    over_time(
        "speed",
        "Tangential speed",
        "v, m/s",
        "Tangential speed v: commanded, (16), and by dead reckoning.".to_owned(),
        vec![commanded(content, |command| command.v_m_s), believed(content, |pose| pose.v_m_s)],
    )
}

fn turning(content: &Content) -> Figure {
    over_time(
        "turning",
        "Angular speed",
        "ω, rad/s",
        "Angular speed ω: commanded, (15), and by dead reckoning.".to_owned(),
        vec![
            commanded(content, |command| command.omega_rad_s),
            believed(content, |pose| pose.omega_rad_s),
        ],
    )
}

fn measured(content: &Content, value: impl Fn(&WheelSample) -> f64) -> Series {
    let wheels = content.wheels.items().iter();
    let points = wheels.map(|wheels| [seconds(&wheels.stamp), value(wheels)]);
    series("by the encoder", Mark::Dashed, points.collect())
}

/// Commands of both wheels; of a car, of the drive and of the steering.
fn wheels(content: &Content) -> [Figure; 2] {
    let body = content.mission.body();
    let per_count = std::f64::consts::TAU / body.counts_per_turn;
    let left = vec![
        commanded(content, |command| command.left_rad_s),
        measured(content, |wheels| f64::from(wheels.left_counts_per_s) * per_count),
    ];
    if body.steering.is_some() {
        let angle = vec![commanded(content, |command| command.right_rad_s)];
        return [
            over_time(
                "wheel-driven",
                "Driven wheel",
                "ωh, rad/s",
                "Control signal of the driven wheel, (17), and its speed.".to_owned(),
                left,
            ),
            over_time(
                "steering",
                "Steering",
                "φ, rad",
                "Control signal of the steering, (17): its angle, positive to the left.".to_owned(),
                angle,
            ),
        ];
    }
    let right = vec![
        commanded(content, |command| command.right_rad_s),
        measured(content, |wheels| f64::from(wheels.right_counts_per_s) * per_count),
    ];
    [
        over_time(
            "wheel-left",
            "Left wheel",
            "ωL, rad/s",
            "Control signal of the left wheel, (17), and its speed.".to_owned(),
            left,
        ),
        over_time(
            "wheel-right",
            "Right wheel",
            "ωR, rad/s",
            "Control signal of the right wheel, (17), and its speed.".to_owned(),
            right,
        ),
    ]
}

fn latency(content: &Content) -> Figure {
    let histogram = content.measured.latency();
    let counts = histogram.counts();
    let some = |&bucket: &usize| counts[bucket] > 0;
    let first = (0..BUCKETS).find(some);
    let last = (0..BUCKETS).rev().find(some);
    let edge = |bucket: usize| (bucket as f64 / PER_OCTAVE).exp2() / 1e3;
    let bars = first.zip(last).map_or_else(Vec::new, |(first, last)| {
        let bars = (first..=last).map(|bucket| [edge(bucket), f64::from(counts[bucket])]);
        bars.chain([[edge(last + 1), 0.0]]).collect()
    });
    let caption =
        "Tick latency, from the datagram in to the datagram out, of all generations of the link.";
    let chart = Chart {
        title: "Tick latency".to_owned(),
        description: caption.to_owned(),
        x: Axis::logarithmic("tick latency, ms"),
        y: Axis::linear("ticks, count"),
        series: vec![series("ticks", Mark::Bars, bars)],
    };
    Figure { name: "tick-latency", caption: caption.to_owned(), svg: chart.svg() }
}
