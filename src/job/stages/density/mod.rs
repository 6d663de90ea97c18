//! The spacing that rules want at each point of the scan.
//!
//! ```text
//!   record ─► PointTag:  what rules say that look at the point alone
//!   points of a tile with their tags ─► shares:  all rules; the smallest spacing holds
//! ```
//!
//! Spacings are shares of the coarsest one, so that they stay the same if all are multiplied to meet a count.
//! Nothing depends on the order of the points, or on points beyond the reach: tiles that see the same
//! surroundings of a point want the same spacing there, to the bit.

mod bending;
mod ground;
mod rule;
mod sorted_points;
mod voxels;

use std::sync::Arc;

use self::{
    bending::Bending,
    ground::heights_above_ground,
    rule::{Rule, WantedShare},
    sorted_points::SortedPoints,
};
use crate::{
    config::{DensitySettings, Settings},
    geometry::{Quantization, Stored},
    job::error::JobError,
    las::{RecordFormat, RecordView},
    lloyd::PointTag,
    tile::SpacingRules,
};

/// The class of ground (LAS 1.4, table 17).
const GROUND: u8 = 2;

/// The spacing that rules want at the points of a scan.
#[derive(Debug)]
pub(crate) struct WantedSpacing {
    /// The rules that look at a record alone.
    of_records: Vec<Rule>,
    /// The rules that look at the points around, too; the number of each is that of its bit in a tag.
    of_surroundings: Vec<Rule>,
    /// The share of points that no rule applies to.
    elsewhere: f32,
    quantization: Quantization,
}

impl WantedSpacing {
    /// The spacing that `density` wants for records of the format `record`, with coordinates on `quantization`.
    ///
    /// # Errors
    ///
    /// [`JobError::Refused`] with the number of the rule if records lack an attribute that it asks for.
    pub(crate) fn new(
        density: &DensitySettings,
        record: &RecordFormat,
        quantization: &Quantization,
    ) -> Result<Self, JobError> {
        let mut of_records = Vec::new();
        let mut of_surroundings = Vec::new();
        for (number, rule) in (1..).zip(&density.rules) {
            let meant = Rule::new(rule, density, record).map_err(|problem| {
                JobError::Refused(format!("rule {number} for the spacing: {problem}"))
            })?;
            match rule.looks_around() {
                true => of_surroundings.push(meant),
                false => of_records.push(meant),
            }
        }
        Ok(Self {
            of_records,
            of_surroundings,
            elsewhere: density.share(density.elsewhere),
            quantization: *quantization,
        })
    }

    /// The tag of the point of `record`.
    ///
    /// # Panics
    ///
    /// If the record is shorter than its format.
    fn of_record(&self, record: &[u8]) -> PointTag {
        let view = RecordView::new(record);
        let class = view.classification();
        let world = self.quantization.world(view.position());
        let mut share = f32::INFINITY;
        for rule in &self.of_records {
            // A rule that cannot make the spacing finer needs no test.
            if let WantedShare::Uniform(wanted) = rule.wanted
                && wanted < share
                && rule.accepts(record, class, &world)
            {
                share = wanted;
            }
        }
        let bits = self.of_surroundings.iter().enumerate();
        let open = bits
            .filter(|(_, rule)| rule.accepts(record, class, &world))
            .fold(0, |open, (bit, _)| open | 1_u16.unbounded_shl(bit as u32));
        PointTag {
            share,
            open,
            is_ground: class == GROUND,
        }
    }

    /// The wanted spacing at each of `points`, whose tags are `tags`, as a share of the coarsest. `spacing` is that
    /// coarsest one (CRS units).
    fn shares_of(&self, points: &[Stored], tags: &[PointTag], spacing: f64) -> Vec<f32> {
        let mut shares: Vec<f32> = tags.iter().map(|tag| tag.share).collect();
        let is_asked = tags.iter().any(|tag| tag.open != 0);
        if is_asked {
            self.look_around(points, tags, spacing, &mut shares);
        }
        for share in &mut shares {
            if share.is_infinite() {
                *share = self.elsewhere;
            }
        }
        shares
    }

