//! Well-known text of a coordinate reference system: kind, unit and codes.

/// The words with which geographic systems begin, in WKT 1 and 2.
const GEOGRAPHIC_ROOTS: [&str; 4] = ["GEOGCS[", "GEOGRAPHICCRS[", "GEOGCRS[", "GEODCRS["];

/// Whether the horizontal coordinates of the system in `text` are degrees.
pub(super) fn is_geographic(text: &str) -> bool {
    let head = text.trim_start().to_ascii_uppercase();
    let begins_geographic = |text: &str| GEOGRAPHIC_ROOTS.iter().any(|root| text.starts_with(root));
    let compound = head
        .strip_prefix("COMPD_CS[")
        .or_else(|| head.strip_prefix("COMPOUNDCRS["));
    match compound {
        // The horizontal part follows the name.
        Some(rest) => rest
            .split_once(',')
            .is_some_and(|(_, horizontal)| begins_geographic(horizontal.trim_start())),
        None => begins_geographic(&head),
    }
}

/// Metres to a unit of the projected system in `text`, in WKT 1 or 2: the first unit of
/// length that belongs neither to the geographic system below it nor to a parameter.
pub(super) fn metres_per_unit(text: &str) -> Option<f64> {
    let mut names: Vec<String> = Vec::new();
    let mut word = String::new();
    let mut is_quoted = false;
    for (at, c) in text.char_indices() {
        match c {
            '"' => is_quoted = !is_quoted,
            _ if is_quoted => {}
            '[' | '(' => {
                let name = std::mem::take(&mut word).to_ascii_uppercase();
                if (name == "UNIT" || name == "LENGTHUNIT") && is_unit_of_projection(&names) {
                    return unit_factor(&text[at..]);
                }
                names.push(name);
            }
            ']' | ')' => {
                names.pop();
                word.clear();
            }
            _ if c.is_alphanumeric() => word.push(c),
            _ => word.clear(),
        }
    }
    None
}

/// Whether a unit within the nodes `names`, the outermost first, is that of the projection.
fn is_unit_of_projection(names: &[String]) -> bool {
    let is_projected = |name: &String| name == "PROJCS" || name == "PROJCRS";
    let is_below =
        |name: &String| name.contains("GEO") || name == "CONVERSION" || name == "PARAMETER";
    names.iter().any(is_projected) && !names.iter().any(is_below)
}

/// The number that follows the name of a unit: `["foot",0.3048…`.
fn unit_factor(text: &str) -> Option<f64> {
    let rest = text.splitn(3, '"').nth(2)?;
    let number = rest.trim_start_matches([',', ' ']);
    let end = number.find([',', ']', ')'])?;
    number[..end].trim().parse().ok()
}

/// The outermost EPSG codes of a text in WKT 1: horizontal and, of a compound system,
/// vertical.
pub(super) fn epsg_codes(text: &str) -> Option<(u16, Option<u16>)> {
    let code = |part: &str| -> Option<u16> {
        let start = part.rfind("AUTHORITY[\"EPSG\",\"")? + "AUTHORITY[\"EPSG\",\"".len();
        part[start..].split('"').next()?.parse().ok()
    };
    let text = text.trim_start();
    if text.starts_with("COMPD_CS[") {
        let vertical = text.find("VERT_CS[")?;
        // The code of the compound system itself may stand last.
        let end = text[vertical..]
            .rfind("],AUTHORITY")
            .map_or(text.len(), |end| vertical + end);
        return Some((code(&text[..vertical])?, code(&text[vertical..end])));
    }
    code(text).map(|code| (code, None))
}
