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
//! The surfaces are exact, so the distance of a point to the truth is known:
//! what a resampling does to edges, poles and noise can be measured, not
//! guessed. Everything follows from a seed; nothing depends on threads.

mod scanner;
mod shapes;
mod street;

pub use scanner::SimulatedPoint;
pub use scanner::StreetOptions;
pub(crate) use shapes::Shape;
pub use street::Street;