    /// Applies the rules that look at the points around to `shares`.
    fn look_around(&self, points: &[Stored], tags: &[PointTag], spacing: f64, shares: &mut [f32]) {
        let sorted = SortedPoints::new(points, &self.quantization);
        let tag = |index: usize| &tags[sorted.order[index] as usize];
        let needs_heights = self
            .of_surroundings
            .iter()
            .any(|rule| rule.height.is_some());
        let heights = match needs_heights {
            true => {
                let is_ground = |index: usize| tag(index).is_ground;
                heights_above_ground(&sorted, is_ground, &self.quantization, spacing)
            }
            false => Vec::new(),
        };
        // Rules with equal curvatures share a search.
        let mut searched: Vec<(Bending, Vec<f64>)> = Vec::new();
        for (bit, rule) in self.of_surroundings.iter().enumerate() {
            let mask = 1_u16.unbounded_shl(bit as u32);
            let applies = |index: usize| {
                let has_height = |range: [f64; 2]| {
                    heights[index].is_some_and(|height| (range[0]..=range[1]).contains(&height))
                };
                tag(index).open & mask != 0 && rule.height.is_none_or(has_height)
            };
            let applying: Vec<usize> = (0..sorted.order.len()).filter(|&i| applies(i)).collect();
            let bending = rule.bending(spacing);
            if let Some(bending) = bending
                && !applying.is_empty()
                && searched.iter().all(|(known, _)| *known != bending)
            {
                searched.push((bending, bending.spacings(&sorted, &self.quantization)));
            }
            let found = searched.iter().find(|(known, _)| Some(*known) == bending);
            for index in applying {
                let wanted = match (rule.wanted, found) {
                    (WantedShare::Uniform(share), _) => share,
                    (WantedShare::Curvature { flat, bent }, Some((_, spacings))) => {
                        ((spacings[index] / spacing) as f32).clamp(bent, flat)
                    }
                    (WantedShare::Curvature { flat, .. }, None) => flat,
                };
                let share = &mut shares[sorted.order[index] as usize];
                *share = share.min(wanted);
            }
        }
    }
}

/// The rules of `settings` for the spacing at points with records of the format `record` and coordinates on `quantization`;
/// `None` if it is the same everywhere.
///
/// # Errors
///
/// [`JobError::Refused`] if records lack an attribute that a rule asks for.
pub(crate) fn spacing_rules(
    settings: &Settings,
    record: &RecordFormat,
    quantization: &Quantization,
) -> Result<Option<Arc<dyn SpacingRules>>, JobError> {
    let Some(density) = settings.density.as_ref() else {
        return Ok(None);
    };
    // A rule that no record can follow is wrong, even where all rules have one spacing.
    let wanted = WantedSpacing::new(density, record, quantization)?;
    let varies = settings.solver.grading.is_some();
    Ok(varies.then(|| Arc::new(wanted) as Arc<dyn SpacingRules>))
}

impl SpacingRules for WantedSpacing {
    fn tag(&self, record: &[u8]) -> PointTag {
        self.of_record(record)
    }

    fn shares(&self, points: &[Stored], tags: &[PointTag], spacing: f64) -> Vec<f32> {
        self.shares_of(points, tags, spacing)
    }
}

#[cfg(test)]
mod tests {
    use super::{ground::GROUND_REACH_IN_SPACINGS, *};
    use crate::config::{
        Condition, DensityRule, RuleSpacing, SEEN_BY_CURVATURE_IN_SPACINGS,
        SEEN_BY_HEIGHT_IN_SPACINGS,
    };

    const QUANTIZATION: Quantization = Quantization {
        scale: 0.001,
        offset: [100.0, 200.0, 0.0],
    };

    /// How far (CRS units, in the plane, along each axis) shares look from a point. `spacing` is the
    /// coarsest one.
    fn reach(wanted: &WantedSpacing, spacing: f64) -> f64 {
        let reach = wanted.of_surroundings.iter().map(|rule| {
            let height = rule
                .height
                .map_or(0.0, |_| GROUND_REACH_IN_SPACINGS * spacing);
            let curvature = rule.bending(spacing).map_or(0.0, Bending::reach);
            height.max(curvature)
        });
        reach.fold(0.0, f64::max)
    }

    fn format() -> RecordFormat {
        RecordFormat {
            point_format: 6,
            extra_bytes: Vec::new(),
        }
    }

    fn wanted(elsewhere: f64, rules: Vec<(Vec<Condition>, RuleSpacing)>) -> WantedSpacing {
        let rules = rules.into_iter().map(|(conditions, spacing)| DensityRule {
            conditions,
            spacing,
        });
        let density = DensitySettings {
            elsewhere,
            gradation: 1.2,
            rules: rules.collect(),
        };
        WantedSpacing::new(&density, &format(), &QUANTIZATION).unwrap()
    }

    fn record(x: f64, y: f64, z: f64, class: u8, intensity: u16) -> [u8; 30] {
        let mut record = RecordView::new([0; 30]);
        record.set_position(QUANTIZATION.stored([x, y, z].into()).unwrap());
        record.set_classification(class);
        record.set_intensity(intensity);
        record.into_bytes()
    }

    /// The shares that `wanted` gives to `records`, in their order, for a coarsest spacing of `spacing`.
    fn shares(wanted: &WantedSpacing, records: &[[u8; 30]], spacing: f64) -> Vec<f32> {
        let tags: Vec<PointTag> = records.iter().map(|r| wanted.of_record(r)).collect();
        let points: Vec<Stored> = records.iter().map(|r| Stored::of_record(r)).collect();
        wanted.shares(&points, &tags, spacing)
    }

