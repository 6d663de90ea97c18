//! What rules for the spacing mean: ranges, units, and the files that they name.

use super::{
    settings::{Condition, DensityRule, DensitySettings, RuleSpacing},
    written::{Origin, WrittenCondition, WrittenRule, WrittenRules, WrittenSpacing},
};
use crate::{
    config::{
        crs_unit::{CrsUnit, UNKNOWN_UNIT},
        error::ConfigError,
        length::Length,
    },
    las::{LineFilter, PolygonFilter},
};

/// The gradation where none is given.
const USUAL_GRADATION: f64 = 1.15;
/// The range of gradations. Below it the field needs hundreds of spacings from the finest to the coarsest; beyond it
/// neighbouring cells are too unlike for the even spacing that the solver makes.
const GRADATIONS: std::ops::RangeInclusive<f64> = 1.05..=2.0;
/// The largest ratio of the coarsest spacing to the finest.
const LARGEST_RATIO: f64 = 64.0;
/// The largest number of rules that look at the points around a point: each is a bit in the tag of a point.
const MOST_RULES_AROUND: usize = 16;

impl Origin {
    /// The error that something written here cannot be used.
    fn wrong(&self, problem: String) -> ConfigError {
        let of_rule = self.rule.map(|rule| format!("rule {rule}: "));
        ConfigError::Named {
            option: self.option,
            value: self.value.clone(),
            problem: of_rule.unwrap_or_default() + &problem,
        }
    }

    /// The rule that is written here, in words.
    fn in_words(&self) -> String {
        match self.rule {
            Some(rule) => format!("rule {rule} of {}", self.value),
            None => format!("{} {}", self.option, self.value),
        }
    }
}

impl WrittenRules {
    /// Returns what these rules mean. `spacing` is that of points without a rule, if it is given besides, and
    /// `gradation` replaces that of the file.
    ///
    /// # Errors
    ///
    /// [`ConfigError::Named`] or [`ConfigError::Value`] for a value out of its range, a file that cannot be used, or
    /// a length whose unit cannot be converted.
    pub(in crate::config) fn settings(
        &self,
        unit: CrsUnit,
        spacing: Option<f64>,
        gradation: Option<f64>,
    ) -> Result<DensitySettings, ConfigError> {
        let rules = self.rules.iter().map(|rule| meant(rule, unit));
        let rules: Vec<DensityRule> = rules.collect::<Result<_, _>>()?;
        let origin = |index: usize| &self.rules[index].origin;

        // Points without a rule have the coarsest spacing of the rules if nothing else is said.
        let of_file = self.spacing.as_ref().map(|(length, origin)| {
            let meant = positive("spacing", *length, unit);
            meant.map_err(|problem| origin.wrong(problem))
        });
        let of_file = of_file.transpose()?;
        let coarsest = rules.iter().map(|rule| rule.spacing.coarsest());
        let coarsest = coarsest.fold(0.0, f64::max);
        let settings = DensitySettings {
            elsewhere: spacing.or(of_file).unwrap_or(coarsest),
            gradation: self.gradation(gradation)?,
            rules,
        };

        // Refuse spacings that are too different, and too many rules that take a search each.
        let (coarsest, finest) = (settings.coarsest(), settings.finest());
        if coarsest > LARGEST_RATIO * finest {
            let named = |is_it: &dyn Fn(RuleSpacing) -> bool| {
                let found = settings.rules.iter().position(|rule| is_it(rule.spacing));
                let elsewhere = || "the spacing where no rule applies".to_owned();
                found.map_or_else(elsewhere, |index| origin(index).in_words())
            };
            return Err(ConfigError::Words(format!(
                "the coarsest spacing, {coarsest} ({}), is more than {LARGEST_RATIO} times the finest, {finest} ({}); \
                 bring them nearer to each other",
                named(&|spacing| spacing.coarsest() == coarsest),
                named(&|spacing| spacing.finest() == finest),
            )));
        }
        let around = settings.rules.iter().filter(|rule| rule.looks_around());
        let around = around.count();
        if around > MOST_RULES_AROUND {
            return Err(ConfigError::Words(format!(
                "{around} rules depend on the height above ground or on curvature; {MOST_RULES_AROUND} may"
            )));
        }
        Ok(settings)
    }

