//! Morton order: the bits of three numbers, interleaved.

/// The lowest 21 bits of `value`, each followed by two zeros.
pub(super) fn interleave(value: u64) -> u64 {
    let mut v = value & 0x1f_ffff;
    v = (v | v << 32) & 0x1f_0000_0000_ffff;
    v = (v | v << 16) & 0x1f_0000_ff00_00ff;
    v = (v | v << 8) & 0x100f_00f0_0f00_f00f;
    v = (v | v << 4) & 0x10c3_0c30_c30c_30c3;
    (v | v << 2) & 0x1249_2492_4924_9249
}

/// The lowest of every three bits of `value`, side by side: undoes [`interleave`].
pub(super) fn collect(value: u64) -> u32 {
    let mut v = value & 0x1249_2492_4924_9249;
    v = (v | v >> 2) & 0x10c3_0c30_c30c_30c3;
    v = (v | v >> 4) & 0x100f_00f0_0f00_f00f;
    v = (v | v >> 8) & 0x1f_0000_ff00_00ff;
    v = (v | v >> 16) & 0x1f_0000_0000_ffff;
    ((v | v >> 32) & 0x1f_ffff) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::spread;

    #[test]
    fn collecting_undoes_interleaving() {
        for i in 0..1000 {
            let value = spread(i) & 0x1f_ffff;
            assert_eq!(u64::from(collect(interleave(value))), value);
        }
    }
}
