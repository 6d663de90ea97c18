//! The number of sites that was asked for.
//!
//! A spacing gives a count only approximately. Where the count is what was asked for, sites that are too many
//! leave and missing ones come between two rounds, and the iterations that are left close the gaps: those with
//! the smallest cells leave, and new ones come where the largest empty circles are, at corners of cells. In a lattice
//! the gap that a site leaves is not closed, so its sites leave after others. Each tile names its own candidates, by
//! their neighbourhoods alone; which of them it is to be is decided by the order of all candidates of the cloud. So no
//! tile shows in it.

use std::{cmp::Ordering, fmt};

use serde::{Deserialize, Serialize};

use super::{field::SpacingField, options::SolverOptions, site::Site, surface::Surface};
use crate::{
    geometry::{Local, NeighborGrid, Rect, Stored, by_position},
    quality::HEXAGON_ENERGY,
};

/// The number of sites that a cloud is to have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct WantedCount {
    /// The number.
    pub(crate) sites: u64,
    /// Whether it is to be met exactly, and not only within a few thousandths.
    pub(crate) is_exact: bool,
}

/// Share of the wanted number by which a cloud may miss it if it need not be met exactly.
const TOLERANCE: f64 = 0.0025;

impl WantedCount {
    /// By how much `sites` are too many, or if it is negative too few; 0 where they are near enough.
    fn excess(self, sites: u64) -> i64 {
        let excess = sites as i64 - self.sites as i64;
        let tolerance = match self.is_exact {
            true => 0.0,
            false => TOLERANCE * self.sites as f64,
        };
        if excess.abs() as f64 <= tolerance {
            0
        } else {
            excess
        }
    }

    /// Whether a cloud of `sites` sites misses the number.
    pub(super) fn is_missed_by(self, sites: usize) -> bool {
        self.excess(sites as u64) != 0
    }
}

/// The cell of a lattice counts as so many times as large when the sites with the smallest cells are to leave. On a scan that is nearly
/// one plane δ is 8, 8 and 6 % lower for it (0.7 M points to one in 20, 50 and 100, of which 0.3 to 0.4 % leave).
const LATTICE_CELL_COUNTS_AS: f64 = 2.0;

/// A cell with six neighbours is one of a lattice if its energy is at most so many times that of a regular hexagon. With any energy
/// the energy ratio of a noisy scan with trees was 1.1104 instead of 1.1093.
const MOST_ENERGY_IN_A_LATTICE: f64 = 1.03;

/// A site that is nearer to one that leaves before it waits for all others: the gap that one leaves is closed by its neighbours.
const LEAVING_APART_IN_SPACINGS: f64 = 1.5;

/// No site comes nearer to another, be it on another surface: sites that no patch moves would stay as near. Between two sites of a wire there
/// is hardly more room than this.
const LEAST_ROOM_IN_SPACINGS: f64 = 0.4;

/// Where no cell has a corner, on leaves and wires, one site in so many looks for the sample of the scan around it that has most
/// room. Such places are taken when there are no others left.
const SITES_FOR_SAMPLE: u64 = 4;

/// No two sites that come are nearer to each other.
const COMING_APART_IN_SPACINGS: f64 = 1.0;

/// Width (in spacings) of the band around the core of a tile whose sites are compared with those of the core.
const BAND_IN_SPACINGS: f64 = 4.0;

/// Sites nearer than this to one that leaves or comes find their cells anew.
const DISTURBED_WITHIN_SPACINGS: f64 = 3.0;

/// Width (CRS units) of the band in which a tile must know the sites to name its candidates.
pub(crate) fn candidate_band(options: &SolverOptions) -> f64 {
    BAND_IN_SPACINGS * options.spacing
}

/// A site with the corner of its cell that is farthest from it, if neighbours bound the cell all around.
pub(super) type SiteWithCorner = (Site, Option<Local>);

