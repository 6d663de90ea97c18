//! Sorting by corners, by counting: the corners are as many as the points, and each has a few items.

use rayon::prelude::*;

/// Sorts `items` by the corner that each has, and those of one corner by themselves.
pub(super) fn sorted_by_corner<T: Copy + Ord + Send>(
    items: Vec<T>,
    corner: impl Fn(&T) -> u32 + Sync,
) -> Vec<T> {
    let corners = items
        .iter()
        .map(&corner)
        .max()
        .map_or(0, |last| last as usize + 1);
    // Where the next item of each corner goes.
    let mut next = vec![0; corners];
    for item in &items {
        next[corner(item) as usize] += 1;
    }
    let mut before = 0;
    for place in &mut next {
        let count = *place;
        *place = before;
        before += count;
    }
    let mut sorted = items.clone();
    for item in items {
        let place = &mut next[corner(&item) as usize];
        sorted[*place] = item;
        *place += 1;
    }
    sorted
        .par_chunk_by_mut(|a, b| corner(a) == corner(b))
        .for_each(<[T]>::sort_unstable);
    sorted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_are_in_the_order_of_any_sort() {
        let item = |k: u32| {
            (
                k.wrapping_mul(2_654_435_761) >> 22,
                k.wrapping_mul(40_503) % 97,
            )
        };
        let items: Vec<(u32, u32)> = (0..20_000).map(item).collect();
        let mut expected = items.clone();
        expected.sort_unstable();
        assert_eq!(sorted_by_corner(items, |item| item.0), expected);
        assert!(sorted_by_corner(Vec::<u32>::new(), |&item| item).is_empty());
    }
}
