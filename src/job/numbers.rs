//! Numbers in messages.

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

/// Returns a number of things, each of which is a `thing`: `1 point`, `1 234 567 points`.
pub(crate) fn counted(number: u64, thing: &str) -> String {
    let ending = if number == 1 { "" } else { "s" };
    format!("{} {thing}{ending}", thousands(number))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_thing_is_one_and_others_are_many() {
        let said = [0, 1, 2, 1_234_567].map(|number| counted(number, "point"));
        assert_eq!(
            said,
            ["0 points", "1 point", "2 points", "1 234 567 points"]
        );
    }
}