/// A site that may leave, or a place where one may come: the smaller the rank, the sooner.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Candidate {
    /// Whether it comes after all that do not wait, whatever its rank.
    waits: bool,
    /// For a site that leaves [`rank_of_leaving`]; for a place the negative of its distance to the nearest site (CRS units), or the
    /// inverse of the distance if the place is not a corner of a cell. Where the spacing varies, areas and distances are those of
    /// cells that are scaled to the coarsest spacing.
    rank: f64,
    /// Decides between equal ranks.
    priority: u64,
    /// The identity of the site.
    identity: Stored,
    /// The place (local coordinates).
    position: Local,
}

impl Candidate {
    fn is_before(&self, other: &Self) -> bool {
        self.order(other).is_lt()
    }

    fn order(&self, other: &Self) -> Ordering {
        let by_waiting = self.waits.cmp(&other.waits);
        let by_rank = by_waiting.then_with(|| self.rank.total_cmp(&other.rank));
        by_rank.then_with(|| (self.priority, self.identity).cmp(&(other.priority, other.identity)))
    }
}

/// The sites of a part of a cloud that may leave, and the places there where sites may come.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Candidates {
    /// The number of sites.
    pub(crate) sites: u64,
    leaving: Vec<Candidate>,
    coming: Vec<Candidate>,
}

impl Candidates {
    /// The candidates of `core` among `sites`, which contain all sites of its band.
    pub(super) fn of(sites: &[SiteWithCorner], core: &Rect, surface: Surface<'_>) -> Self {
        let Surface { scan, options } = surface;
        let positions: Vec<Local> = sites.iter().map(|(site, _)| site.position).collect();
        let (field, spacing) = (scan.field(), options.spacing);
        let grid = field.grid(&positions, 1.0);
        let leaving = |(site, _): &SiteWithCorner| Candidate {
            waits: false,
            rank: rank_of_leaving(site, spacing),
            priority: site.identity.priority(options.seed),
            identity: site.identity,
            position: site.position,
        };
        // As if the spacing were the coarsest everywhere: candidates of all places are compared.
        let room = |position: Local| {
            let here = field.at(position);
            let nearest = grid.nearest(position, here, |_| false);
            nearest.map_or(0.0, |(_, squared)| spacing / here * squared.sqrt())
        };
        let coming = |(site, corner): &SiteWithCorner| {
            let priority = site.identity.priority(options.seed);
            let (position, distance) = match corner {
                Some(corner) => (*corner, room(*corner)),
                None if priority % SITES_FOR_SAMPLE == 0 => roomiest_sample(surface, site, room)?,
                None => return None,
            };
            let rank = match corner {
                Some(_) => -distance,
                None => distance.recip(),
            };
            (distance >= LEAST_ROOM_IN_SPACINGS * options.spacing).then_some(Candidate {
                waits: false,
                rank,
                priority,
                identity: scan.quantization().stored(position)?,
                position,
            })
        };
        let leaving: Vec<Candidate> = sites.iter().map(leaving).collect();
        // The new site needs an identity that no other has.
        let mut identities: Vec<Stored> = sites.iter().map(|(site, _)| site.identity).collect();
        identities.sort_unstable();
        let is_new = |place: &Candidate| identities.binary_search(&place.identity).is_err();
        let coming: Vec<Candidate> = sites.iter().filter_map(coming).filter(is_new).collect();
        let leaves_first = first_around(&leaving, LEAVING_APART_IN_SPACINGS, field);
        let comes_first = first_around(&coming, COMING_APART_IN_SPACINGS, field);
        let is_own = |candidate: &&Candidate| core.contains(candidate.identity);
        // Every site may leave, if it must.
        let leaving = leaving.iter().filter(is_own).map(|&site| Candidate {
            waits: !leaves_first(&site),
            ..site
        });
        let leaving: Vec<Candidate> = leaving.collect();
        let coming = coming.iter().filter(is_own).copied();
        Self {
            sites: leaving.len() as u64,
            leaving,
            coming: coming.filter(comes_first).collect(),
        }
    }
}

