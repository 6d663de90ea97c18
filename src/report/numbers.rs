//! Numbers for people.

/// Returns `1234567` as `1 234 567`.
pub(crate) fn thousands(number: u64) -> String {
    let digits = number.to_string();
    let mut out = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            out.push(' ');
        }
        out.push(digit);
    }
    out
}

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
