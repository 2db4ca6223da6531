//! Body motion and laser mounting that align all scans with the first one.
//!
//! The scans at rest form a reference, a range for each bearing. The wheels' motion and the
//! unknowns below give the end of each later beam. Seen from the laser's first place it should
//! match the reference.
//!
//! Gauss-Newton minimises the differences, with weights that fall for points off the reference,
//! first for the early scans, then for all. It starts from eight laser directions, with turns as
//! counted and reversed, and with turning and driving exchanged, as one reversed wheel does.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use common::{geometry::wrap_angle, kinematics::Pose2, mission::Mission, samples::ScanHeader};
use glam::DVec2;
use nalgebra::{SMatrix, SVector};

use crate::{
    Finding, Trace,
    body::{MOTOR, Moves, SizesTold, motors, words},
    trace::{Scan, between},
    wheels::Motion,
};

/// Unknowns and their prior deviations from 0: the laser's yaw, radians, and place, metres; the age
/// of its scans beyond their stamps, seconds; the logarithms of true turn and distance over the
/// wheels'; turn per metre, radians.
const UNKNOWNS: usize = 7;
const PRIOR: [f64; UNKNOWNS] = [3.0, 0.2, 0.2, 0.5, 0.3, 0.3, 0.3];
const YAW: usize = 0;
const X: usize = 1;
const Y: usize = 2;
const AGE: usize = 3;
const TURN: usize = 4;
const WAY: usize = 5;
const CURL: usize = 6;
/// Steps of the numerical derivatives.
const STEPS: [f64; UNKNOWNS] = [1e-3, 1e-3, 1e-3, 2e-3, 1e-3, 5e-3, 5e-3];
/// Stages: maximum wheel turn of the scans, radians; distance at which a point counts half, metres;
/// rounds.
const STAGES: [(f64, f64, usize); 4] =
    [(0.7, 0.4, 6), (2.5, 0.2, 6), (f64::INFINITY, 0.1, 8), (f64::INFINITY, 0.04, 8)];
const STARTS: usize = 8;
/// Search samples: all scans up to this turn, radians, about so many others, and so many beams of
/// each. The refinement takes all scans with `BEAMS` beams.
const EARLY: f64 = 2.5;
const SCANS: usize = 60;
const FEW_BEAMS: usize = 30;
const BEAMS: usize = 90;
/// Distance from the reference of a placed point, metres.
const PLACED_M: f64 = 0.08;
const LEAST_PLACED: f64 = 0.6;
/// Share of placed points that ends the search, and its loss per logarithm of turn or distance over
/// the wheels'. Without the loss, a longer reverse turn could end at the same heading.
const CERTAIN: f64 = 0.93;
const UNLIKELY: f64 = 0.25;
/// Minimum reported deviations: angle, radians, distance, metres, time, seconds, shares.
const YAW_TOLD: f64 = 4.0 * PI / 180.0;
/// Maximum deviation from backwards of a laser that may look back, or whose robot may drive back.
const BACK_RAD: f64 = 10.0 * PI / 180.0;
const PLACE_TOLD_M: f64 = 0.05;
const AGE_TOLD_S: f64 = 0.06;
const SIZES_TOLD: SizesTold = SizesTold { sizes: 0.04, ratio: 0.03 };

type Unknowns = SVector<f64, UNKNOWNS>;

#[derive(Clone, Copy)]
struct Hypothesis {
    /// Whether the laser sees turns against the wheels'.
    turns_back: bool,
    /// Whether turning and driving are exchanged.
    exchanged: bool,
}

/// Scans in one frame, whose origin is the robot's first place.
pub(crate) struct Placed {
    hypothesis: Hypothesis,
    unknowns: Unknowns,
    share: f64,
    row: usize,
    /// Ends of the beams, metres.
    pub points: Vec<DVec2>,
    poses: Vec<(f64, [f64; 3])>,
}

impl Placed {
    pub(crate) fn is_sure(&self) -> bool {
        self.share >= LEAST_PLACED
    }

    /// Returns whether the laser sees the body drive back.
    fn seems_back(&self) -> bool {
        PI - self.unknowns[YAW].abs() < BACK_RAD
    }

