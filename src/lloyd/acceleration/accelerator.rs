//! An acceleration together with its memory.

use super::{
    anderson::Anderson,
    iterate::Iterate,
    method::Acceleration,
    relaxation::{Memory, Relaxation},
};
use crate::geometry::{Local, Stored};

/// An acceleration with its memory of past iterations.
pub(crate) enum Accelerator {
    None,
    Relaxation(Relaxation),
    Anderson(Box<Anderson>),
}

impl Accelerator {
    /// An accelerator without memory for the sites of `identities`; `scale` is that of the
    /// quantization, `spacing` that of the output (both CRS units).
    pub(crate) fn new(
        acceleration: Acceleration,
        identities: &[Stored],
        scale: f64,
        spacing: f64,
    ) -> Self {
        match acceleration {
            Acceleration::None => Self::None,
            Acceleration::Relaxation => Self::Relaxation(Relaxation::new(identities.len())),
            Acceleration::Anderson => {
                Self::Anderson(Box::new(Anderson::local(identities, scale, spacing)))
            }
            Acceleration::AndersonGlobal => {
                Self::Anderson(Box::new(Anderson::global(identities, scale)))
            }
        }
    }

    /// The accelerator that goes on with what over-relaxation remembers of each site.
    pub(crate) fn resume(acceleration: Acceleration, memories: Vec<Option<Memory>>) -> Self {
        match acceleration {
            Acceleration::Relaxation => {
                let memories = memories.into_iter().map(Option::unwrap_or_default);
                Self::Relaxation(Relaxation::resume(memories.collect()))
            }
            _ => Self::None,
        }
    }

    /// The memories of over-relaxation for all sites; `None` without over-relaxation.
    pub(crate) fn into_memories(self) -> Option<Vec<Memory>> {
        match self {
            Self::Relaxation(relaxation) => Some(relaxation.into_memories()),
            Self::None | Self::Anderson(_) => None,
        }
    }

    /// The next positions of all sites, which the caller projects and restricts.
    pub(crate) fn next(&mut self, iterate: &Iterate<'_>) -> Vec<Local> {
        match self {
            Self::None => iterate.steps.iter().map(|step| step.target).collect(),
            Self::Relaxation(relaxation) => relaxation.next(iterate),
            Self::Anderson(anderson) => anderson.next(iterate),
        }
    }
}
