//! What one pass of the scanner saw and others looked through, in words.

use super::numbers::counted;
use crate::transients::TransientCounts;

/// Returns how much of it was left out.
pub(super) fn in_words(counts: TransientCounts) -> String {
    match counts.things {
        _ if counts.one_visit => {
            "nothing is left out: all points were seen in one visit, and only another one could have looked through \
             what it saw"
                .to_owned()
        }
        0 => "nothing was seen by one pass that others looked through".to_owned(),
        things => format!(
            "{} of {} that one pass saw and others looked through, left out",
            counted(counts.points, "point"),
            counted(things, "thing")
        ),
    }
}