    /// Returns the body's motion.
    ///
    /// A laser upside down or looking back resembles swapped or reversed motors, except for turns
    /// that drive. A gyro that turns with the wheels decides.
    pub(crate) fn moves(&self, gyro_scale: Option<f64>) -> Moves {
        let Hypothesis { turns_back, exchanged } = self.hypothesis;
        let scale = |it: usize| Some(self.unknowns[it].exp());
        let agrees = gyro_scale.map(|scale| scale > 0.0);
        let drives_back = self.seems_back();
        let are_motors = exchanged || turns_back && agrees == Some(false);
        let is_laser = !exchanged && turns_back && agrees == Some(true);
        Moves {
            turns_back: (are_motors || is_laser || !turns_back).then_some(turns_back && !is_laser),
            drives_back: (are_motors || !drives_back).then_some(drives_back),
            exchanged,
            turn: scale(TURN),
            way: scale(WAY),
            // A laser upside down sees the turn to the other side.
            curl: if is_laser { -self.unknowns[CURL] } else { self.unknowns[CURL] },
        }
    }

    pub(crate) fn pose(&self, at_s: f64) -> Pose2 {
        pose(&self.poses, at_s)
    }
}

fn pose(poses: &[(f64, [f64; 3])], at_s: f64) -> Pose2 {
    let [x, y, heading] = between(poses, at_s).unwrap_or_default();
    Pose2 { position: DVec2::new(x, y), heading }
}

struct Problem<'a> {
    motion: &'a Motion,
    track_m: f64,
    header: ScanHeader,
    /// Ranges at rest; not finite without an echo.
    reference: Vec<f64>,
    /// All scans since it moved, each with the wheels' turn until then.
    scans: Vec<(&'a Scan, f64)>,
    /// Interval of later scans that are placed.
    every: usize,
    beams_of_each: usize,
}

