//! What choices mean for how dense the output is to be: a spacing, a count, rules.

use super::{
    choices::Choices,
    crs_unit::CrsUnit,
    density::{DensitySettings, WrittenRules},
    error::ConfigError,
};
use crate::{lloyd::SeedRule, spacing::Target};

impl Choices {
    /// Returns whether a density of the output is asked for.
    pub(crate) fn has_density(&self) -> bool {
        self.spacing.is_some() || self.count.is_some() || self.ratio.is_some() || self.has_rules()
    }

    /// Returns whether the spacing follows rules.
    fn has_rules(&self) -> bool {
        self.density.is_some() || self.spacing_of.is_some()
    }

    /// Returns the rules of the spacing as written: those of the file, then those of `--spacing-of`.
    ///
    /// # Errors
    ///
    /// [`ConfigError::Named`] and [`ConfigError::Parse`] if they cannot be read.
    pub(super) fn rules(&self) -> Result<WrittenRules, ConfigError> {
        let mut rules = match &self.density {
            Some(path) => WrittenRules::from_file(path)?,
            None => WrittenRules::default(),
        };
        rules.add_short(self.spacing_of.as_deref().unwrap_or_default())?;
        Ok(rules)
    }

    /// Returns the rules of the spacing as meant, if it follows rules.
    ///
    /// # Errors
    ///
    /// As for [`settings`](Self::settings).
    pub(super) fn density(&self, unit: CrsUnit) -> Result<Option<DensitySettings>, ConfigError> {
        if !self.has_rules() {
            return match self.gradation {
                None => Ok(None),
                Some(_) => Err(ConfigError::Words(
                    "--gradation says how fast the spacing of rules changes; give --density or --spacing-of, too"
                        .into(),
                )),
            };
        }
        let spacing = unit.positive("--spacing", self.spacing)?;
        let density = self.rules()?.settings(unit, spacing, self.gradation)?;
        Ok(Some(density))
    }

    /// Checks the options that want one spacing for the whole cloud.
    ///
    /// # Errors
    ///
    /// [`ConfigError::Words`] if the spacing follows rules and an option cannot.
    pub(super) fn check_with_rules(&self) -> Result<(), ConfigError> {
        let problems = [
            (
                self.mesh.is_some(),
                "--mesh makes triangles of one size, and the spacing follows rules; leave out --mesh, or --density and --spacing-of",
            ),
            (
                !self.accelerate.unwrap_or_default().has_rounds(),
                "--accelerate anderson mixes sites of one spacing, and the spacing follows rules; give --accelerate none or relaxation",
            ),
            (
                !self.seeds.is_none_or(SeedRule::is_election),
                "--seeds area and random know one spacing, and the spacing follows rules; give --seeds hexagonal or poisson",
            ),
        ];
        match problems.into_iter().find(|(is_one, _)| *is_one) {
            Some((_, words)) => Err(ConfigError::Words(words.into())),
            None => Ok(()),
        }
    }

    /// Returns how dense the output is to be. With rules it is the coarsest spacing.
    pub(super) fn target(
        &self,
        unit: CrsUnit,
        density: Option<&DensitySettings>,
    ) -> Result<Target, ConfigError> {
        let targets = [
            unit.positive("--spacing", self.spacing)?
                .map(Target::Spacing),
            self.count.map(|count| Target::Count(count.0)),
            self.ratio.map(|ratio| Target::Ratio(ratio.0)),
        ];
        let given: Vec<Target> = targets.into_iter().flatten().collect();
        let coarsest = density.map(|density| Target::Spacing(density.coarsest()));
        match given.as_slice() {
            [Target::Count(0)] => Err(ConfigError::Value {
                option: "--count",
                value: "0".into(),
                remedy: "must be at least 1",
            }),
            &[Target::Spacing(spacing)] => Ok(coarsest.unwrap_or(Target::Spacing(spacing))),
            &[target] => Ok(target),
            [] => coarsest.ok_or(ConfigError::Target { given: 0 }),
            _ => Err(ConfigError::Target { given: given.len() }),
        }
    }

    /// Returns whether the count is met exactly.
    pub(super) fn exact(&self) -> Result<bool, ConfigError> {
        let words = |words: &str| Err(ConfigError::Words(words.into()));
        if self.exact && self.spacing.is_some() {
            return words(
                "--exact meets a number of points; give --count or --ratio in place of --spacing",
            );
        }
        if self.exact && !self.accelerate.unwrap_or_default().has_rounds() {
            return words(
                "--exact needs --accelerate none or relaxation: Anderson mixing cannot go on after points have left",
            );
        }
        Ok(self.exact)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Length;

    #[test]
    fn exactly_one_target_is_wanted() {
        assert!(Choices::default().settings(None).is_err());
        let two = Choices {
            ratio: "0.5".parse().ok(),
            ..Choices::with_spacing(1.0)
        };
        assert!(two.settings(None).is_err());
        assert!(Choices::with_spacing(1.0).settings(None).is_ok());
    }

    #[test]
    fn the_spacing_of_short_rules_is_that_of_points_without_a_rule_or_the_coarsest() {
        let rules = |spacing: Option<f64>| Choices {
            spacing: spacing.map(Length::plain),
            spacing_of: Some(vec!["class=2:50cm".into(), "6:0.1".into()]),
            ..Choices::default()
        };
        assert!(rules(None).has_density() && rules(None).has_units());
        let settings = rules(None).settings(Some(1.0)).unwrap();
        assert_eq!(settings.target, Target::Spacing(0.5));
        assert_eq!(settings.density.unwrap().gradation, 1.15);
        let settings = rules(Some(0.8)).settings(Some(1.0)).unwrap();
        assert_eq!(settings.target, Target::Spacing(0.8));
        assert_eq!(settings.density.unwrap().coarsest(), 0.8);
        let counted = Choices {
            count: "2M".parse().ok(),
            gradation: Some(1.5),
            ..rules(None)
        };
        let settings = counted.settings(Some(1.0)).unwrap();
        assert_eq!(settings.target, Target::Count(2_000_000));
        let density = settings.density.unwrap();
        assert_eq!((density.elsewhere, density.gradation), (0.5, 1.5));
    }

    #[test]
    fn a_gradation_is_within_its_range_and_stands_with_rules() {
        let gradation = |gradation, spacing_of| Choices {
            gradation: Some(gradation),
            spacing_of,
            ..Choices::with_spacing(1.0)
        };
        let rules = || Some(vec!["class=2:0.5".into()]);
        let error = |choices: Choices| choices.settings(None).unwrap_err().to_string();
        let alone = error(gradation(1.2, None));
        assert!(alone.contains("--density or --spacing-of"), "{alone}");
        for bad in [1.0, 2.5, f64::NAN] {
            let error = error(gradation(bad, rules()));
            assert!(
                error.contains("--gradation") && error.contains("1.05 to 2"),
                "{error}"
            );
        }
        let missing = Choices {
            density: Some("none/rules.toml".into()),
            ..Choices::with_spacing(1.0)
        };
        assert!(!missing.has_units());
        let error = error(missing);
        assert!(
            error.starts_with("--density none/rules.toml: cannot be read"),
            "{error}"
        );
    }
}
