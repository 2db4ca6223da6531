//! States, ages and sizes in words.

use common::samples::{HoldReason, Order, RosterHeader};

pub const fn order(header: &RosterHeader) -> &'static str {
    match Order::from_byte(header.order) {
        Order::Hold => match HoldReason::from_byte(header.reason) {
            HoldReason::Operator => "stopped by an operator",
            HoldReason::StageHeld => "stopped, a stage is held",
            HoldReason::Waiting => "waiting for a target",
            HoldReason::Lost => "lost what it follows",
            HoldReason::Starting | HoldReason::None | HoldReason::Ending => "starting",
        },
        Order::Drive => "driving",
        Order::Stop => "stopping",
    }
}

/// `u64::MAX` is never.
pub fn seconds(nanoseconds: u64) -> Option<f64> {
    (nanoseconds != u64::MAX).then_some(nanoseconds as f64 * 1e-9)
}

/// Chooses a fitting unit; `None` means never.
pub fn age(seconds: Option<f64>) -> String {
    match seconds {
        None => "never".to_owned(),
        Some(seconds) if seconds < 1.0 => format!("{:.0} ms", seconds * 1e3),
        Some(seconds) if seconds < 600.0 => format!("{seconds:.1} s"),
        Some(seconds) if seconds < 2.0 * 3600.0 => format!("{:.0} min", seconds / 60.0),
        Some(seconds) if seconds < 48.0 * 3600.0 => format!("{:.0} h", seconds / 3600.0),
        Some(seconds) => format!("{:.0} days", seconds / 86400.0),
    }
}

pub fn size(bytes: u64) -> String {
    let bytes = bytes as f64;
    match bytes {
        _ if bytes < 1e6 => format!("{:.0} kB", bytes / 1e3),
        _ if bytes < 1e9 => format!("{:.1} MB", bytes / 1e6),
        _ => format!("{:.1} GB", bytes / 1e9),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ages_and_sizes_have_the_unit_that_fits() {
        let ages = [0.0, 0.25, 59.94, 599.0, 3600.0, 36e3, 5e5].map(|age_s| age(Some(age_s)));
        let written = ["0 ms", "250 ms", "59.9 s", "599.0 s", "60 min", "10 h", "6 days"];
        assert_eq!(ages, written);
        assert_eq!(age(None), "never");
        assert_eq!(seconds(u64::MAX), None);
        let sizes = [0, 1500, 2_340_000, 5_000_000_000].map(size);
        assert_eq!(sizes, ["0 kB", "2 kB", "2.3 MB", "5.0 GB"]);
    }
}