impl<'a> Problem<'a> {
    fn new(trace: &'a Trace, motion: &'a Motion, track_m: f64) -> Option<Self> {
        let header = trace.scans.first()?.1;
        let until = trace.rest_until_s();
        let (at_rest, moving): (Vec<_>, Vec<_>) = trace
            .scans
            .iter()
            .filter(|it| it.1.sensor == header.sensor)
            .partition(|it| it.0 < until);
        let beams = at_rest.iter().map(|it| it.2.len()).min().filter(|beams| *beams > 8)?;
        let median = |beam: usize| {
            let mut ranges: Vec<f64> = at_rest.iter().map(|it| f64::from(it.2[beam])).collect();
            ranges.retain(|range| range.is_finite());
            ranges.sort_by(f64::total_cmp);
            let enough = 2 * ranges.len() > at_rest.len();
            if enough { ranges[ranges.len() / 2] } else { f64::INFINITY }
        };
        let turned = |scan: &'a Scan| {
            let [angle, way] = between(motion, scan.0).unwrap_or_default();
            (scan, angle.abs() + 2.0 * way.abs() / track_m)
        };
        Some(Self {
            motion,
            track_m,
            header,
            reference: (0..beams).map(median).collect(),
            every: 1 + moving.len() / SCANS,
            scans: moving.into_iter().map(turned).collect(),
            beams_of_each: FEW_BEAMS,
        })
    }

    fn poses(&self, hypothesis: Hypothesis, unknowns: &Unknowns) -> Vec<(f64, [f64; 3])> {
        let (mut at, mut before) = ([0.0; 3], [0.0; 2]);
        let mut poses = Vec::with_capacity(self.motion.len());
        let sign = if hypothesis.turns_back { -1.0 } else { 1.0 };
        for (time, now) in self.motion {
            let [mut turn, mut way] = [now[0] - before[0], now[1] - before[1]];
            if hypothesis.exchanged {
                (turn, way) = (2.0 * way / self.track_m, turn * self.track_m / 2.0);
            }
            let way = way * unknowns[WAY].exp();
            let turn = sign * turn * unknowns[TURN].exp() + unknowns[CURL] * way;
            let along = DVec2::from_angle(at[2] + turn / 2.0) * way;
            at = [at[0] + along.x, at[1] + along.y, at[2] + turn];
            poses.push((*time, at));
            before = *now;
        }
        poses
    }

    fn laser(&self, unknowns: &Unknowns) -> DVec2 {
        DVec2::new(self.header.x_m + unknowns[X], self.header.y_m + unknowns[Y])
    }

    /// Returns the beam ends in the frame of the first pose; `None` without an end. The order is
    /// independent of the unknowns.
    fn ends(
        &self,
        hypothesis: Hypothesis,
        unknowns: &Unknowns,
        most_turn: f64,
    ) -> Vec<Option<DVec2>> {
        let poses = self.poses(hypothesis, unknowns);
        let laser = self.laser(unknowns);
        let mut ends = Vec::new();
        // Beams of a scan without sweep times share one pose.
        let mut held = (f64::NAN, DVec2::ZERO, DVec2::X);
        let is_placed = |(number, (_, turned)): &(usize, &(&Scan, f64))| {
            *turned <= most_turn && (*turned <= EARLY || number.is_multiple_of(self.every))
        };
        for (_, (scan, _)) in self.scans.iter().enumerate().filter(is_placed) {
            let (at, header, beams) = scan;
            for beam in (0..beams.len()).step_by(1 + beams.len() / self.beams_of_each) {
                let range = f64::from(beams[beam]);
                let seconds = 1e-9 * header.sweep().beam_time_ns(beam, beams.len()) as f64;
                let taken = at + seconds - unknowns[AGE];
                ends.push(range.is_finite().then(|| {
                    if held.0 != taken {
                        let robot = pose(&poses, taken);
                        held = (taken, robot.position, DVec2::from_angle(robot.heading));
                    }
                    let along = header.first_rad + header.step_rad * beam as f64 + unknowns[YAW];
                    held.1 + held.2.rotate(laser + range * DVec2::from_angle(along))
                }));
            }
        }
        ends
    }

    /// Returns a point's distance beyond the reference, from the laser's first place, metres.
    fn beyond(&self, end: DVec2, unknowns: &Unknowns) -> Option<f64> {
        let seen = end - self.laser(unknowns);
        let along = seen.to_angle() - unknowns[YAW] - self.header.first_rad;
        let beam = along.rem_euclid(TAU) / self.header.step_rad;
        let beams = self.reference.len();
        let whole = self.header.step_rad * beams as f64 >= TAU - 1e-6;
        let (low, part) = (beam as usize, beam.fract());
        let high = if whole { (low + 1) % beams } else { low + 1 };
        let (low, high) = (*self.reference.get(low)?, *self.reference.get(high)?);
        let range = if (high - low).abs() < 0.1 { low + part * (high - low) } else { low };
        range.is_finite().then(|| seen.length() - range)
    }

    fn residuals(
        &self,
        hypothesis: Hypothesis,
        unknowns: &Unknowns,
        most_turn: f64,
    ) -> Vec<Option<f64>> {
        self.ends(hypothesis, unknowns, most_turn)
            .into_iter()
            .map(|end| self.beyond(end?, unknowns))
            .collect()
    }

    /// Performs the Gauss-Newton iterations of a stage; points at `half_m` count half.
    fn improve(
        &self,
        hypothesis: Hypothesis,
        unknowns: &mut Unknowns,
        (most_turn, half_m, rounds): (f64, f64, usize),
    ) {
        const { assert!(CURL + 1 == UNKNOWNS) };
        for _ in 0..rounds {
            let now = self.residuals(hypothesis, unknowns, most_turn);
            let shifted: Vec<_> = (0..UNKNOWNS)
                .map(|it| {
                    let mut shifted = *unknowns;
                    shifted[it] += STEPS[it];
                    self.residuals(hypothesis, &shifted, most_turn)
                })
                .collect();
            assert!(shifted.iter().all(|it| it.len() == now.len()));
            let mut normal = SMatrix::<f64, UNKNOWNS, UNKNOWNS>::zeros();
            let mut right = Unknowns::zeros();
            for (point, residual) in now.iter().enumerate() {
                let Some(residual) = residual else { continue };
                let weight = (1.0 + (residual / half_m).powi(2)).powi(-2);
                let mut slope = Unknowns::zeros();
                for it in 0..UNKNOWNS {
                    let Some(there) = shifted[it][point] else { continue };
                    // At an edge of the reference the difference is meaningless as a slope.
                    let difference = there - residual;
                    if difference.abs() < 0.1 {
                        slope[it] = difference / STEPS[it];
                    }
                }
                normal += weight * slope * slope.transpose() / half_m.powi(2);
                right -= weight * slope * *residual / half_m.powi(2);
            }
            for it in 0..UNKNOWNS {
                normal[(it, it)] += PRIOR[it].powi(-2);
                // The yaw may start anywhere, so its prior is flat.
                right[it] -= if it == YAW { 0.0 } else { unknowns[it] * PRIOR[it].powi(-2) };
            }
            if let Some(change) = normal.cholesky().map(|it| it.solve(&right)) {
                let longest =
                    (0..UNKNOWNS).map(|it| (change[it] / (0.3 * PRIOR[it].min(1.0))).abs());
                *unknowns += change / longest.fold(1.0, f64::max);
            }
        }
    }

    /// Returns the share of visible points that lie on the reference.
    fn placed(&self, hypothesis: Hypothesis, unknowns: &Unknowns) -> f64 {
        let residuals = self.residuals(hypothesis, unknowns, f64::INFINITY);
        let shown = residuals.iter().flatten().count();
        let placed = residuals.iter().flatten().filter(|it| it.abs() <= PLACED_M).count();
        // Penalises solutions that turn most points away from the reference.
        placed as f64 / shown.max(residuals.len() / 3).max(1) as f64
    }
}

