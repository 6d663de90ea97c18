//! Heights of degree 2 over a plane.

/// Heights over a plane: w = h + p u + q v + ½ (a u² + 2 b u v + c v²).
///
/// Lengths are CRS units: `h` is a length, the slopes `p`, `q` have no unit, the second
/// derivatives `a`, `b`, `c` are inverse lengths.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Heights {
    pub(super) h: f64,
    pub(super) p: f64,
    pub(super) q: f64,
    pub(super) a: f64,
    pub(super) b: f64,
    pub(super) c: f64,
}

impl Heights {
    /// Heights whose coefficients h, p, q, a, b, c have the unit of length `unit` (CRS units).
    pub(super) fn from_units_of(unit: f64, [h, p, q, a, b, c]: [f64; 6]) -> Self {
        Self {
            h: h * unit,
            p,
            q,
            a: a / unit,
            b: b / unit,
            c: c / unit,
        }
    }

    /// The coefficients h, p, q, a, b, c with the unit of length `unit` (CRS units).
    pub(super) fn in_units_of(&self, unit: f64) -> [f64; 6] {
        let Self { h, p, q, a, b, c } = *self;
        [h / unit, p, q, a * unit, b * unit, c * unit]
    }

    /// The height `w` over `(u, v)`.
    #[inline]
    pub(super) fn at(&self, u: f64, v: f64) -> f64 {
        self.h + u * (self.p + 0.5 * self.a * u + self.b * v) + v * (self.q + 0.5 * self.c * v)
    }

    /// The quadratic term over a way of `(u, v)`: at the share t of the way the chord lies
    /// t (1 − t) times this above the surface.
    #[inline]
    pub(super) fn quadratic_term(&self, u: f64, v: f64) -> f64 {
        0.5 * (self.a * u * u + 2.0 * self.b * u * v + self.c * v * v)
    }

    /// The derivatives along `u` and `v` over `(u, v)`.
    #[inline]
    pub(super) fn slopes(&self, u: f64, v: f64) -> [f64; 2] {
        [
            self.p + self.a * u + self.b * v,
            self.q + self.b * u + self.c * v,
        ]
    }

    /// The heights of this surface in a frame moved to the origin `(u, v, w)`.
    #[inline]
    pub(super) fn seen_from(&self, [u, v, w]: [f64; 3]) -> Self {
        let h = self.at(u, v) - w;
        let [p, q] = self.slopes(u, v);
        Self { h, p, q, ..*self }
    }

    /// Bound on the quadratic term over a way of `length` (CRS units): four times the largest
    /// sagitta.
    #[inline]
    pub(super) fn max_quadratic_term(&self, length: f64) -> f64 {
        let Self { a, b, c, .. } = *self;
        let curvature = a * a + 2.0 * b * b + c * c;
        0.5 * curvature.sqrt() * length * length
    }
}
