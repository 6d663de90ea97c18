//! The radius with which an election takes a wanted number of points.

use super::{
    cloud::Workspace,
    election::Election,
    point_set::{ElectedSet, PointSet},
    store::StoreError,
};

/// An election may take up to this many times the wanted number. If a beginning of so many points leaves a few of a set out, the
/// distances to the nearest hardly change; if some of the next set are among them, they do.
const MOST_OF_WANTED: f64 = 1.3;
/// What is aimed at when the radius is corrected.
const AIM_OF_WANTED: f64 = 1.12;
/// The most elections for a set. Where points lie on lattices their number falls in steps as the radius grows, and there may be
/// no radius that takes the wanted number.
const MOST_ELECTIONS: usize = 4;

/// Elects about `wanted` points of `from`, at least as many if possible, first with `radius` (stored units). `number` tells
/// temporary files from those of other sets.
///
/// # Errors
///
/// If temporary files cannot be read or written.
pub(super) fn elect_number(
    from: &PointSet<'_>,
    wanted: f64,
    mut radius: f64,
    workspace: &Workspace<'_>,
    number: usize,
) -> Result<ElectedSet, StoreError> {
    let elect = |radius: f64, attempt: usize| -> Result<ElectedSet, StoreError> {
        let number = number * MOST_ELECTIONS + attempt;
        let elected = from.elect(&Election::new(radius), workspace, number)?;
        Ok((elected, radius))
    };
    let mut best = elect(radius, 0)?;
    let mut last = best.0.len() as f64;
    for attempt in 1..MOST_ELECTIONS {
        if (wanted..MOST_OF_WANTED * wanted).contains(&last) {
            break;
        }
        // On a surface the number falls with the square of the radius.
        radius *= (last / (AIM_OF_WANTED * wanted)).sqrt();
        let next = elect(radius, attempt)?;
        last = next.0.len() as f64;
        let worse = match is_better(last, best.0.len() as f64, wanted) {
            true => std::mem::replace(&mut best, next),
            false => next,
        };
        worse.0.remove();
    }
    Ok(best)
}

/// Whether `found` points are better than `other` where `wanted` are wanted: enough of them, and no more than necessary.
fn is_better(found: f64, other: f64, wanted: f64) -> bool {
    match (found >= wanted, other >= wanted) {
        (true, true) => found < other,
        (false, false) => found > other,
        (is_enough, _) => is_enough,
    }
}
