use asperity_diagnostics::Diagnostic;

use super::{Filter, MAX_ORDER, Triangles, line_spectrum};

/// The acceleration at one speed and force.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// `a_1 .. a_p`: the roots of `1 + a_1 z^-1 + ..` lie within the unit circle.
    pub ar: Vec<f64>,
    /// `b_1 .. b_q`: the roots of `1 + b_1 z^-1 + ..` too.
    pub ma: Vec<f64>,
    /// Variance of the noise in (m/s^2)^2, 0 or more.
    pub variance: f64,
    /// Factor on the noise, 0 or more.
    pub gain: f64,
    /// Speed in mm/s, 0 or more.
    pub speed_mm_s: f64,
    /// Normal force in N, 0 or more.
    pub force_n: f64,
}

impl Model {
    /// Speed in mm/s and force in N.
    pub(super) fn place(&self) -> [f64; 2] {
        [self.speed_mm_s, self.force_n]
    }

    /// The model as a filter.
    pub fn filter(&self) -> Filter {
        let mut filter = Filter::new(&self.ar, &self.ma, self.variance.sqrt());
        filter.gain = self.gain;
        filter
    }

    /// Checks the model.
    ///
    /// # Errors
    /// A number that is not finite or below 0; more than [`MAX_ORDER`] coefficients; a polynomial with
    /// a root on or outside the unit circle.
    pub fn check(&self) -> Result<(), Diagnostic> {
        self.lines().map(drop)
    }

    /// The line spectral frequencies of both polynomials.
    fn lines(&self) -> Result<[Vec<f64>; 2], Diagnostic> {
        let numbers = [self.variance, self.gain, self.speed_mm_s, self.force_n];
        for (name, value) in ["variance", "gain", "speed", "force"].into_iter().zip(numbers) {
            if !(value.is_finite() && value >= 0.0) {
                return Err(Diagnostic::new(format!("the {name} of a model is {value}"))
                    .help("a finite number, 0 or more"));
            }
        }
        let lines = |coefficients: &[f64], what: &str, bad: &str| {
            let count = coefficients.len();
            if count > MAX_ORDER {
                return Err(Diagnostic::new(format!("a model of {count} {what} coefficients"))
                    .help(format!("at most {MAX_ORDER} are taken")));
            }
            line_spectrum::from_polynomial(coefficients).ok_or_else(|| {
                Diagnostic::new(format!("the {what} part of a model is {bad}"))
                    .help("all roots of its polynomial 1 + c_1 z^-1 + .. lie within the unit circle")
            })
        };
        Ok([
            lines(&self.ar, "autoregressive", "not stable")?,
            lines(&self.ma, "moving-average", "not of minimum phase")?,
        ])
    }
}

/// A texture: models at some speeds and forces, mixed in between.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    rate_hz: f64,
    models: Vec<Model>,
    lines: Vec<[Vec<f64>; 2]>,
    orders: [usize; 2],
    triangles: Triangles,
}

impl Texture {
    /// A texture of models for signals at `rate_hz`. `triangles` are corners by number, from 0. Without
    /// them, or where they do not tile the hull of the models, Delaunay's triangulation is made.
    ///
    /// # Errors
    /// A rate that is not positive and finite; no model; a model that is not stable or has a number out
    /// of range; models of different orders. An error of a model names its number, from 1.
    pub fn new(
        rate_hz: f64,
        models: Vec<Model>,
        triangles: Option<&[[usize; 3]]>,
    ) -> Result<Self, Diagnostic> {
        Self::checked(rate_hz, models, triangles).map_err(|(model, e)| match model {
            Some(i) => Diagnostic { message: format!("model {}: {}", i + 1, e.message), ..e },
            None => e,
        })
    }

    /// Like [`new`](Self::new), but an error comes with the number of its model, from 0.
    pub(super) fn checked(
        rate_hz: f64,
        models: Vec<Model>,
        triangles: Option<&[[usize; 3]]>,
    ) -> Result<Self, (Option<usize>, Diagnostic)> {
        if !(rate_hz.is_finite() && rate_hz > 0.0) {
            let e = Diagnostic::new(format!("a rate of {rate_hz} Hz")).help("a finite number above 0");
            return Err((None, e));
        }
        let Some(first) = models.first() else {
            return Err((None, Diagnostic::new("a texture without models")));
        };
        let orders = [first.ar.len(), first.ma.len()];
        let mut lines = Vec::with_capacity(models.len());
        for (i, model) in models.iter().enumerate() {
            lines.push(model.lines().map_err(|e| (Some(i), e))?);
            let found = [model.ar.len(), model.ma.len()];
            if found != orders {
                let [[p, q], [r, s]] = [found, orders];
                let what = format!("{p} and {q} coefficients, where the first has {r} and {s}");
                let e = Diagnostic::new(what).help("models can be mixed when they are of the same order");
                return Err((Some(i), e));
            }
        }
        let points: Vec<[f64; 2]> = models.iter().map(Model::place).collect();
        let triangles = triangles
            .and_then(|t| Triangles::given(&points, t))
            .unwrap_or_else(|| Triangles::delaunay(&points));
        Ok(Self { rate_hz, models, lines, orders, triangles })
    }

    /// Rate of its signals in Hz.
    pub fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// The models.
    pub fn models(&self) -> &[Model] {
        &self.models
    }

    /// The triangles between them.
    pub fn triangles(&self) -> &Triangles {
        &self.triangles
    }

    /// A silent filter to [`fill`](Self::fill).
    pub fn silence(&self) -> Filter {
        Filter::silent(self.orders)
    }

    /// The filter at a speed in mm/s and a force in N. It is silent where either is not above 0.
    pub fn at(&self, speed_mm_s: f64, force_n: f64) -> Filter {
        let mut filter = self.silence();
        self.fill(speed_mm_s, force_n, &mut filter);
        filter
    }

    /// Like [`at`](Self::at), but writes a filter of this texture. Nothing is allocated. A silent
    /// filter keeps the resonances at the nearest point, so that a signal dies away.
    pub fn fill(&self, speed_mm_s: f64, force_n: f64, filter: &mut Filter) {
        let blend = self.triangles.at(speed_mm_s, force_n);
        let mut lines = [[0.0; MAX_ORDER]; 2];
        let (mut variance, mut gain) = (0.0, 0.0);
        for (&m, &weight) in blend.models.iter().zip(&blend.weights) {
            let (Some(model), Some(of_model)) = (self.models.get(m), self.lines.get(m)) else { continue };
            variance += weight * model.variance;
            gain += weight * model.gain;
            for (sum, lines) in lines.iter_mut().zip(of_model) {
                sum.iter_mut().zip(lines).for_each(|(sum, w)| *sum += weight * w);
            }
        }
        for ((order, lines), to) in self.orders.into_iter().zip(&lines).zip(filter.coefficients()) {
            line_spectrum::to_polynomial(&lines[..order], to);
        }
        let moves = speed_mm_s > 0.0 && force_n > 0.0;
        filter.deviation = if moves { variance.max(0.0).sqrt() } else { 0.0 };
        filter.gain = gain;
    }
}