/// Places the scans of the first laser; `None` without scans before and after the robot moved.
pub(crate) fn place(mission: &Mission, trace: &Trace, motion: &Motion) -> Option<Placed> {
    let mut problem = Problem::new(trace, motion, mission.body().track_m)?;
    let mut best: Option<(f64, Hypothesis, Unknowns)> = None;
    let both = [false, true];
    let mut starts = both
        .into_iter()
        .flat_map(|exchanged| both.map(|turns_back| Hypothesis { turns_back, exchanged }))
        .flat_map(|it| (0..STARTS).map(move |start| (it, start)));
    // A nearly perfect solution ends the search.
    while best.as_ref().is_none_or(|(likely, ..)| *likely < CERTAIN)
        && let Some((hypothesis, start)) = starts.next()
    {
        let mut unknowns = Unknowns::zeros();
        unknowns[YAW] = TAU * start as f64 / STARTS as f64;
        for stage in STAGES {
            problem.improve(hypothesis, &mut unknowns, stage);
        }
        let share = problem.placed(hypothesis, &unknowns);
        let likely = share - UNLIKELY * (unknowns[TURN].abs() + unknowns[WAY].abs());
        // The stated robot wins ties.
        if best.as_ref().is_none_or(|(most, ..)| likely > most + 0.03) {
            best = Some((likely, hypothesis, unknowns));
        }
    }
    let (_, hypothesis, mut unknowns) = best?;
    (problem.every, problem.beams_of_each) = (1, BEAMS);
    problem.improve(hypothesis, &mut unknowns, STAGES[STAGES.len() - 1]);
    let share = problem.placed(hypothesis, &unknowns);
    unknowns[YAW] = wrap_angle(unknowns[YAW]);
    Some(Placed {
        share,
        hypothesis,
        unknowns,
        row: problem.header.sensor as usize,
        points: problem.ends(hypothesis, &unknowns, f64::INFINITY).into_iter().flatten().collect(),
        poses: problem.poses(hypothesis, &unknowns),
    })
}

