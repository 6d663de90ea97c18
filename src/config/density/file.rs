//! Rules for the spacing in a TOML file, as `--density` has them.
//!
//! ```toml
//!   spacing = 0.3                 # where no rule applies
//!   gradation = 1.15
//!   [[rule]]
//!   class = [6, 17]
//!   height = [0.3, 4.0]
//!   spacing = 0.1
//! ```
//!
//! The tables are read by hand, so that a message has the number of the rule and the key.

use std::path::Path;

use toml::{Table, Value};

use super::written::{Origin, WrittenCondition, WrittenRule, WrittenRules, WrittenSpacing};
use crate::config::{error::ConfigError, length::Length};

const OPTION: &str = "--density";

/// What a range of lengths looks like.
const RANGE: &str = "two lengths in brackets, the smaller one first: [0.3, 4]";

impl WrittenRules {
    /// Reads the rules of a file. Files that it names are relative to its directory.
    ///
    /// # Errors
    ///
    /// [`ConfigError::Named`] if the file cannot be read, [`ConfigError::Parse`] if it is no TOML, and
    /// [`ConfigError::Named`] with the number of the rule and the key for what cannot be understood.
    pub(in crate::config) fn from_file(path: &Path) -> Result<Self, ConfigError> {
        let named = |problem: String| ConfigError::Named {
            option: OPTION,
            value: path.display().to_string(),
            problem,
        };
        let text =
            std::fs::read_to_string(path).map_err(|e| named(format!("cannot be read: {e}")))?;
        let table: Table = text
            .parse()
            .map_err(|error: toml::de::Error| ConfigError::Parse {
                path: path.display().to_string(),
                message: error.to_string(),
            })?;
        Self::from_table(table, path).map_err(named)
    }

    /// Reads the rules in the table of the file at `path`.
    ///
    /// # Errors
    ///
    /// A text with the number of the rule, the key, the value and what to write.
    fn from_table(table: Table, path: &Path) -> Result<Self, String> {
        let directory = path.parent().unwrap_or(Path::new(""));
        let origin = |rule| Origin {
            option: OPTION,
            value: path.display().to_string(),
            rule,
        };
        let mut rules = Self::default();
        for (key, value) in table {
            match (key.as_str(), value) {
                ("spacing", value) => {
                    rules.spacing = Some((length("spacing", &value)?, origin(None)));
                }
                ("gradation", value) => {
                    let number = number(&value).ok_or_else(|| {
                        expected("gradation", &value, "a number from 1.05 to 2, such as 1.15")
                    })?;
                    rules.gradation = Some((number, origin(None)));
                }
                ("rule", Value::Array(all)) => {
                    for (number, rule) in (1..).zip(all) {
                        let of_rule = |problem| format!("rule {number}: {problem}");
                        let Value::Table(rule) = rule else {
                            return Err(of_rule(
                                "begins with [[rule]] on a line of its own".into(),
                            ));
                        };
                        let rule = written_rule(&rule, origin(Some(number)), directory);
                        rules.rules.push(rule.map_err(of_rule)?);
                    }
                }
                ("rule", _) => return Err("a rule begins with [[rule]], in two brackets".into()),
                (other, _) => {
                    return Err(format!(
                        "`{other}` is none of spacing, gradation and [[rule]]; conditions stand below [[rule]]"
                    ));
                }
            }
        }
        if rules.rules.is_empty() {
            return Err("has no rule; a rule begins with [[rule]] on a line of its own".into());
        }
        Ok(rules)
    }
}

