use super::*;
use glam::DVec2;

fn frame(cells: u32) -> GridFrame {
    GridFrame { cells, resolution_m: 0.1, centre: DVec2::ZERO }
}

#[test]
fn a_replica_follows_windows_and_waits_for_a_keyframe_when_one_is_missing() {
    let frame = frame(4);
    let mut replica = Replica::default();
    let part = Window { col: 1, row: 2, width: 2, height: 1 };
    let change = |version| Part::of(frame, part, version);
    assert_eq!(replica.apply(&change(2), &[1, 1]), Applied::Missed);
    let whole = Part::whole(frame, 1);
    assert_eq!(replica.apply(&whole, &[0_u8; 16]), Applied::Whole);
    assert_eq!(replica.apply(&change(2), &[1, 2]), Applied::Window(part));
    assert_eq!(replica.cells()[8..12], [0, 1, 2, 0]);
    assert_eq!(replica.apply(&change(4), &[1, 1]), Applied::Missed);
}

#[test]
fn a_part_without_a_change_after_a_missed_window_is_a_gap() {
    let frame = frame(4);
    let mut replica = Replica::default();
    replica.apply(&Part::whole(frame, 1), &[0_u8; 16]);
    let unchanged = |version| Part::of(frame, Window::default(), version);
    let nothing = Applied::Window(Window::default());
    assert_eq!(replica.apply(&unchanged(1), &[]), nothing);
    assert_eq!(replica.apply(&unchanged(2), &[]), Applied::Missed);
}

#[test]
fn a_keyframe_after_a_missed_window_tells_that_window() {
    let frame = frame(4);
    let one = Window { col: 1, row: 2, width: 1, height: 1 };
    let mut cells = [0_u8; 16];
    let [mut complete, mut gap] = [(); 2].map(|()| Replica::default());
    for replica in [&mut complete, &mut gap] {
        replica.apply(&Part::whole(frame, 1), &cells);
    }
    cells[9] = 1;
    let told = complete.apply(&Part::of(frame, one, 2), &[1]);
    assert_eq!(gap.apply(&Part::of(frame, Window::default(), 2), &[]), Applied::Missed);
    assert_eq!(gap.apply(&Part::whole(frame, 2), &cells), told);
    assert_eq!((gap.cells(), gap.version()), (complete.cells(), complete.version()));
}

#[test]
fn a_keyframe_that_changes_one_cell_is_told_as_that_window() {
    let frame = frame(4);
    let mut replica = Replica::default();
    let keyframe = |version| Part::whole(frame, version);
    let mut cells = [0_u8; 16];
    assert_eq!(replica.apply(&keyframe(1), &cells), Applied::Whole);
    let nothing = Applied::Window(Window::default());
    assert_eq!(replica.apply(&keyframe(1), &cells), nothing);
    cells[9] = 1;
    let one = Window { col: 1, row: 2, width: 1, height: 1 };
    assert_eq!(replica.apply(&keyframe(2), &cells), Applied::Window(one));
}

#[test]
fn a_map_without_cells_is_refused() {
    let none = Part::whole(frame(0), u64::MAX);
    let mut replica = Replica::<u8>::default();
    for _ in 0..2 {
        assert_eq!(replica.apply(&none, &[]), Applied::Missed);
    }
}

#[test]
fn a_window_that_does_not_fit_is_refused() {
    let frame = frame(4);
    let mut replica = Replica::default();
    let window = Window { col: 3, row: 0, width: u32::MAX, height: 1 };
    let outside = Part::of(frame, window, 1);
    assert_eq!(replica.apply(&outside, &[0_u8; 1]), Applied::Missed);
}

#[test]
fn a_part_says_what_it_was_made_of() {
    let frame = GridFrame { centre: DVec2::new(1.0, -2.0), ..frame(40) };
    let whole = Part::whole(frame, 7);
    assert_eq!((whole.frame(), whole.window()), (frame, frame.whole()));
    assert!(whole.is_keyframe() && whole.version == 7);
    let window = Window::default().including(Cell { col: 3, row: 9 });
    let part = Part::of(frame, window, 8);
    assert_eq!((part.frame(), part.window()), (frame, window));
    assert!(!part.is_keyframe());
}
