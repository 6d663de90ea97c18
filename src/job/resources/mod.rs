//! What a run may use and what it uses: memory, disk and time.

pub(crate) mod clock;
pub(crate) mod forecast;
pub(crate) mod memory;