/// The rule in `table`; files that it names are relative to `directory`.
fn written_rule(table: &Table, origin: Origin, directory: &Path) -> Result<WrittenRule, String> {
    let mut conditions = Vec::new();
    let mut line = None;
    let mut distance = None;
    let mut spacing = None;
    let mut curvature = None;
    for (key, value) in table {
        match key.as_str() {
            "class" => conditions.push(WrittenCondition::Class(classes(value)?)),
            "polygon" => {
                let file = directory.join(text(key, value, "site.geojson")?);
                conditions.push(WrittenCondition::Polygon(file));
            }
            "height" => conditions.push(WrittenCondition::Height(lengths(key, value)?)),
            "line" => line = Some(directory.join(text(key, value, "axis.geojson")?)),
            "distance" => distance = Some(lengths(key, value)?),
            "spacing" => spacing = Some(WrittenSpacing::Uniform(length(key, value)?)),
            "curvature" => curvature = Some(by_curvature(value)?),
            _ => conditions.push(attribute(key, value)?),
        }
    }
    match (line, distance) {
        (Some(file), Some(distance)) => conditions.push(WrittenCondition::Line { file, distance }),
        (Some(_), None) => {
            return Err("`line` needs `distance`, a range: distance = [0, 5]".into());
        }
        (None, Some(_)) => {
            return Err(
                "`distance` needs `line`, the file of a line: line = \"axis.geojson\"".into(),
            );
        }
        (None, None) => {}
    }
    let spacing = match (spacing, curvature) {
        (Some(_), Some(_)) => return Err("has `spacing` and `curvature`; give one of them".into()),
        (None, None) => {
            return Err("has no spacing; give `spacing = 0.1`, or `curvature`".into());
        }
        (spacing, curvature) => spacing.or(curvature),
    };
    match spacing {
        Some(WrittenSpacing::Uniform(_)) if conditions.is_empty() => Err(
            "has no condition; give one, such as `class = 6`, or write `spacing` above all rules"
                .into(),
        ),
        None => Err("has no spacing".into()),
        Some(spacing) => Ok(WrittenRule {
            origin,
            conditions,
            spacing,
        }),
    }
}

/// The message that the value of `key` is not what is expected.
fn expected(key: &str, value: &Value, what: &str) -> String {
    format!("{key} = {value}: write {what}")
}

fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Integer(whole) => Some(*whole as f64),
        Value::Float(real) => Some(*real),
        _ => None,
    }
}

fn text<'v>(key: &str, value: &'v Value, example: &str) -> Result<&'v str, String> {
    let what = || expected(key, value, &format!("the name of a file: \"{example}\""));
    value.as_str().ok_or_else(what)
}

fn length(key: &str, value: &Value) -> Result<Length, String> {
    let read = match value {
        Value::String(text) => text.parse().ok(),
        other => number(other).map(Length::plain),
    };
    read.ok_or_else(|| expected(key, value, "a length: 0.1 (in CRS units), or \"10cm\""))
}

fn lengths(key: &str, value: &Value) -> Result<[Length; 2], String> {
    match value.as_array().map(Vec::as_slice) {
        Some([low, high]) => Ok([length(key, low)?, length(key, high)?]),
        _ => Err(expected(key, value, RANGE)),
    }
}

fn classes(value: &Value) -> Result<Vec<u8>, String> {
    let class = |value: &Value| u8::try_from(value.as_integer()?).ok();
    let all = match value {
        Value::Array(items) if !items.is_empty() => items.iter().map(class).collect(),
        one => class(one).map(|class| vec![class]),
    };
    all.ok_or_else(|| expected("class", value, "classes from 0 to 255: 6, or [6, 17]"))
}

fn by_curvature(value: &Value) -> Result<WrittenSpacing, String> {
    let what = "the spacing where it is flat, and at edges: { flat = 0.5, bent = 0.1 }";
    let table = value.as_table().filter(|table| table.len() == 2);
    let ends = table.and_then(|table| Some([table.get("flat")?, table.get("bent")?]));
    let [flat, bent] = ends.ok_or_else(|| expected("curvature", value, what))?;
    Ok(WrittenSpacing::Curvature {
        flat: length("flat", flat)?,
        bent: length("bent", bent)?,
    })
}

