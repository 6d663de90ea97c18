//! From the centroids to the next positions: as they are, over-relaxed, or mixed with those of
//! earlier iterations (paper, section IV-C).

mod accelerator;
mod anderson;
mod anderson_blocks;
mod iterate;
mod method;
mod normal_equations;
mod relaxation;

pub(super) use accelerator::Accelerator;
pub(super) use iterate::Iterate;
pub use method::Acceleration;
pub(super) use relaxation::Memory;
