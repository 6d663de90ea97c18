//! The options of a job: as written, and as meant.
//!
//! [`Choices`] is the form as written, in a TOML file or as flags: every option may be
//! missing, and lengths may have units of their own. [`Settings`] is the form as meant:
//! complete, within its ranges, all lengths in CRS units. [`Choices::settings`] leads from
//! the one to the other; everything below this module knows settings only.

mod choices;
mod error;
mod length;
mod meaning;
mod quantity;
mod rectangle;
mod rules;
mod settings;

pub(crate) use choices::Choices;
pub(crate) use error::ConfigError;
pub(crate) use length::Length;
pub(crate) use quantity::{Bytes, Count, Share};
pub(crate) use rectangle::Sides;
pub(crate) use rules::{ClassRule, ColorRule, Computed, OnBadFile};
pub(crate) use settings::{
    AttributeSettings, InputSettings, ResourceSettings, Settings, TilingSettings,
};
