use super::*;

const TRACK_M: f64 = 0.26;
const NORMAL_SD: f64 = 0.01;

/// Generator of standard normal numbers.
struct Drawn(u64);

impl Drawn {
    fn uniform(&mut self) -> f64 {
        // SplitMix64.
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (TAU * self.uniform()).cos()
    }
}

fn drawn(seed: u64, count: u32, ratio: f64, track: f64, slip: f64) -> Vec<Loop> {
    let mut drawn = Drawn(seed);
    let e = (ratio - 1.0) / (ratio + 1.0);
    let mut off = NORMAL_SD * drawn.normal();
    let arc_m = 4.0;
    (1..=count)
        .map(|number| {
            let side: f64 = if number % 2 == 1 { 1.0 } else { -1.0 };
            let turns = if number <= 2 { side } else { 4.0 * side };
            let turn_m = turns.abs() * TAU * TRACK_M;
            let rolled_m = 2.0 * arc_m + turn_m;
            let before = std::mem::replace(&mut off, NORMAL_SD * drawn.normal());
            let by_slip = slip * rolled_m.sqrt() / TRACK_M * drawn.normal();
            // The equation solved for the nominal turn of a whole turn.
            let turned = TAU * turns * track - 2.0 * e * arc_m / TRACK_M + by_slip + off - before;
            Loop {
                number,
                turns,
                left_m: arc_m - turned * TRACK_M / 2.0,
                right_m: arc_m + turned * TRACK_M / 2.0,
                rolled_m,
            }
        })
        .collect()
}

#[test]
fn ratio_and_track_are_found_within_their_stated_deviations() {
    for slip in [0.001, 0.005] {
        let (mut ratios, mut tracks) = (Vec::new(), Vec::new());
        for seed in 1..=60 {
            let loops = drawn(seed, 8, 1.006, 0.98, slip);
            let estimate = Estimate::by_loops(&loops, NORMAL_SD, TRACK_M).unwrap();
            ratios.push((estimate.ratio() - 1.006) / estimate.ratio_sd());
            tracks.push((estimate.track() - 0.98) / estimate.track_sd());
            assert!(estimate.ratio_sd() < 1.5 * slip.max(0.0005), "{estimate:?}");
        }
        for deviations in [ratios, tracks] {
            let square = deviations.iter().map(|it| it * it).sum::<f64>() / 60.0;
            assert!((0.4..1.8).contains(&square), "slip {slip}: {square}");
            // The slip of a few loops is uncertain, so the tails are longer than normal.
            let beyond = deviations.iter().filter(|it| it.abs() > 3.0).count();
            assert!(beyond <= 3, "slip {slip}: {deviations:?}");
        }
    }
}

#[test]
fn loops_that_agree_pass_and_a_held_out_pair_that_contradicts_is_refused() {
    let loops = drawn(3, 8, 1.004, 1.01, 0.001);
    let estimate = checked(&loops, NORMAL_SD, TRACK_M).unwrap();
    assert_eq!(estimate.residuals.len(), loops.len());
    assert!((estimate.ratio() - 1.004).abs() <= 3.0 * estimate.ratio_sd());
    // The last loops have a wheel without its tyre.
    let mut other = loops;
    other[6..].copy_from_slice(&drawn(4, 8, 1.03, 1.01, 0.001)[6..]);
    let refusal = checked(&other, NORMAL_SD, TRACK_M).unwrap_err();
    let refused = matches!(
        refusal,
        Refusal::Contradicted { .. } | Refusal::Accidents { .. } | Refusal::Scattered { .. }
    );
    assert!(refused, "{refusal:?}");
}

#[test]
fn one_accident_is_left_out_and_two_are_refused() {
    let bump = |it: &mut Loop| {
        it.left_m -= 0.1;
        it.right_m += 0.1;
    };
    let mut loops = drawn(5, 10, 1.004, 1.01, 0.0005);
    bump(&mut loops[4]);
    let estimate = checked(&loops, NORMAL_SD, TRACK_M).unwrap();
    assert_eq!(estimate.residuals.len(), 9);
    assert!((estimate.ratio() - 1.004).abs() <= 3.0 * estimate.ratio_sd());
    bump(&mut loops[6]);
    assert!(checked(&loops, NORMAL_SD, TRACK_M).is_err());
}

#[test]
fn too_few_loops_and_numbers_that_are_none_are_refused() {
    let loops = drawn(6, 5, 1.0, 1.0, 0.001);
    assert_eq!(checked(&loops, NORMAL_SD, TRACK_M), Err(Refusal::TooFew { found: 5 }));
    let mut loops = drawn(6, 8, 1.0, 1.0, 0.001);
    loops[2].left_m = f64::NAN;
    assert!(checked(&loops, NORMAL_SD, TRACK_M).is_err());
}

#[test]
fn the_scatter_of_a_normal_is_half_that_of_the_difference_between_both_ways() {
    let mut drawn = Drawn(9);
    let differences: Vec<f64> = (0..200).map(|_| 0.05 + 0.04 * drawn.normal()).collect();
    let sd = normal_sd(&differences);
    assert!((sd - 0.02).abs() < 0.003, "{sd}");
    assert!((normal_sd(&[]) - PRIOR_NORMAL_RAD).abs() < 1e-12);
}
