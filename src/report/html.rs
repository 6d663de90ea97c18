//! Pieces of HTML.

/// The style of all pages.
pub(super) const STYLE: &str = include_str!("page.css");

/// Returns text as it may stand in a page.
pub(super) fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// Returns text without file names as it may stand in a page: no line ends within a number like `27 052`.
pub(super) fn prose(text: &str) -> String {
    let mut before = ' ';
    let mut next = text.chars().skip(1);
    let unbroken = text.chars().map(|here| {
        let after = next.next().unwrap_or(' ');
        let in_number = here == ' ' && before.is_ascii_digit() && after.is_ascii_digit();
        before = here;
        if in_number { '\u{a0}' } else { here }
    });
    escape(&unbroken.collect::<String>())
}

/// Returns a table with a head; cells are text.
pub(super) fn table(head: &[&str], rows: impl Iterator<Item = Vec<String>>) -> String {
    let cells = |row: &[String], tag: &str| -> String {
        row.iter()
            .map(|cell| format!("<{tag}>{}</{tag}>", escape(cell)))
            .collect()
    };
    let head: Vec<String> = head.iter().map(|h| (*h).to_owned()).collect();
    let rows: String = rows
        .map(|row| format!("<tr>{}</tr>", cells(&row, "td")))
        .collect();
    format!(
        "<div class=\"wide\" tabindex=\"0\"><table><thead><tr>{}</tr></thead><tbody>{rows}</tbody></table></div>",
        cells(&head, "th")
    )
}

/// Returns a file's name as part of an address.
pub(super) fn in_address(name: &str) -> String {
    let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-._~".contains(&byte);
    name.bytes()
        .map(|byte| match is_plain(byte) {
            true => char::from(byte).to_string(),
            false => format!("%{byte:02X}"),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_cannot_become_markup() {
        let cell = table(&["a"], [vec!["<script>&\"".to_owned()]].into_iter());
        assert!(cell.contains("&lt;script&gt;&amp;&quot;") && !cell.contains("<script>"));
    }

    #[test]
    fn a_number_stands_in_one_line() {
        assert_eq!(
            prose("27 052 of 1 234 < 5"),
            "27\u{a0}052 of 1\u{a0}234 &lt; 5"
        );
    }

    #[test]
    fn a_name_can_be_any_part_of_an_address() {
        assert_eq!(in_address("a b#ü.laz"), "a%20b%23%C3%BC.laz");
    }
}
