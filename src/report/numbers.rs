//! Numbers for people.

pub(crate) use crate::job::{counted, thousands};

/// Returns a figure with four digits, or a dash for a figure that does not exist.
pub(crate) fn figure(value: f64) -> String {
    if !value.is_finite() {
        "–".to_owned()
    } else if value != 0.0 && value.abs() < 1e-3 {
        format!("{value:.2e}")
    } else if value.abs() < 100.0 {
        format!("{value:.4}")
    } else {
        format!("{value:.1}")
    }
}

/// Returns bytes as whole mebibytes, rounded upwards.
pub(super) fn mebibytes(bytes: u64) -> String {
    format!("{} MiB", thousands(bytes.div_ceil(1 << 20)))
}
