//! Rules for the spacing: as written, in a file or in short, and as meant.
//!
//! ```text
//!   rules.toml     ─► WrittenRules ─► DensitySettings
//!   --spacing-of   ─►      (meaning: units, ranges, polygons, the ratio of all spacings)
//! ```

#[cfg(feature = "cli")]
mod file;
#[cfg(feature = "cli")]
mod meaning;
mod settings;
#[cfg(feature = "cli")]
mod short;
#[cfg(feature = "cli")]
mod written;

pub(crate) use settings::{Condition, DensityRule, DensitySettings, RuleSpacing};
#[cfg(test)]
pub(crate) use settings::{SEEN_BY_CURVATURE_IN_SPACINGS, SEEN_BY_HEIGHT_IN_SPACINGS};
#[cfg(feature = "cli")]
pub(super) use written::WrittenRules;
