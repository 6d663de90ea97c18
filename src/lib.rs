//! Turns laser scans larger than memory into evenly spaced points.
//!
//! Points are moved to even positions on the scanned surfaces: a centroidal Voronoi tessellation on local
//! quadratic patches (*Accelerated Lloyd's Method for Resampling 3D Point Clouds*). There are two doors:
//!
//! * [`resample`] takes points in memory and gives points in memory. It knows no files, terminal or directory.
//! * [`Job`] takes files of any size and writes one cloud, within a memory budget; it continues after it was
//!   killed. Scans are cut into tiles with overlap, and tiles agree to the bit, so that the result of a job
//!   is that of `resample` on the same points.
//!
//! ```
//! # let points: Vec<[f64; 3]> = (0..900).map(|i| [(i % 30) as f64, (i / 30) as f64, 0.0]).collect();
//! let even = lloydar::resample(&points, &lloydar::Options::with_spacing(3.0))?;
//! # assert!(!even.points.is_empty());
//! # Ok::<(), lloydar::ResampleError>(())
//! ```
//!
//! # Features
//!
//! All are on by default; without them the crate needs what a numeric library needs.
//!
//! * `formats`: LAS, LAZ, COPC and PLY files, and [`Job`].
//! * `report`: the report of a job as a page.
//! * `cli`: the program.
//! * `e57` (off by default): E57 files as inputs.
//!
//! # The story of the data
//!
//! ```text
//!   survey ─► scatter ─► plan ─► solve (each tile alone) ─► stitch ─► write (─► mesh) ─► report
//! ```
//!
//! A **survey** reads headers only, and puts the run on one scale and offset, its *quantization*. What has gone since one
//! pass of the scanner saw it can be found by the others (`transients`), and left out from here on. **Scatter**
//! decodes every file once (`las`) and adds each point to the *spill* of its cell, a square of an integer grid
//! (`tile`), in memory or on disk. What is denser than the output can use is *thinned*: a voxel keeps a few points
//! and the sum of the others. Now the true counts are known: one spacing for the whole cloud is chosen and the
//! directions that many of its planes face are found (`spacing`), and the **plan** cuts the plane into tiles whose points
//! fit the memory budget together with a *halo* of their neighbours' points (`tiling`).
//!
//! A tile is **solved** alone (`lloyd`): seeds are elected from the scan by a rule that looks at a
//! neighbourhood only, and are moved, iteration by iteration, to the centroids of their Voronoi cells,
//! restricted to quadratic patches that are fitted to the scan (`geometry`); in the end each stands on a patch that a wider part of
//! the scan has corrected. Every seed has an identity that
//! does not depend on tiles, and everything is computed from the data in an order given by the data: two
//! tiles that both see enough have the same bits. Where tiles are small, they do it in two *rounds*: all
//! tiles do the first iterations before any does the rest, and each needs to see less around it. The
//! **stitch** joins the tiles by identity, each seed once, and there is no seam to be found. Each point takes
//! all its attributes from the nearest point of the scan, and is **written** once, to a file that is complete
//! under its name or not there. If a **mesh** is asked for, the triangles between the points are found (`mesh`) and written,
//! too. The **report** says how uniform, how faithful and how seamless the result is
//! (`quality`).
//!
//! The spacing may vary over the cloud: rules give each point of the scan a wanted spacing, and a field is made of
//! them that all steps follow (`lloyd::field`).
//!
//! `job` runs the stages within threads and memory, and continues where an earlier run stopped; `config` has
//! the options as written and as meant; `simulate` makes a street with known surfaces to try everything on;
//! `views` and `picture` draw the result. `ARCHITECTURE.md` has the layers, a glossary and the invariants.

#![cfg_attr(
    all(feature = "formats", not(feature = "cli")),
    expect(
        dead_code,
        unused_imports,
        reason = "the program uses more of the job than the library alone"
    )
)]
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
mod mesh;
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
mod store;
#[cfg(feature = "formats")]
mod tile;
mod tiling;
#[cfg(feature = "formats")]
mod transients;
#[cfg(feature = "formats")]
mod views;

pub use geometry::PatchKind;
#[cfg(feature = "formats")]
pub use job::{Job, JobError, Outcome};

pub use lloyd::{Acceleration, SeedRule};
pub use quality::Uniformity;
pub use resample::{Options, ResampleError, Resampled, Ring, resample, resample_with_progress};

/// The reports of a [`Job`] to a listener.
#[cfg(feature = "formats")]
pub mod progress {
    pub use crate::job::{Progress, Quiet, Standing, Unit};
}

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
            AREA_PER_SEED, Acceleration, DominantNormals, Grading, Restriction, Scan, SeedRule,
            Site, Solution, SolverOptions, TileRegion, describe_positions, elect, solve,
            uniformity,
        },
        quality::{CellFigures, DistanceFigures, DistanceTally, Uniformity, UniformityTally},
        simulate::{SimulatedPoint, Street, StreetOptions},
        tile::{
            NeighborSites, Opener, ScatterOptions, SeamTally, SolvedSite, Source, SourceError,
            Spill, TileError, blend, scatter,
        },
        tiling::CellGrid,
    };
}
