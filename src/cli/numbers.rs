//! Numbers for people.

/// Returns `value` to the decimals of `scale`, a step of the coordinates of a file, without
/// the digits that binary arithmetic leaves behind them: 13.6, and not 13.600000000000001.
pub(super) fn rounded(value: f64, scale: f64) -> String {
    // A scale of 0.0025 needs four decimals. Written so that a scale that is no positive
    // number gives all decimals.
    let decimals = (0..=12).find(|&decimals| {
        let steps = scale * 10.0_f64.powi(decimals);
        steps >= 1.0 - 1e-9 && (steps - steps.round()).abs() < 1e-6 * steps
    });
    let text = match decimals {
        Some(decimals) => format!("{value:.*}", decimals as usize),
        None => return value.to_string(),
    };
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_decimals_of_their_scale() {
        assert_eq!(rounded(13.600_000_000_000_001, 0.001), "13.6");
        assert_eq!(rounded(-0.0025, 0.0025), "-0.0025");
        assert_eq!(rounded(430_997.526, 0.001), "430997.526");
        assert_eq!(rounded(1200.0, 1.0), "1200");
        assert_eq!(rounded(0.1, f64::NAN), "0.1");
    }
}
