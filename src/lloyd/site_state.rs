//! A site between two rounds: all that the next iteration knows of the last.

use serde::{Deserialize, Serialize};

use super::{acceleration::Memory, step::Step};
use crate::geometry::{Local, Stored};

/// A site between two rounds, in coordinates and identities that are the same in every tile.
/// Lengths are CRS units.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct SiteState {
    /// The seed that the site started from; it decides in which tile the site is at home.
    pub(crate) identity: Stored,
    /// The position after the last iteration (local coordinates).
    pub(crate) position: Local,
    /// The last move.
    pub(super) last_move: Local,
    /// The patch, and the cell if it is followed.
    pub(super) step: Step,
    /// The identities of the sites whose cells share an edge with that of the site.
    pub(super) links: Vec<Stored>,
    /// What over-relaxation remembers of the site.
    pub(super) memory: Option<Memory>,
}