/// The rank of a `site` that leaves: the area of its cell (CRS units squared) as if the spacing were `coarsest` everywhere, more if it is
/// one of a lattice, infinite without a bounded cell.
fn rank_of_leaving(site: &Site, coarsest: f64) -> f64 {
    let Some(area) = site.bounded_area() else {
        return f64::INFINITY;
    };
    let of_hexagon = HEXAGON_ENERGY * area * area;
    let is_of_lattice = site.neighbors == 6 && site.energy <= MOST_ENERGY_IN_A_LATTICE * of_hexagon;
    let counts_as = if is_of_lattice {
        LATTICE_CELL_COUNTS_AS
    } else {
        1.0
    };
    counts_as * (coarsest / site.spacing).powi(2) * area
}

/// The sample of the scan near `site` that has most `room` to the sites around it, and that room (CRS units).
fn roomiest_sample(
    surface: Surface<'_>,
    site: &Site,
    room: impl Fn(Local) -> f64,
) -> Option<(Local, f64)> {
    let mut samples = Vec::new();
    let grid = surface.scan.samples();
    grid.gather(site.position, site.spacing, &mut samples);
    let samples = samples.into_iter().map(|sample| (sample, room(sample)));
    // The position decides between equals: the order of samples depends on the tile.
    samples.max_by(|(a, room_a), (b, room_b)| {
        let by_room = room_a.total_cmp(room_b);
        by_room.then_with(|| by_position(a, b))
    })
}

/// Whether one of the `candidates` comes before all others within `apart` spacings.
fn first_around<'a>(
    candidates: &'a [Candidate],
    apart: f64,
    field: &'a SpacingField,
) -> impl Fn(&Candidate) -> bool + 'a {
    let positions: Vec<Local> = candidates.iter().map(|c| c.position).collect();
    let grid = field.grid(&positions, apart);
    move |candidate| {
        let mut is_first = true;
        let radius = apart * field.at(candidate.position);
        grid.visit_around(candidate.position, radius, |other, position| {
            let is_near = (position - candidate.position).norm() <= radius;
            is_first &= !(is_near && candidates[other as usize].is_before(candidate));
        });
        is_first
    }
}

/// The sites that leave and come so that a cloud has the number that was asked for.
#[derive(Clone, Debug, Default)]
pub(crate) struct CountCorrection {
    /// The identities of the sites that leave, in order.
    leaving: Vec<Stored>,
    /// The identities and positions of the sites that come, in the order of their identities.
    coming: Vec<(Stored, Local)>,
    /// Where sites leave and come.
    places: Option<NeighborGrid>,
    /// Sites nearer to such a place find their cells anew (CRS units).
    reach: f64,
}

impl CountCorrection {
    /// Chooses among the candidates of all parts of a cloud of `sites` sites, such that `wanted` is met as nearly as there
    /// are candidates. `parts` gives the candidates part by part, in any order.
    ///
    /// # Errors
    ///
    /// The first error of `parts`.
    pub(crate) fn choose<E>(
        wanted: WantedCount,
        sites: u64,
        parts: impl Iterator<Item = Result<Candidates, E>>,
        options: &SolverOptions,
    ) -> Result<Self, E> {
        let excess = wanted.excess(sites);
        let most = excess.unsigned_abs() as usize;
        let mut chosen: Vec<Candidate> = Vec::new();
        if most > 0 {
            for part in parts {
                let part = part?;
                chosen.extend(if excess > 0 {
                    part.leaving
                } else {
                    part.coming
                });
                if chosen.len() > most {
                    chosen.select_nth_unstable_by(most, Candidate::order);
                    chosen.truncate(most);
                }
            }
        }
        chosen.sort_unstable_by_key(|candidate| candidate.identity);
        let reach = DISTURBED_WITHIN_SPACINGS * options.spacing;
        let positions: Vec<Local> = chosen.iter().map(|c| c.position).collect();
        let mut correction = Self {
            places: (most > 0).then(|| NeighborGrid::new(&positions, reach)),
            reach,
            ..Self::default()
        };
        let identities = chosen.iter().map(|c| c.identity);
        if excess > 0 {
            correction.leaving = identities.collect();
        } else {
            correction.coming = identities.zip(positions).collect();
        }
        Ok(correction)
    }

