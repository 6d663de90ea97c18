//! Rules for the spacing as meant.

use serde::{Deserialize, Serialize};

use crate::{
    las::{LineFilter, PolygonFilter},
    lloyd::Grading,
};

/// How far around a point the ground is sought that it stands on, in coarsest spacings.
pub(crate) const SEEN_BY_HEIGHT_IN_SPACINGS: f64 = 16.0;
/// How far around a point the surface is looked at for its curvature, in coarsest spacings.
pub(crate) const SEEN_BY_CURVATURE_IN_SPACINGS: f64 = 7.0;

/// Rules for the spacing as meant. Lengths are CRS units. If the job is to meet a count, all spacings are multiplied by
/// one factor, so that only their ratios matter.
///
/// Where several rules apply to a point the smallest spacing holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct DensitySettings {
    /// The spacing of points that no rule applies to.
    pub(crate) elsewhere: f64,
    /// How many times as long a cell may be as its neighbour, from 1.05 to 2.
    pub(crate) gradation: f64,
    /// The rules, in the order in which they are numbered from 1.
    pub(crate) rules: Vec<DensityRule>,
}

/// A rule for the spacing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct DensityRule {
    /// The conditions on points that the rule applies to; all of them must hold.
    pub(crate) conditions: Vec<Condition>,
    /// The spacing of these points.
    pub(crate) spacing: RuleSpacing,
}

/// A condition on a point. Both ends of a range are inside; [`f64::MAX`] stands for no end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Condition {
    /// The point has one of these classes.
    Class(Vec<u8>),
    /// The point lies in one of these polygons, seen from above.
    Within(PolygonFilter),
    /// The distance from the nearest of these lines, seen from above, is in a range (CRS units).
    Near {
        /// The lines.
        line: LineFilter,
        /// The range.
        distance: [f64; 2],
    },
    /// The height above the ground is in a range (CRS units).
    Height([f64; 2]),
    /// An attribute of the record is in a range.
    Attribute {
        /// Its name: `intensity`, `red`, …, or that of extra bytes.
        name: String,
        /// The range.
        range: [f64; 2],
    },
}

/// The spacing that a rule gives (CRS units).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum RuleSpacing {
    /// One spacing.
    Uniform(f64),
    /// A spacing that follows the curvature of the surface.
    Curvature {
        /// The spacing where the surface is flat: the largest.
        flat: f64,
        /// The spacing at edges: the smallest.
        bent: f64,
    },
}

impl RuleSpacing {
    /// The largest spacing that the rule gives.
    pub(crate) fn coarsest(self) -> f64 {
        match self {
            Self::Uniform(spacing) | Self::Curvature { flat: spacing, .. } => spacing,
        }
    }

    /// The smallest spacing that the rule gives.
    pub(crate) fn finest(self) -> f64 {
        match self {
            Self::Uniform(spacing) | Self::Curvature { bent: spacing, .. } => spacing,
        }
    }
}

impl DensityRule {
    /// Whether the rule looks at the points around a point, and not at its record alone.
    pub(crate) fn looks_around(&self) -> bool {
        let is_height = |condition: &Condition| matches!(condition, Condition::Height(_));
        self.conditions.iter().any(is_height)
            || matches!(self.spacing, RuleSpacing::Curvature { .. })
    }
}

impl DensitySettings {
    /// The largest of all spacings, that of points without a rule included (CRS units).
    pub(crate) fn coarsest(&self) -> f64 {
        let rules = self.rules.iter().map(|rule| rule.spacing.coarsest());
        rules.fold(self.elsewhere, f64::max)
    }

    /// The smallest of all spacings, that of points without a rule included (CRS units).
    pub(crate) fn finest(&self) -> f64 {
        let rules = self.rules.iter().map(|rule| rule.spacing.finest());
        rules.fold(self.elsewhere, f64::min)
    }

    /// `spacing` as a share of the coarsest: above 0, at most 1.
    pub(crate) fn share(&self, spacing: f64) -> f32 {
        ((spacing / self.coarsest()) as f32).min(1.0)
    }

    /// How the spacing varies, as the solver knows it; `None` if all spacings are the same.
    pub(crate) fn grading(&self) -> Option<Grading> {
        let has_height = |condition: &Condition| matches!(condition, Condition::Height(_));
        let seen = self.rules.iter().map(|rule| {
            let of_height = match rule.conditions.iter().any(has_height) {
                true => SEEN_BY_HEIGHT_IN_SPACINGS,
                false => 0.0,
            };
            match rule.spacing {
                RuleSpacing::Curvature { .. } => SEEN_BY_CURVATURE_IN_SPACINGS.max(of_height),
                RuleSpacing::Uniform(_) => of_height,
            }
        });
        let seen = seen.fold(0.0, f64::max);
        let finest = f64::from(self.share(self.finest()));
        (finest < 1.0).then(|| Grading::new(finest, self.gradation, seen))
    }

    /// Leaves out the corners of polygons and lines, which would fill a record of the settings.
    pub(crate) fn leave_out_outlines(&mut self) {
        for rule in &mut self.rules {
            for condition in &mut rule.conditions {
                match condition {
                    Condition::Within(polygons) => *polygons = PolygonFilter::from(Vec::new()),
                    Condition::Near { line, .. } => *line = LineFilter::from(Vec::new()),
                    _ => {}
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings() -> DensitySettings {
        let rule = |conditions, spacing| DensityRule {
            conditions,
            spacing,
        };
        let square = vec![vec![vec![(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 0.0)]]];
        DensitySettings {
            elsewhere: 0.3,
            gradation: 1.2,
            rules: vec![
                rule(
                    vec![
                        Condition::Class(vec![2, 6]),
                        Condition::Within(PolygonFilter::from(square)),
                    ],
                    RuleSpacing::Uniform(0.6),
                ),
                rule(
                    vec![Condition::Near {
                        line: LineFilter::from(vec![vec![[0.0, 0.0], [1.0, 2.5]]]),
                        distance: [0.0, f64::MAX],
                    }],
                    RuleSpacing::Curvature {
                        flat: 0.2,
                        bent: 0.15,
                    },
                ),
            ],
        }
    }

    #[test]
    fn spacings_are_shares_of_the_coarsest() {
        let settings = settings();
        assert_eq!((settings.coarsest(), settings.finest()), (0.6, 0.15));
        assert_eq!(settings.share(0.6), 1.0);
        assert_eq!(settings.share(0.3), 0.5);
        assert!(!settings.rules[0].looks_around() && settings.rules[1].looks_around());
    }

    #[test]
    fn rules_survive_storing_and_lose_only_their_outlines() {
        let mut settings = settings();
        let text = serde_json::to_string(&settings).unwrap();
        assert_eq!(
            serde_json::from_str::<DensitySettings>(&text).unwrap(),
            settings
        );
        settings.leave_out_outlines();
        let short = serde_json::to_string(&settings).unwrap();
        assert!(!short.contains("2.5") && !short.contains("4.0") && short.contains("0.15"));
    }
}
