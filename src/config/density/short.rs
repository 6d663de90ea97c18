//! Rules for the spacing in short, as `--spacing-of` has them.
//!
//! ```text
//!   class=2:0.5,6,17:0.1,height=0.3..4:10cm
//!   └───┘ │  │  └──┘
//!   what  │  │  values that share a spacing
//!         │  spacing
//!         value
//! ```

use super::written::{Origin, WrittenCondition, WrittenRule, WrittenRules, WrittenSpacing};
use crate::config::{error::ConfigError, length::Length};

const OPTION: &str = "--spacing-of";

impl WrittenRules {
    /// Adds the rules that `texts` have in short, one or several each.
    ///
    /// # Errors
    ///
    /// [`ConfigError::Named`] with the part that cannot be understood.
    pub(in crate::config) fn add_short(&mut self, texts: &[String]) -> Result<(), ConfigError> {
        let all = texts.join(",");
        let mut name = "";
        // The conditions that wait for the spacing that they share with the next one.
        let mut waiting: Vec<WrittenCondition> = Vec::new();
        let parts: Vec<&str> = all.split(',').map(str::trim).collect();
        for (index, &part) in parts.iter().enumerate().filter(|_| !texts.is_empty()) {
            let wrong = |problem: String| ConfigError::Named {
                option: OPTION,
                value: part.to_owned(),
                problem,
            };

            // The name stands before the first of its values.
            let (begins, rest) = match part.split_once('=') {
                Some((given, rest)) => {
                    name = given.trim();
                    (true, rest)
                }
                None => (false, part),
            };
            if name.is_empty() {
                let example = "does not say of what; write it like class=2:0.5,6:0.1";
                return Err(wrong(example.into()));
            }
            if begins && !waiting.is_empty() {
                let before = format!("stands after `{}`, which has no spacing", parts[index - 1]);
                return Err(wrong(format!("{before}; write it like class=2:0.5,6:0.1")));
            }

            // The spacing stands after the last of the values that share it. A file may have a colon in its
            // name.
            let (value, spacing) = match rest.rsplit_once(':') {
                Some((value, spacing)) => (value, Some(spacing)),
                None => (rest, None),
            };
            waiting.push(condition(name, value.trim()).map_err(wrong)?);
            let Some(spacing) = spacing else {
                if index + 1 == parts.len() {
                    return Err(wrong("has no spacing; write it like class=6:0.1".into()));
                }
                continue;
            };
            let spacing: Length = spacing.parse().map_err(wrong)?;
            let origin = Origin {
                option: OPTION,
                value: part.to_owned(),
                rule: None,
            };
            let rules = joined(waiting).into_iter().map(|condition| WrittenRule {
                origin: origin.clone(),
                conditions: vec![condition],
                spacing: WrittenSpacing::Uniform(spacing),
            });
            self.rules.extend(rules);
            waiting = Vec::new();
        }
        Ok(())
    }
}

/// The condition that what is named `name` has this `value`.
///
/// # Errors
///
/// A text that says how such a condition is written.
fn condition(name: &str, value: &str) -> Result<WrittenCondition, String> {
    match name {
        "class" => {
            let class = value.parse();
            let class = class.map_err(|_| {
                format!("`{value}` is no class, a number from 0 to 255; write it like class=2:0.5")
            })?;
            Ok(WrittenCondition::Class(vec![class]))
        }
        "polygon" => Ok(WrittenCondition::Polygon(value.into())),
        "height" => Ok(WrittenCondition::Height(range(name, value)?)),
        "line" | "distance" | "curvature" => Err(format!(
            "a rule of `{name}` has no short form; write it into a file for --density"
        )),
        _ => Ok(WrittenCondition::Attribute {
            name: name.to_owned(),
            range: range(name, value)?,
        }),
    }
}

/// The range from `a` to `b` that `a..b` stands for, or from `a` to `a` for `a` alone.
fn range<T: std::str::FromStr + Copy>(name: &str, value: &str) -> Result<[T; 2], String> {
    let (low, high) = value.split_once("..").unwrap_or((value, value));
    let ends = [low, high].map(|end| end.trim().parse().ok());
    match ends {
        [Some(low), Some(high)] => Ok([low, high]),
        _ => Err(format!(
            "`{value}` is no range; write it like {name}=0.5..4:0.1"
        )),
    }
}

/// `conditions` that share a spacing, those on the class as one.
fn joined(conditions: Vec<WrittenCondition>) -> Vec<WrittenCondition> {
    let mut all: Vec<WrittenCondition> = Vec::new();
    for condition in conditions {
        match (all.last_mut(), condition) {
            (Some(WrittenCondition::Class(known)), WrittenCondition::Class(more)) => {
                known.extend(more);
            }
            (_, condition) => all.push(condition),
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rules(texts: &[&str]) -> Result<Vec<WrittenRule>, ConfigError> {
        let mut rules = WrittenRules::default();
        let texts: Vec<String> = texts.iter().map(|&text| text.to_owned()).collect();
        rules.add_short(&texts)?;
        Ok(rules.rules)
    }

    #[test]
    fn parts_are_read_together_however_they_are_separated() {
        let all = rules(&[
            "class=2:0.5,6,17:10cm,height=-0.3..4:0.1",
            "intensity=0..100:0.2",
        ]);
        let all = all.unwrap();
        let conditions: Vec<&WrittenCondition> =
            all.iter().flat_map(|rule| &rule.conditions).collect();
        assert_eq!(conditions.len(), 4);
        assert_eq!(*conditions[0], WrittenCondition::Class(vec![2]));
        assert_eq!(*conditions[1], WrittenCondition::Class(vec![6, 17]));
        let height = [-0.3, 4.0].map(Length::plain);
        assert_eq!(*conditions[2], WrittenCondition::Height(height));
        let ten = WrittenSpacing::Uniform("10cm".parse().unwrap());
        assert_eq!(all[1].spacing, ten);
        let apart = [
            "class=2:0.5",
            "6",
            "17:10cm",
            "height=-0.3..4:0.1",
            "intensity=0..100:0.2",
        ];
        assert_eq!(rules(&apart).unwrap(), all);
        let file = rules(&["polygon=C:/site.geojson:0.1"]).unwrap();
        let path = WrittenCondition::Polygon("C:/site.geojson".into());
        assert_eq!(file[0].conditions, [path]);
        assert_eq!(rules(&[]).unwrap(), []);
    }

    #[test]
    fn what_is_not_understood_is_named() {
        for (text, part, why) in [
            ("2:0.5", "--spacing-of 2:0.5", "class=2:0.5"),
            ("class=2:0.5,6", "--spacing-of 6", "no spacing"),
            (
                "class=2,height=1..2:0.1",
                "height",
                "`class=2`, which has no spacing",
            ),
            ("class=300:0.5", "class=300:0.5", "0 to 255"),
            ("class=2:fine", "class=2:fine", "`fine` is not a length"),
            ("height=low:1", "height=low:1", "`low` is no range"),
            ("line=axis.wkt:1", "line=axis.wkt:1", "--density"),
            ("", "--spacing-of ", "class=2:0.5"),
        ] {
            let error = rules(&[text]).unwrap_err().to_string();
            assert!(error.contains(part) && error.contains(why), "{error}");
        }
    }
}