    /// The gradation: `given`, or else that of the file, or else the usual one.
    fn gradation(&self, given: Option<f64>) -> Result<f64, ConfigError> {
        let remedy = "must be from 1.05 to 2";
        let of_file = self.gradation.as_ref();
        match (given, of_file) {
            (Some(value), _) if !GRADATIONS.contains(&value) => Err(ConfigError::Value {
                option: "--gradation",
                value: value.to_string(),
                remedy,
            }),
            (None, Some((value, origin))) if !GRADATIONS.contains(value) => {
                Err(origin.wrong(format!("gradation = {value} {remedy}")))
            }
            (given, of_file) => Ok(given
                .or(of_file.map(|(value, _)| *value))
                .unwrap_or(USUAL_GRADATION)),
        }
    }
}

/// What a rule means.
fn meant(rule: &WrittenRule, unit: CrsUnit) -> Result<DensityRule, ConfigError> {
    let wrong = |problem| rule.origin.wrong(problem);
    let spacing = match rule.spacing {
        WrittenSpacing::Uniform(spacing) => {
            RuleSpacing::Uniform(positive("spacing", spacing, unit).map_err(wrong)?)
        }
        WrittenSpacing::Curvature { flat, bent } => {
            let flat = positive("flat", flat, unit).map_err(wrong)?;
            let bent = positive("bent", bent, unit).map_err(wrong)?;
            if bent > flat {
                return Err(wrong(format!(
                    "curvature: bent = {bent} is more than flat = {flat}; where it is bent points are denser"
                )));
            }
            RuleSpacing::Curvature { flat, bent }
        }
    };
    let conditions = rule
        .conditions
        .iter()
        .map(|written| condition(written, unit));
    let conditions: Vec<Condition> = conditions.collect::<Result<_, _>>().map_err(wrong)?;
    Ok(DensityRule {
        conditions,
        spacing,
    })
}

/// What a condition means.
fn condition(written: &WrittenCondition, unit: CrsUnit) -> Result<Condition, String> {
    Ok(match written {
        WrittenCondition::Class(classes) => Condition::Class(classes.clone()),
        WrittenCondition::Polygon(file) => {
            let polygons = PolygonFilter::from_file(file);
            let named = |problem| format!("polygon = {}: {problem}", file.display());
            Condition::Within(polygons.map_err(named)?)
        }
        WrittenCondition::Line { file, distance } => {
            let line = LineFilter::from_file(file);
            let named = |problem| format!("line = {}: {problem}", file.display());
            Condition::Near {
                line: line.map_err(named)?,
                distance: lengths("distance", distance, unit)?,
            }
        }
        WrittenCondition::Height(heights) => Condition::Height(lengths("height", heights, unit)?),
        WrittenCondition::Attribute { name, range } => Condition::Attribute {
            name: name.clone(),
            range: ordered(name, *range)?,
        },
    })
}

/// The length of `key` in CRS units.
///
/// # Errors
///
/// A text that says what is wrong unless it is finite and above zero.
fn positive(key: &str, length: Length, unit: CrsUnit) -> Result<f64, String> {
    match unit.of(length) {
        None => Err(format!("{key} = {length}: {UNKNOWN_UNIT}")),
        Some(value) if value > 0.0 && value.is_finite() => Ok(value),
        Some(_) => Err(format!(
            "{key} = {length} must be a length above zero, such as 0.1"
        )),
    }
}

/// The range of lengths of `key` in CRS units.
fn lengths(key: &str, range: &[Length; 2], unit: CrsUnit) -> Result<[f64; 2], String> {
    let convert = |length: Length| {
        unit.of(length)
            .ok_or_else(|| format!("{key} = {length}: {UNKNOWN_UNIT}"))
    };
    ordered(key, [convert(range[0])?, convert(range[1])?])
}

