//! Rules for the spacing as written.

use std::path::PathBuf;

use crate::config::length::Length;

/// Rules for the spacing as written.
#[derive(Clone, Debug, Default, PartialEq)]
pub(in crate::config) struct WrittenRules {
    /// The spacing of points that no rule applies to, and where that is written.
    pub(super) spacing: Option<(Length, Origin)>,
    /// How many times as long a cell may be as its neighbour, and where that is written.
    pub(super) gradation: Option<(f64, Origin)>,
    /// The rules: those of the file, then the short ones.
    pub(super) rules: Vec<WrittenRule>,
}

/// Where something is written: the option, its value, and the number of the rule.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Origin {
    /// `--density` or `--spacing-of`.
    pub(super) option: &'static str,
    /// The file, or the short rule.
    pub(super) value: String,
    /// The number of the rule in the file, from 1.
    pub(super) rule: Option<usize>,
}

/// A rule as written.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct WrittenRule {
    /// Where it is written.
    pub(super) origin: Origin,
    /// The conditions on points that it applies to.
    pub(super) conditions: Vec<WrittenCondition>,
    /// The spacing of these points.
    pub(super) spacing: WrittenSpacing,
}

/// A condition as written.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum WrittenCondition {
    /// Classes.
    Class(Vec<u8>),
    /// A file of polygons.
    Polygon(PathBuf),
    /// A file of lines, and a range of distances.
    Line {
        /// The file.
        file: PathBuf,
        /// The range.
        distance: [Length; 2],
    },
    /// A range of heights above the ground.
    Height([Length; 2]),
    /// The name of an attribute, and a range of its values.
    Attribute {
        /// The name.
        name: String,
        /// The range.
        range: [f64; 2],
    },
}

/// The spacing of a rule as written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum WrittenSpacing {
    /// One spacing.
    Uniform(Length),
    /// A spacing that follows the curvature.
    Curvature {
        /// The spacing where the surface is flat.
        flat: Length,
        /// The spacing at edges.
        bent: Length,
    },
}

impl WrittenRules {
    /// Returns all lengths of the rules.
    pub(in crate::config) fn lengths(&self) -> Vec<Length> {
        let mut lengths: Vec<Length> = self.spacing.iter().map(|(length, _)| *length).collect();
        for rule in &self.rules {
            match rule.spacing {
                WrittenSpacing::Uniform(spacing) => lengths.push(spacing),
                WrittenSpacing::Curvature { flat, bent } => lengths.extend([flat, bent]),
            }
            for condition in &rule.conditions {
                if let WrittenCondition::Height(range)
                | WrittenCondition::Line {
                    distance: range, ..
                } = condition
                {
                    lengths.extend(range);
                }
            }
        }
        lengths
    }
}
