//! What hangs together, and which of it must be turned around for all of it to lie the same way: a union-find with parity.

/// Items by their numbers, joined to each other.
#[derive(Debug, Default)]
pub(super) struct Joined {
    /// For each item the one that it was joined to, and whether the two are turned in opposite directions; itself, if
    /// it was joined to none.
    to: Vec<(u32, bool)>,
}

/// What became of two items that were to be joined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Joining {
    /// The root `joined` and all that hangs on it now hang on `root`, turned around if `is_reversed`.
    New {
        root: u32,
        joined: u32,
        is_reversed: bool,
    },
    /// They were joined in the same way before.
    Known,
    /// They were joined in the other way before.
    Conflict,
}

impl Joined {
    /// So many items, none of which is joined to another one.
    pub(super) fn new(count: usize) -> Self {
        let mut items = Self::default();
        items.push(count);
        items
    }

    /// Adds so many items, none of which is joined to another one; returns the number of the first.
    pub(super) fn push(&mut self, count: usize) -> u32 {
        let first = self.to.len() as u32;
        self.to
            .extend((first..first + count as u32).map(|k| (k, false)));
        first
    }

    /// The number of items.
    pub(super) fn len(&self) -> u32 {
        self.to.len() as u32
    }

    /// The root that `item` hangs on, and whether it is turned in the opposite direction.
    pub(super) fn root(&mut self, item: u32) -> (u32, bool) {
        let (mut root, mut is_reversed) = (item, false);
        while self.to[root as usize].0 != root {
            let (next, turn) = self.to[root as usize];
            is_reversed ^= turn;
            root = next;
        }
        // The next search is shorter.
        let (mut at, mut rest) = (item, is_reversed);
        while self.to[at as usize].0 != root && at != root {
            let (next, turn) = self.to[at as usize];
            self.to[at as usize] = (root, rest);
            rest ^= turn;
            at = next;
        }
        (root, is_reversed)
    }

    /// Joins two items, one of which is turned around if `is_reversed`.
    pub(super) fn join(&mut self, one: u32, other: u32, is_reversed: bool) -> Joining {
        let ((one, turn), (other, other_turn)) = (self.root(one), self.root(other));
        let is_reversed = is_reversed ^ turn ^ other_turn;
        if one == other {
            return match is_reversed {
                true => Joining::Conflict,
                false => Joining::Known,
            };
        }
        // The earlier one stays.
        let (root, joined) = (one.min(other), one.max(other));
        self.to[joined as usize] = (root, is_reversed);
        Joining::New {
            root,
            joined,
            is_reversed,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ring_with_an_odd_number_of_turns_has_a_conflict() {
        for (turns, last) in [
            ([false, true, true], Joining::Known),
            ([true, true, true], Joining::Conflict),
        ] {
            let mut ring = Joined::new(3);
            assert!(matches!(
                ring.join(0, 1, turns[0]),
                Joining::New {
                    root: 0,
                    joined: 1,
                    ..
                }
            ));
            assert!(matches!(
                ring.join(2, 1, turns[1]),
                Joining::New {
                    root: 0,
                    joined: 2,
                    ..
                }
            ));
            assert_eq!(ring.join(2, 0, turns[2]), last);
            assert_eq!(ring.root(2), (0, turns[0] ^ turns[1]));
            assert_eq!(ring.push(2), 3);
            assert_eq!(ring.root(4), (4, false));
        }
    }
}