    #[test]
    fn the_smallest_spacing_holds_and_that_elsewhere_only_without_a_rule() {
        let intensity = |low, high| Condition::Attribute {
            name: "intensity".into(),
            range: [low, high],
        };
        let line = crate::las::LineFilter::from(vec![vec![[100.0, 200.0], [110.0, 200.0]]]);
        let near = Condition::Near {
            line,
            distance: [0.0, 1.0],
        };
        let wanted = wanted(
            0.25,
            vec![
                (vec![Condition::Class(vec![2])], RuleSpacing::Uniform(1.0)),
                (vec![intensity(10.0, 20.0)], RuleSpacing::Uniform(0.5)),
                (
                    vec![Condition::Class(vec![6]), near],
                    RuleSpacing::Uniform(0.125),
                ),
            ],
        );
        let records = [
            record(5.0, 9.0, 0.0, 2, 0),
            record(5.0, 9.0, 0.0, 2, 10),
            record(5.0, 9.0, 0.0, 6, 21),
            record(5.0, 1.0, 0.0, 6, 20),
            record(5.0, 1.1, 0.0, 6, 20),
        ];
        assert_eq!(shares(&wanted, &records, 1.0), [1.0, 0.5, 0.25, 0.125, 0.5]);
        assert_eq!(reach(&wanted, 1.0), 0.0);
    }

    /// Ground with a wall on it; the rule on heights holds for a part of the wall, by class and height.
    fn wall() -> Vec<[u8; 30]> {
        let mut records = Vec::new();
        for i in 0..40 {
            for j in 0..40 {
                let [a, b] = [i, j].map(|k| 0.1 * f64::from(k));
                records.push(record(a, b, 0.0, 2, 0));
                records.push(record(a, 2.05, b + 0.05, 6, 0));
            }
        }
        records
    }

    #[test]
    fn heights_are_those_above_the_ground() {
        let conditions = vec![Condition::Class(vec![6]), Condition::Height([1.0, 2.0])];
        let wanted = wanted(0.4, vec![(conditions, RuleSpacing::Uniform(0.1))]);
        let records = wall();
        for (record, share) in records.iter().zip(shares(&wanted, &records, 0.4)) {
            let z = QUANTIZATION.local(Stored::of_record(record)).z;
            assert_eq!(share == 0.25, (1.0..=2.0).contains(&z), "{z}");
        }
        let alone: Vec<[u8; 30]> = records.into_iter().filter(|r| r[16] == 6).collect();
        assert!(
            shares(&wanted, &alone, 0.4)
                .iter()
                .all(|&share| share == 1.0)
        );
        assert_eq!(reach(&wanted, 0.4), SEEN_BY_HEIGHT_IN_SPACINGS * 0.4);
    }

    /// Neither the order of the points nor points beyond the reach show in the shares of `wanted` for the wall. The part of it
    /// up to `x` plus the reach is seen by a tile.
    fn check_that_shares_are_local(wanted: &WantedSpacing, spacing: f64, x: f64) {
        let records = wall();
        let all = shares(wanted, &records, spacing);
        assert!(all.iter().any(|&share| share < 1.0) && all.contains(&1.0));
        let mut order: Vec<usize> = (0..records.len()).collect();
        order.sort_by_key(|&index| crate::geometry::spread(index as u64));
        let shuffled: Vec<[u8; 30]> = order.iter().map(|&index| records[index]).collect();
        for (index, share) in order.iter().zip(shares(wanted, &shuffled, spacing)) {
            assert_eq!(all[*index], share);
        }
        let x_of = |record: &[u8; 30]| QUANTIZATION.local(Stored::of_record(record)).x;
        let seen_until = x + reach(wanted, spacing);
        let part: Vec<usize> = (0..records.len())
            .filter(|&i| x_of(&records[i]) <= seen_until)
            .collect();
        let seen: Vec<[u8; 30]> = part.iter().map(|&index| records[index]).collect();
        assert!(seen.len() < records.len());
        for (index, share) in part.iter().zip(shares(wanted, &seen, spacing)) {
            assert!(x_of(&records[*index]) > x || all[*index] == share);
        }
    }

    #[test]
    fn shares_depend_on_the_points_within_the_reach_alone() {
        let height = vec![Condition::Height([0.5, 1.0])];
        let by_height = wanted(0.1, vec![(height, RuleSpacing::Uniform(0.05))]);
        check_that_shares_are_local(&by_height, 0.1, 2.0);
        let bending = RuleSpacing::Curvature {
            flat: 0.6,
            bent: 0.2,
        };
        let by_curvature = wanted(0.6, vec![(vec![Condition::Class(vec![2, 6])], bending)]);
        assert!(reach(&by_curvature, 0.6) <= SEEN_BY_CURVATURE_IN_SPACINGS * 0.6);
        check_that_shares_are_local(&by_curvature, 0.6, 1.0);
    }

    #[test]
    fn an_attribute_that_no_input_has_is_named_with_those_that_there_are() {
        let condition = Condition::Attribute {
            name: "intensty".into(),
            range: [0.0, 1.0],
        };
        let density = DensitySettings {
            elsewhere: 1.0,
            gradation: 1.2,
            rules: vec![DensityRule {
                conditions: vec![condition],
                spacing: RuleSpacing::Uniform(0.5),
            }],
        };
        let error = WantedSpacing::new(&density, &format(), &QUANTIZATION).unwrap_err();
        let error = error.to_string();
        for part in [
            "rule 1",
            "`intensty`",
            "intensity, return_number",
            "user_data",
        ] {
            assert!(error.contains(part), "{error}");
        }
    }
}
