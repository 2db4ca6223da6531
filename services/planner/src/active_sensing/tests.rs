use super::*;

#[test]
fn a_scan_turns_to_the_nearer_side_and_there_to_its_far_end() {
    let at = |degrees: f64| DVec2::from_angle(degrees.to_radians());
    let unseen = [at(20.0), at(50.0), at(35.0), at(-30.0), at(-80.0)];
    let there = scan(DVec2::X, unseen.into_iter());
    assert_eq!(there, Some(at(50.0)));
    assert_eq!(scan(DVec2::X, std::iter::empty()), None);
}