/// The range of `key`, whose ends are in order.
///
/// # Errors
///
/// A text that says that nothing is in the range.
fn ordered(key: &str, range: [f64; 2]) -> Result<[f64; 2], String> {
    // Infinite ends become the largest numbers, which JSON can store.
    let [low, high] = range.map(|end| end.clamp(f64::MIN, f64::MAX));
    match low <= high {
        true => Ok([low, high]),
        false => Err(format!(
            "{key} = [{}, {}] is empty; the smaller number comes first",
            range[0], range[1]
        )),
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    const METRES: CrsUnit = CrsUnit { metres: Some(1.0) };

    /// The settings that a file of these rules makes, with what stands in other files of its directory.
    fn settings_with(
        text: &str,
        files: &[(&str, &str)],
        unit: CrsUnit,
        spacing: Option<f64>,
    ) -> Result<DensitySettings, String> {
        let dir = tempfile::tempdir().unwrap();
        for (name, content) in files {
            fs::write(dir.path().join(name), content).unwrap();
        }
        let path = dir.path().join("rules.toml");
        fs::write(&path, text).unwrap();
        let rules = WrittenRules::from_file(&path).map_err(|e| e.to_string())?;
        let settings = rules.settings(unit, spacing, None);
        settings.map_err(|e| e.to_string())
    }

    #[test]
    fn units_are_converted_and_files_become_coordinates() {
        let text = "gradation = 1.5\n[[rule]]\npolygon = \"p.wkt\"\nline = \"l.wkt\"\ndistance = [0, \"1ft\"]\n\
                    height = [-inf, 2]\nspacing = \"10cm\"";
        let files = [
            ("p.wkt", "POLYGON ((0 0, 9 0, 9 9, 0 0))"),
            ("l.wkt", "LINESTRING (0 0, 1 1)"),
        ];
        let feet = CrsUnit {
            metres: Some(0.3048),
        };
        let settings = settings_with(text, &files, feet, None).unwrap();
        assert!((settings.elsewhere - 0.1 / 0.3048).abs() < 1e-12);
        assert_eq!(settings.gradation, 1.5);
        let conditions = &settings.rules[0].conditions;
        assert!(conditions.contains(&Condition::Height([f64::MIN, 2.0])));
        let is_near = |condition: &Condition| matches!(condition, Condition::Near { distance, .. } if (distance[1] - 1.0).abs() < 1e-9);
        assert!(conditions.iter().any(is_near));
        let stored = serde_json::to_string(&settings).unwrap();
        assert_eq!(
            serde_json::from_str::<DensitySettings>(&stored).unwrap(),
            settings
        );
    }

    #[test]
    fn the_spacing_elsewhere_is_the_option_or_that_of_the_file_or_the_coarsest() {
        let rules = "[[rule]]\nclass = 2\nspacing = 0.5\n[[rule]]\nclass = 6\nspacing = 0.1";
        let elsewhere = |text: &str, spacing| {
            let settings = settings_with(text, &[], METRES, spacing).unwrap();
            (settings.elsewhere, settings.coarsest())
        };
        assert_eq!(elsewhere(rules, None), (0.5, 0.5));
        let with_spacing = format!("spacing = 0.3\n{rules}");
        assert_eq!(elsewhere(&with_spacing, None), (0.3, 0.5));
        assert_eq!(elsewhere(&with_spacing, Some(0.8)), (0.8, 0.8));
    }

    #[test]
    fn values_out_of_range_are_refused_with_file_rule_and_key() {
        let rule = |line: &str| format!("[[rule]]\nclass = 2\nspacing = 1\n[[rule]]\n{line}\n");
        for (text, parts) in [
            (
                rule("class = 6\nspacing = 0"),
                &["rule 2", "spacing = 0", "above zero"][..],
            ),
            (rule("class = 6\nspacing = nan"), &["rule 2", "above zero"]),
            (
                rule("height = [4, 0.3]\nspacing = 1"),
                &["rule 2", "height = [4, 0.3]", "empty"],
            ),
            (
                rule("intensity = [nan, 3]\nspacing = 1"),
                &["rule 2", "intensity", "empty"],
            ),
            (
                rule("polygon = \"none.wkt\"\nspacing = 1"),
                &["rule 2", "none.wkt", "cannot be read"],
            ),
            (
                rule("line = \"rules.toml\"\ndistance = [0, 1]\nspacing = 1"),
                &["rule 2", "line = ", "well-known"],
            ),
            (
                rule("curvature = { flat = 0.1, bent = 0.5 }"),
                &["rule 2", "bent = 0.5", "denser"],
            ),
            (
                rule("class = 6\nspacing = 0.01"),
                &["coarsest spacing, 1 (rule 1", "finest, 0.01 (rule 2", "64"],
            ),
            (
                format!("gradation = 3\n{}", rule("class = 6\nspacing = 1")),
                &["gradation = 3", "1.05 to 2"],
            ),
            (
                format!("spacing = -1\n{}", rule("class = 6\nspacing = 1")),
                &["rules.toml: spacing = -1", "above zero"],
            ),
            (
                (0..17)
                    .map(|_| "[[rule]]\nheight = [0, 1]\nspacing = 1\n")
                    .collect(),
                &["17 rules", "16 may"],
            ),
        ] {
            let error = settings_with(&text, &[], METRES, None).unwrap_err();
            assert!(parts.iter().all(|part| error.contains(part)), "{error}");
            let in_rule = parts[0] != "rule 2" || error.contains("rules.toml: rule 2");
            assert!(in_rule, "{error}");
        }
        let unit = CrsUnit { metres: None };
        let text = rule("class = 6\nspacing = \"10cm\"");
        let error = settings_with(&text, &[], unit, None).unwrap_err();
        assert!(error.contains("10cm") && error.contains("--crs"), "{error}");
    }
}