/// The condition that the attribute `key` is in a range.
fn attribute(key: &str, value: &Value) -> Result<WrittenCondition, String> {
    let range = match value {
        Value::Array(ends) => match ends.as_slice() {
            [low, high] => number(low).zip(number(high)).map(|(low, high)| [low, high]),
            _ => None,
        },
        one => number(one).map(|one| [one, one]),
    };
    let range = range.ok_or_else(|| {
        format!(
            "{key} = {value}: `{key}` is none of class, polygon, line, distance, height, curvature and spacing, and an \
             attribute has a range of numbers: intensity = [0, 100]"
        )
    })?;
    Ok(WrittenCondition::Attribute {
        name: key.to_owned(),
        range,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Result<WrittenRules, String> {
        WrittenRules::from_table(text.parse().unwrap(), Path::new("given/rules.toml"))
    }

    #[test]
    fn a_file_is_read_as_it_is_written() {
        let rules = parsed(
            r#"
            spacing = "30cm"
            gradation = 1.3
            [[rule]]
            class = [6, 17]
            polygon = "site.geojson"
            intensity = [0, 100.5]
            return_number = 1
            spacing = 0.1
            [[rule]]
            line = "/axis.wkt"
            distance = [0, "5m"]
            height = [-0.5, inf]
            curvature = { flat = 0.5, bent = "10cm" }
            "#,
        )
        .unwrap();
        let spacing = rules.spacing.as_ref().map(|(length, _)| *length);
        assert_eq!(spacing, "30cm".parse().ok());
        let [first, second] = rules.rules.as_slice() else {
            panic!("two rules: {rules:?}");
        };
        let attribute = |name: &str, range| WrittenCondition::Attribute {
            name: name.to_owned(),
            range,
        };
        for condition in [
            WrittenCondition::Class(vec![6, 17]),
            WrittenCondition::Polygon("given/site.geojson".into()),
            attribute("intensity", [0.0, 100.5]),
            attribute("return_number", [1.0, 1.0]),
        ] {
            assert!(first.conditions.contains(&condition), "{condition:?}");
        }
        assert_eq!(first.origin.rule, Some(1));
        assert!(second.conditions.contains(&WrittenCondition::Line {
            file: "/axis.wkt".into(),
            distance: [Length::plain(0.0), "5m".parse().unwrap()],
        }));
        assert_eq!(
            second.spacing,
            WrittenSpacing::Curvature {
                flat: Length::plain(0.5),
                bent: "10cm".parse().unwrap(),
            }
        );
        assert_eq!(rules.lengths().len(), 8);
    }

    #[test]
    fn messages_have_the_rule_the_key_and_the_remedy() {
        let second = "[[rule]]\nclass = 2\nspacing = 1\n[[rule]]\n";
        for (text, parts) in [
            ("spaceing = 1", &["`spaceing`", "gradation"][..]),
            ("spacing = 1", &["no rule", "[[rule]]"]),
            ("rule = 3", &["[[rule]]"]),
            ("rule = [3]", &["rule 1", "[[rule]]"]),
            ("gradation = \"steep\"", &["gradation = \"steep\"", "1.05"]),
            (
                "class = 256\nspacing = 1",
                &["rule 2", "class = 256", "0 to 255"],
            ),
            ("class = 6", &["rule 2", "no spacing"]),
            ("spacing = 1", &["rule 2", "no condition", "class = 6"]),
            (
                "class = 6\nspacing = \"5 miles\"",
                &["rule 2", "5 miles", "10cm"],
            ),
            (
                "height = 4\nspacing = 1",
                &["rule 2", "height = 4", "[0.3, 4]"],
            ),
            (
                "line = \"a.wkt\"\nspacing = 1",
                &["rule 2", "distance = [0, 5]"],
            ),
            ("distance = [0, 1]\nspacing = 1", &["rule 2", "line"]),
            (
                "polygon = 3\nspacing = 1",
                &["rule 2", "polygon = 3", "file"],
            ),
            (
                "intensity = \"high\"\nspacing = 1",
                &["rule 2", "intensity", "[0, 100]"],
            ),
            (
                "klass = [1, 2, 3]\nspacing = 1",
                &["rule 2", "`klass`", "class, polygon"],
            ),
            ("curvature = 1", &["rule 2", "curvature = 1", "flat = 0.5"]),
            (
                "curvature = { flat = 1, bent = 2, x = 3 }",
                &["rule 2", "curvature", "flat = 0.5"],
            ),
            (
                "class = 6\nspacing = 1\ncurvature = { flat = 1, bent = 1 }",
                &["rule 2", "one of them"],
            ),
        ] {
            let of_rule = parts[0] == "rule 2";
            let text = format!("{}{text}", if of_rule { second } else { "" });
            let error = parsed(&text).unwrap_err();
            assert!(parts.iter().all(|part| error.contains(part)), "{error}");
        }
    }
}
