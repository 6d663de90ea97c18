//! The unit of the CRS, to which lengths are converted.

use super::{error::ConfigError, length::Length};

/// The unit of the CRS, to which lengths are converted.
#[derive(Clone, Copy, Debug)]
pub(super) struct CrsUnit {
    /// Its length in metres; `None` if it is not known.
    pub(super) metres: Option<f64>,
}

/// What to do about a length with a unit if that of the CRS is not known.
pub(super) const UNKNOWN_UNIT: &str =
    "the inputs state no CRS, and so no unit; give --crs, or a plain number";

impl CrsUnit {
    /// Returns `length` in CRS units; `None` if it has a unit, and that of the CRS is not known.
    pub(super) fn of(self, length: Length) -> Option<f64> {
        match length.unit {
            None => Some(length.value),
            Some(unit) => Some(length.value * unit.metres() / self.metres?),
        }
    }

    /// Returns `length`, the value of `option`, in CRS units, if it is given.
    ///
    /// # Errors
    ///
    /// [`ConfigError::Value`] unless it is finite and above zero, or if it has a unit, and that of the CRS is not
    /// known.
    pub(super) fn positive(
        self,
        option: &'static str,
        length: Option<Length>,
    ) -> Result<Option<f64>, ConfigError> {
        let Some(length) = length else {
            return Ok(None);
        };
        let wrong = |value: String, remedy| ConfigError::Value {
            option,
            value,
            remedy,
        };
        match self.of(length) {
            None => Err(wrong(length.to_string(), UNKNOWN_UNIT)),
            // Written so that NaN fails.
            Some(value) if !(value > 0.0 && value.is_finite()) => Err(wrong(
                value.to_string(),
                "must be a length above zero, in CRS units",
            )),
            Some(value) => Ok(Some(value)),
        }
    }
}
