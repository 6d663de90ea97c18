//! A mobile-mapping street with known surfaces, scanned by casting rays.
//!
//! ```text
//!     ┌──┐cornice                           wire
//!     │▒▒│  ───────────────────────────────────────
//!     │▒▒│ window       │ pole                    ┌──┐
//!     │  │▒ (recessed)  │      ☁ tree             │▒▒│
//!     │  │              │      │     car  ▄▄▄     │  │
//!   ──┘  └──pavement────┐kerb──road──pothole──┌───┘  └──
//! ```
//!
//! The surfaces are exact, so the distance of a point to the truth is known, and the effect of
//! a resampling on edges, poles and noise can be measured. Everything follows from a seed;
//! nothing depends on the number of threads.
//!
//! Streets lie along x; y is across, 0 in the middle of the road. Lengths are metres.

mod bins;
mod blocks;
mod edges;
mod facade;
mod furniture;
mod options;
mod passing;
mod random;
mod road;
mod scanner;
mod shapes;
mod solids;
mod stray_returns;
mod street;
mod world;

pub use options::StreetOptions;
pub use scanner::SimulatedPoint;
pub use street::Street;
