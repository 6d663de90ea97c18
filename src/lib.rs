//! Turns laser scans larger than memory into evenly spaced points.
//!
//! The story of the data:
//!
//! ```text
//!   survey ─► scatter ─► plan ─► solve (each tile alone) ─► stitch ─► write ─► report
//! ```
//!
//! A **survey** reads headers only, and puts the run on one scale and offset
//! ([`geometry::Quantization`]). **Scatter** decodes every file once ([`las`]) and
//! appends each point to the spill of its cell, a square of a grid of integers
//! ([`tile`]). Now the true counts are known, and the **plan** cuts the plane
//! into tiles whose points fit the memory budget together with a *halo* of their
//! neighbours' points.
//!
//! A tile is **solved** alone ([`lloyd`]): seeds are elected from the scan by a
//! rule that only looks near by, and moved, iteration by iteration, to the
//! centroids of their Voronoi cells, restricted to quadratic patches fitted to
//! the scan ([`geometry`]). Every seed has an identity that does not depend on
//! tiles, and everything is computed from the data in an order given by the
//! data: where two tiles both see enough, they hold the same bits. So the
//! **stitch** joins them by identity, each seed once, and there is no seam to be
//! found. Each point takes all its attributes from the nearest point of the
//! scan, and is **written** once, to a file that is complete under its name or
//! not there. The **report** ([`report`]) says how uniform, how faithful and
//! how seamless the result is ([`quality`]).
//!
//! [`job`] runs the stages within threads and memory, and goes on where an
//! earlier run stopped; [`config`] says what was asked for; [`simulate`] makes a
//! street with known surfaces to try everything on, [`picture`] draws what came out.
//!
//! Layers, dependencies only downwards:
//!
//! ```text
//!   application   config  job  report  cli
//!   files         tile  las
//!   numbers       geometry  lloyd  quality  simulate  picture
//! ```

#![cfg_attr(
    not(feature = "formats"),
    expect(
        dead_code,
        unreachable_pub,
        unused_imports,
        reason = "the job on files uses more of the solver than the library alone"
    )
)]

#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod cli;
#[cfg(feature = "formats")]
mod config;
mod geometry;
#[cfg(feature = "formats")]
mod job;
#[cfg(feature = "formats")]
mod las;
mod lloyd;
#[cfg(feature = "formats")]
mod picture;
mod quality;
#[cfg(feature = "report")]
mod report;
mod resample;
#[cfg(feature = "formats")]
mod simulate;
mod spacing;
#[cfg(feature = "formats")]
mod tile;
mod tiling;
#[cfg(feature = "formats")]
mod views;

pub use geometry::PatchKind;
#[cfg(feature = "formats")]
pub use job::{Job, JobError, Outcome, Progress, Quiet, Standing, Unit};

pub use lloyd::{Acceleration, SeedRule};
pub use quality::Uniformity;
pub use resample::{Options, ResampleError, Resampled, Ring, resample, resample_with_progress};

/// What the benches and tests of this crate look at; nothing of it is stable.
#[cfg(feature = "formats")]
#[doc(hidden)]
pub mod internals {
    pub use crate::{
        geometry::{
            BOUNDING_SIDES, Cell, Local, Moments, Neighbor, NeighborGrid, Patch, PatchKind,
            Quantization, Rect, Stored,
        },
        las::{LasError, PlyFile, PlyStream, PointCounts},
        lloyd::{
            AREA_PER_SEED, Acceleration, Restriction, Scan, SeedRule, Site, Solution,
            SolverOptions, TileRegion, describe_positions, elect, solve, uniformity,
        },
        quality::{
            CellFigures, DistanceFigures, DistanceSums, DistanceTally, Uniformity, UniformityTally,
        },
        simulate::{SimulatedPoint, Street, StreetOptions},
        tile::{
            NeighborSites, Opener, ScatterOptions, SeamTally, SolvedSite, Source, SourceError,
            Spill, TileError, blend, scatter,
        },
        tiling::CellGrid,
    };
}
