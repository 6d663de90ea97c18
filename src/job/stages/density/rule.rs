//! A rule for the spacing, ready for the records of a run.

use super::bending::Bending;
use crate::{
    config::{Condition, DensityRule, DensitySettings, RuleSpacing},
    las::{Attribute, LineFilter, PolygonFilter, RecordFormat},
};

/// A rule for the spacing, ready for the records of a run.
#[derive(Debug)]
pub(super) struct Rule {
    /// The conditions on a record; all of them must hold. Those that take the least time come first.
    conditions: Vec<RecordCondition>,
    /// The range of heights above the ground, if it is a condition (CRS units).
    pub(super) height: Option<[f64; 2]>,
    /// The spacing that the rule wants.
    pub(super) wanted: WantedShare,
}

/// The spacing that a rule wants, as a share of the coarsest.
#[derive(Clone, Copy, Debug)]
pub(super) enum WantedShare {
    /// One spacing.
    Uniform(f32),
    /// A spacing between two, by the curvature of the surface.
    Curvature {
        /// The share where the surface is flat.
        flat: f32,
        /// The share at edges.
        bent: f32,
    },
}

/// A condition on a record and its position. The order is that of the time that the test takes.
#[derive(Debug)]
enum RecordCondition {
    /// Whether each class is one of those.
    Class(Box<[bool; 256]>),
    /// A range of an attribute.
    Attribute(Attribute, [f64; 2]),
    /// A range of distances from lines.
    Near(LineFilter, [f64; 2]),
    /// Polygons around the position.
    Within(PolygonFilter),
}

impl RecordCondition {
    /// The place in the order of the tests.
    fn order(&self) -> u8 {
        match self {
            Self::Class(_) => 0,
            Self::Attribute(..) => 1,
            Self::Near(..) => 2,
            Self::Within(_) => 3,
        }
    }

    fn holds(&self, record: &[u8], class: u8, world: &[f64; 3]) -> bool {
        match self {
            Self::Class(classes) => classes[usize::from(class)],
            Self::Attribute(attribute, [low, high]) => {
                let value = attribute.value(record);
                value.is_some_and(|value| (*low..=*high).contains(&value))
            }
            Self::Near(line, distance) => line.is_near(world, *distance),
            Self::Within(polygons) => polygons.contains(world),
        }
    }
}

impl Rule {
    /// The `rule` of `density` for records of the format `record`.
    ///
    /// # Errors
    ///
    /// A text that says which attribute records lack, and which ones they have.
    pub(super) fn new(
        rule: &DensityRule,
        density: &DensitySettings,
        record: &RecordFormat,
    ) -> Result<Self, String> {
        let mut conditions = Vec::new();
        let mut height: Option<[f64; 2]> = None;
        for condition in &rule.conditions {
            conditions.push(match condition {
                Condition::Height(range) => {
                    // Of several ranges all must hold.
                    let [low, high] = height.unwrap_or([f64::MIN, f64::MAX]);
                    height = Some([low.max(range[0]), high.min(range[1])]);
                    continue;
                }
                Condition::Class(classes) => {
                    let mut accepted = Box::new([false; 256]);
                    for &class in classes {
                        accepted[usize::from(class)] = true;
                    }
                    RecordCondition::Class(accepted)
                }
                Condition::Within(polygons) => RecordCondition::Within(polygons.clone()),
                Condition::Near { line, distance } => {
                    RecordCondition::Near(line.clone(), *distance)
                }
                Condition::Attribute { name, range } => {
                    let attribute = record.attribute(name).ok_or_else(|| {
                        format!(
                            "no input has an attribute `{name}`; give class, height, polygon, or one of {}",
                            record.attribute_names().join(", ")
                        )
                    })?;
                    RecordCondition::Attribute(attribute, *range)
                }
            });
        }
        conditions.sort_by_key(RecordCondition::order);
        Ok(Self {
            conditions,
            height,
            wanted: match rule.spacing {
                RuleSpacing::Uniform(spacing) => WantedShare::Uniform(density.share(spacing)),
                RuleSpacing::Curvature { flat, bent } => WantedShare::Curvature {
                    flat: density.share(flat),
                    bent: density.share(bent),
                },
            },
        })
    }

    /// Whether the conditions on the record hold for the point of this `class` at `world`.
    #[inline]
    pub(super) fn accepts(&self, record: &[u8], class: u8, world: &[f64; 3]) -> bool {
        let mut conditions = self.conditions.iter();
        conditions.all(|condition| condition.holds(record, class, world))
    }

    /// The search for the curvature that the rule needs, if it needs one. `spacing` is the coarsest one.
    pub(super) fn bending(&self, spacing: f64) -> Option<Bending> {
        match self.wanted {
            WantedShare::Uniform(_) => None,
            WantedShare::Curvature { flat, bent } => Some(Bending {
                flat: f64::from(flat) * spacing,
                bent: f64::from(bent) * spacing,
            }),
        }
    }
}