    /// Whether the site of `identity` leaves.
    pub(crate) fn leaves(&self, identity: &Stored) -> bool {
        self.leaving.binary_search(identity).is_ok()
    }

    /// The identities and positions of the sites that come.
    pub(crate) fn coming(&self) -> &[(Stored, Local)] {
        &self.coming
    }

    /// Whether no site leaves or comes.
    pub(crate) fn is_empty(&self) -> bool {
        self.leaving.is_empty() && self.coming.is_empty()
    }

    /// Whether a site at `position` finds its cell anew, because a site near it leaves or comes.
    pub(super) fn disturbs(&self, position: Local) -> bool {
        let places = self.places.as_ref();
        places.is_some_and(|places| places.any_within(position, self.reach))
    }
}

impl fmt::Display for CountCorrection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.coming.len() {
            0 => write!(f, "{} leave", self.leaving.len()),
            coming => write!(f, "{coming} come"),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::{
        geometry::Quantization,
        lloyd::{Scan, TileRegion, solve_watched},
    };

    #[test]
    fn on_wires_sites_come_between_any_two_and_any_leave() {
        // Twelve wires of five metres, with sites half a metre apart.
        let quantization = Quantization {
            scale: 0.001,
            offset: [0.0; 3],
        };
        let wires =
            (0..12).flat_map(|wire| (0..=100).map(move |along| (20_000 * wire, 50 * along)));
        let points = wires.map(|(x, y)| Stored { x, y, z: 0 }).collect();
        let options = SolverOptions::new(0.553);
        let scan = Scan::new(points, quantization, &options);
        let number_of = |wanted: Option<WantedCount>| {
            let everything = TileRegion::everything();
            let go_on = |_| ControlFlow::Continue(());
            let solution = solve_watched(&scan, &everything, &options, wanted, &go_on);
            solution.unwrap().sites.len() as u64
        };
        let (all, is_exact) = (number_of(None), true);
        for sites in [all * 11 / 10, all / 2, 1] {
            assert_eq!(number_of(Some(WantedCount { sites, is_exact })), sites);
        }
    }

    #[test]
    fn sites_of_a_lattice_leave_after_others() {
        // The energy is that of a regular hexagon of the area, or so many times as much.
        let site = |neighbors: u8, area: f64, energy: f64| Site {
            identity: Stored { x: 0, y: 0, z: 0 },
            position: Local::zeros(),
            is_exact: true,
            is_fixed: false,
            trust: 1.0,
            is_closed: true,
            neighbors,
            normal: Some(Local::z()),
            curvature: 0.0,
            spacing: 0.5,
            area,
            energy: energy * HEXAGON_ENERGY * area * area,
            nearest: 0.5,
        };
        let in_order = [
            site(6, 0.09, 1.0),
            site(5, 0.19, 1.01),
            site(6, 0.20, 1.1),
            site(7, 0.22, 1.0),
            site(6, 0.18, 1.02),
            site(6, 0.21, 1.0),
        ];
        let ranks = in_order.map(|site| rank_of_leaving(&site, 0.5));
        assert!(ranks.is_sorted(), "{ranks:?}");
        let open = Site {
            is_closed: false,
            ..site(5, 0.1, 1.0)
        };
        assert_eq!(rank_of_leaving(&open, 0.5), f64::INFINITY);
        // Where the spacing is half of the coarsest, cells are a quarter as large.
        let fine = rank_of_leaving(&site(5, 0.2, 1.1), 1.0);
        assert!((fine - 0.8).abs() < 1e-12);
    }
}
