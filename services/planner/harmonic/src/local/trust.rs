//! Where the directions of a field updated in windows may be trusted.
//!
//! Outside its window, u after a change less u before is a solution of the equation, and so is their ratio of that equation
//! which u turns it into. Neither has a maximum but on the window's rim or at the target, where it is zero. So with a
//! ratio within 1 - e and 1 + e on the rim, u outside changes by at most e times its own value, and by at most e times the
//! largest u on the rim. The gradient is a difference of two neighbours on either axis, so what it may change by follows, and
//! from that the angle. No assumption is made of rooms or distances; but the ratio on the rim is the window's own, which
//! took u upstream for unchanged. Inside, the error at the inflow rim tells how far that holds.

use crate::cell::Cell;
use crate::field::Field;

/// Directions are trusted where they are off by no more than this, radians: ten degrees.
const TRUSTED: f64 = 0.174_533;

impl Field {
    /// Whether the direction at `cell` may be followed: always after a full solve; after local updates where their windows'
    /// rims show it to be within ten degrees of that of a full solve.
    pub fn is_trusted(&self, cell: Cell) -> bool {
        if self.patches().is_empty() {
            return true;
        }
        let at = (cell.col as i64, cell.row as i64);
        let own = self.u(cell);
        if own.is_zero() {
            return false;
        }
        let u = |dc: i64, dr: i64| {
            let there = self.seen(at, (at.0 + dc, at.1 + dr));
            there.relative_to(own.exponent) / own.mantissa
        };
        let [west, east, north, south] = [u(-1, 0), u(1, 0), u(0, -1), u(0, 1)];
        let length = (0.5 * (east - west)).hypot(0.5 * (south - north));
        // What patches may change the two differences by, relative to u.
        let (mut x, mut y) = (0.0, 0.0);
        for patch in self.patches() {
            let rim = patch.rim();
            if patch.contains(at) {
                if rim.upstream > TRUSTED {
                    return false;
                }
                continue;
            }
            let largest = rim.largest.relative_to(own.exponent) / own.mantissa;
            let change = |u: f64| rim.deviation * u.min(largest);
            x += 0.5 * (change(west) + change(east));
            y += 0.5 * (change(north) + change(south));
        }
        x.hypot(y) <= TRUSTED.sin() * length
    }
}
