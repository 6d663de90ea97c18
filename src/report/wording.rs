//! Names of stages and settings in words.

use serde_json::Value;

use super::numbers::{counted, mebibytes};

/// Returns what a stage does in a word. The names in the JSON of reports and logs are older.
pub(crate) fn stage_title(stage: &str) -> &str {
    match stage {
        "look" => "overview",
        plain => plain,
    }
}

/// Returns the name and the value of a setting in words; `value` is JSON.
pub(super) fn setting(name: &str, value: &str) -> [String; 2] {
    let title = name.replace('_', " ");
    let parsed = serde_json::from_str(value).unwrap_or(Value::Null);
    let words = match (name, &parsed) {
        ("filter", filter) => filter_in_words(filter),
        ("memory", Value::Number(bytes)) => mebibytes(bytes.as_u64().unwrap_or(0)),
        ("restriction", Value::String(rule)) if rule == "local" => {
            "within the input's spacing around each point".to_owned()
        }
        ("fill", Value::Number(width)) if width.as_f64() == Some(0.0) => "no holes".to_owned(),
        ("density", Value::Object(density)) => {
            let rules = density.get("rules").and_then(Value::as_array);
            format!("by {}", counted(rules.map_or(0, Vec::len) as u64, "rule"))
        }
        ("crs", Value::Object(_)) => "as given by --crs".to_owned(),
        (_, Value::Null) => default_of(name).to_owned(),
        (_, value) => in_words(value),
    };
    [title, words]
}

/// Returns the meaning of a setting that is not given.
fn default_of(name: &str) -> &'static str {
    match name {
        "memory" => "¾ of what the cgroup or machine allows",
        "smooth" => "1.2 spacings",
        "fill" => "4 spacings, of the coarser of input and output",
        "tile_size" => "by points and memory",
        "halo" => "by spacing, iterations and fit radius",
        "crs" => "as the inputs state",
        "output_tiles" => "one file",
        _ => "not set",
    }
}

/// Returns a value without the marks of JSON: `0.25`, `nearest`, `normals, area`, `spacing
/// 0.25`.
fn in_words(value: &Value) -> String {
    match value {
        Value::Null => "none".to_owned(),
        Value::String(text) => text.clone(),
        Value::Array(items) if items.is_empty() => "none".to_owned(),
        Value::Array(items) => items.iter().map(in_words).collect::<Vec<_>>().join(", "),
        Value::Object(fields) => {
            let fields = fields.iter().map(|(name, value)| {
                let name = name.replace('_', " ");
                format!("{name} {}", in_words(value))
            });
            fields.collect::<Vec<_>>().join("; ")
        }
        plain => plain.to_string(),
    }
}

/// Returns the points that a filter keeps.
fn filter_in_words(filter: &Value) -> String {
    let is_given = |value: &&Value| match value {
        Value::Null | Value::Bool(false) => false,
        Value::Array(items) => !items.is_empty(),
        _ => true,
    };
    let conditions = [
        ("keep_classes", "classes"),
        ("drop_classes", "without classes"),
        ("drop_withheld", "without withheld points"),
        ("bounds", "within"),
        ("polygons", "within the polygons of a file"),
    ];
    let conditions = conditions.iter().filter_map(|(name, words)| {
        let value = filter.get(name).filter(is_given)?;
        Some(match *name {
            "drop_withheld" | "polygons" => (*words).to_owned(),
            _ => format!("{words} {}", in_words(value)),
        })
    });
    let conditions: Vec<String> = conditions.collect();
    match conditions.is_empty() {
        true => "all points".to_owned(),
        false => conditions.join("; "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_words_and_not_json() {
        let nothing = r#"{"bounds":null,"drop_classes":[],"drop_withheld":false,"keep_classes":null,"polygons":null}"#;
        let filter = r#"{"bounds":[1.0,2.0,3.0,4.0],"drop_classes":[7,18],"drop_withheld":true,"keep_classes":null,"polygons":null}"#;
        for (name, value, words) in [
            ("filter", nothing, "all points"),
            (
                "filter",
                filter,
                "without classes 7, 18; without withheld points; within 1.0, 2.0, 3.0, 4.0",
            ),
            ("target", r#"{"spacing":0.25}"#, "spacing 0.25"),
            (
                "density",
                r#"{"elsewhere":1.0,"rules":[{},{}]}"#,
                "by 2 rules",
            ),
            ("crs", "null", "as the inputs state"),
            ("color", "\"nearest\"", "nearest"),
            ("with", "[]", "none"),
            ("threads", "8", "8"),
            ("memory", "314572800", "300 MiB"),
        ] {
            assert_eq!(setting(name, value)[1], words, "{name}");
        }
        assert_eq!(setting("tile_size", "20.0")[0], "tile size");
    }
}
