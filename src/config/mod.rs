//! The options of a job: as written, and as meant.
//!
//! `Choices` is the form as written, in a TOML file or as flags: every option may be
//! missing, and lengths may have units of their own. [`Settings`] is the form as meant:
//! complete, within its ranges, all lengths in CRS units. `Choices::settings` leads from
//! the one to the other; everything below this module knows settings only.
//!
//! Only the program reads choices; the library begins with settings.

#[cfg(feature = "cli")]
mod choices;
#[cfg(feature = "cli")]
mod crs_unit;
mod density;
mod error;
#[cfg(feature = "cli")]
mod length;
#[cfg(feature = "cli")]
mod meaning;
#[cfg(feature = "cli")]
mod places;
#[cfg(feature = "cli")]
mod quantity;
#[cfg(feature = "cli")]
mod rectangle;
mod rules;
mod settings;
#[cfg(feature = "cli")]
mod target;

#[cfg(feature = "cli")]
pub(crate) use choices::{Choices, OnBadFile, TransientRule};
pub(crate) use density::{Condition, DensityRule, DensitySettings, RuleSpacing};
#[cfg(test)]
pub(crate) use density::{SEEN_BY_CURVATURE_IN_SPACINGS, SEEN_BY_HEIGHT_IN_SPACINGS};
pub(crate) use error::ConfigError;
#[cfg(feature = "cli")]
pub(crate) use length::Length;
#[cfg(feature = "cli")]
pub(crate) use places::Places;
#[cfg(feature = "cli")]
pub(crate) use quantity::{Bytes, Count, Share};
#[cfg(feature = "cli")]
pub(crate) use rectangle::Sides;
pub(crate) use rules::{ClassRule, ColorRule, Computed};
pub(crate) use settings::{
    AttributeSettings, InputSettings, MeshSettings, ResourceSettings, Settings, TilingSettings,
    TransientSettings,
};