pub(crate) fn findings(
    mission: &Mission,
    trace: &Trace,
    placed: Option<&Placed>,
    moves: &Moves,
    has_gyro: bool,
) -> Vec<Finding> {
    let table = mission.sensor_table();
    let Some(placed) = placed else {
        return Vec::new();
    };
    let Some(sensor) = table.get(placed.row) else {
        return Vec::new();
    };
    let name = &sensor.name;
    if !placed.is_sure() {
        return vec![Finding::unknown(
            name,
            format!(
                "only {:.0} % of its beams agree on a motion; place the robot among walls and objects, and repeat",
                100.0 * placed.share
            ),
        )];
    }
    let mut found = Vec::new();
    let it = placed.unknowns;
    let key = |key: &str| format!("robot.sensor.{name}.{key}");
    if moves.exchanged {
        return found;
    }
    // Motor faults take precedence over laser faults.
    let seen_back = placed.hypothesis.turns_back && moves.turns_back != Some(true);
    let looks_back = placed.seems_back() && moves.drives_back != Some(true);
    let or_motors = format!(
        "or {}; check which way the robot turns and drives",
        words(motors(seen_back, looks_back, false).transpose(), MOTOR)
    );
    if seen_back {
        let roll = if sensor.is_upside_down { "0" } else { "180" };
        let upside_down = format!("{name} sees it turn the other way: it is upside down");
        let key = key("roll_deg");
        found.push(if has_gyro {
            Finding::wrong(name, upside_down).with_key(key, roll)
        } else {
            Finding::wrong(name, format!("{upside_down}, so that {key} = {roll}, {or_motors}"))
        });
    } else if looks_back {
        let key = key("turned_deg");
        let text = "sees it drive backwards: it points back, so that";
        found.push(Finding::wrong(name, format!("{text} {key} = 180, {or_motors}")));
    }
    let mount = sensor.mount;
    let off = DVec2::new(it[X], it[Y]);
    let yaw = it[YAW];
    // The place and direction of a laser that may be upside down or look back are unknown.
    let is_known = (!seen_back || has_gyro) && !placed.seems_back();
    let (turns, stands) =
        (is_known && yaw.abs() > YAW_TOLD, is_known && off.length() > PLACE_TOLD_M);
    let mut bearing_rad = mount.bearing_rad;
    if stands {
        let at = DVec2::from_angle(bearing_rad) * mount.forward_m + off;
        let aside = wrap_angle(at.to_angle() - bearing_rad);
        // A negative `forward_m` keeps the bearing of a place behind the centre.
        let behind = aside.abs() > FRAC_PI_2;
        bearing_rad = wrap_angle(at.to_angle() + if behind { PI } else { 0.0 });
        let forward_m = if behind { -at.length() } else { at.length() };
        found.push(
            Finding::wrong(name, format!("is mounted {:.2} m from its stated place", off.length()))
                .with_key(key("forward_m"), format!("{forward_m:.3}"))
                .with_key(key("bearing_deg"), format!("{:.1}", bearing_rad.to_degrees())),
        );
    }
    if turns || stands {
        // The beams are turned from the bearing.
        let yaw = if seen_back { -yaw } else { yaw };
        let turned = mount.turned_rad + if turns { yaw } else { 0.0 };
        let turned = wrap_angle(turned + mount.bearing_rad - bearing_rad);
        let turned = (key("turned_deg"), format!("{:.1}", turned.to_degrees()));
        if turns {
            let yaw_deg = it[YAW].to_degrees();
            let text =
                format!("points {yaw_deg:.1} degrees counter-clockwise from its stated direction");
            found.push(Finding::wrong(name, text));
        }
        found.last_mut().into_iter().for_each(|it| it.keys.push(turned.clone()));
    }
    if it[AGE].abs() > AGE_TOLD_S {
        found.push(Finding::wrong(
            name,
            format!(
                "its scans are {:.2} s {} than their stamps; stamp them when they are taken",
                it[AGE].abs(),
                if it[AGE] > 0.0 { "older" } else { "younger" }
            ),
        ));
    }
    found.extend(moves.sizes(mission, SIZES_TOLD));
    if found.is_empty() {
        let count = trace.scans.len();
        found.push(Finding::right(
            name,
            format!(
                "{:.0} % of the beams of {count} scans agree with wheels and mounting",
                100.0 * placed.share
            ),
        ));
    }
    found
}
