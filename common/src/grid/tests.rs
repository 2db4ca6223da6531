use super::*;
use glam::DVec2;

fn frame(cells: u32) -> GridFrame {
    GridFrame { cells, resolution_m: 0.1, centre: DVec2::ZERO }
}

#[test]
fn a_replica_follows_windows_waits_for_a_keyframe_when_one_is_missing_and_tells_what_that_changed()
{
    let frame = frame(4);
    let of = |width| Window { col: 1, row: 2, width, height: 1 };
    let (none, one, two) = (Window::default(), of(1), of(2));
    let part = |window, version| Part::of(frame, window, version);
    let whole = |version| Part::whole(frame, version);
    let cells = |first, second| {
        let mut cells = [0_u8; 16];
        [cells[9], cells[10]] = [first, second];
        cells
    };
    let without_cells = Part::whole(self::frame(0), u64::MAX);
    let mut replica = Replica::default();
    for (nth, (part, cells, applied)) in [
        (part(two, 2), &[1, 1][..], Applied::Missed),
        (without_cells, &[], Applied::Missed),
        (without_cells, &[], Applied::Missed),
        (whole(1), &cells(0, 0), Applied::Whole),
        (whole(1), &cells(0, 0), Applied::Window(none)),
        (part(two, 2), &[1, 2], Applied::Window(two)),
        (part(none, 2), &[], Applied::Window(none)),
        (part(Window { width: u32::MAX, ..one }, 3), &[0], Applied::Missed),
        (part(none, 4), &[], Applied::Missed),
        (part(two, 5), &[1, 1], Applied::Missed),
        (whole(5), &cells(5, 2), Applied::Window(one)),
    ]
    .into_iter()
    .enumerate()
    {
        assert_eq!(replica.apply(&part, cells), applied, "part {nth}");
    }
    assert_eq!((replica.cells(), replica.version()), (&cells(5, 2)[..], 5));
}
