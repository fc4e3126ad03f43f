//! Curves through points, for tables of measurements.

use num_dual::DualNum;

/// A function of one variable given by points, constant beyond the ends.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Abscissas, strictly increasing.
    x: Vec<f64>,
    /// Piecewise linear curves have a value at each abscissa, step functions one between each two.
    y: Vec<f64>,
}

impl Curve {
    /// The piecewise linear curve through these points. `None` unless there are at least two, all finite, with strictly
    /// increasing abscissas.
    pub fn through(x: Vec<f64>, y: Vec<f64>) -> Option<Self> {
        let increases = x.windows(2).all(|pair| pair[0] < pair[1]);
        let finite = x.iter().chain(&y).all(|value| value.is_finite());
        (x.len() >= 2 && x.len() == y.len() && increases && finite).then_some(Self { x, y })
    }

    /// Abscissas and values: a value for each abscissa, or one fewer if the curve is a step function.
    pub fn points(&self) -> [&[f64]; 2] {
        [&self.x, &self.y]
    }

    /// The derivative: a step function, 0 beyond the ends.
    pub fn slope(&self) -> Self {
        let steps = self.is_steps();
        let slope = |k: usize| match steps {
            true => 0.0,
            false => (self.y[k + 1] - self.y[k]) / (self.x[k + 1] - self.x[k]),
        };
        Self {
            y: (0..self.x.len() - 1).map(slope).collect(),
            x: self.x.clone(),
        }
    }

    /// The abscissas at which the curve has a kink or a jump.
    pub fn kinks(&self) -> impl Iterator<Item = f64> {
        let slope = self.slope();
        let change = move |k: &usize| {
            let of = |curve: &Self| {
                let before = k.checked_sub(1).map_or(0.0, |k| curve.y[k]);
                before != curve.y.get(*k).copied().unwrap_or(0.0)
            };
            if self.is_steps() {
                of(self)
            } else {
                of(&slope)
            }
        };
        (0..self.x.len()).filter(change).map(|k| self.x[k])
    }

    /// The value of the curve, if it is constant.
    pub fn constant(&self) -> Option<f64> {
        let zero = self.is_steps() && self.y.iter().all(|value| *value == 0.0);
        let equal = self.y.iter().all(|value| *value == self.y[0]);
        (zero || (!self.is_steps() && equal)).then_some(self.y[0])
    }

    /// The value at `x`.
    pub fn at(&self, x: f64) -> f64 {
        match self.place(x) {
            Ok(k) if self.is_steps() => self.y[k],
            Err(_) if self.is_steps() => match x.is_nan() {
                true => f64::NAN,
                false => 0.0,
            },
            Ok(k) => {
                // Halved, since differences of large numbers may overflow.
                let part = (x / 2.0 - self.x[k] / 2.0) / (self.x[k + 1] / 2.0 - self.x[k] / 2.0);
                (1.0 - part) * self.y[k] + part * self.y[k + 1]
            }
            Err(end) => end,
        }
    }

    /// The value at a number of any type, with the derivatives of the line on which it lies.
    pub fn of<T: DualNum<Primitive = f64> + Copy>(&self, x: T) -> T {
        let value = T::from(self.at(x.re()));
        match self.is_steps() {
            true => value,
            false => value + (x - T::from(x.re())) * T::from(self.slope_at(x.re())),
        }
    }

    fn slope_at(&self, x: f64) -> f64 {
        match self.place(x) {
            Ok(k) => (self.y[k + 1] - self.y[k]) / (self.x[k + 1] - self.x[k]),
            Err(_) => 0.0,
        }
    }

    fn is_steps(&self) -> bool {
        self.y.len() < self.x.len()
    }

    /// The interval in which a number lies, or the end value beyond it; NaN for NaN.
    fn place(&self, x: f64) -> Result<usize, f64> {
        let last = self.x.len() - 1;
        if x.is_nan() {
            return Err(f64::NAN);
        }
        match self.x.partition_point(|own| *own <= x) {
            0 => Err(self.y[0]),
            k if k > last && x > self.x[last] => Err(self.y[self.y.len() - 1]),
            k => Ok((k - 1).min(last - 1)),
        }
    }
}
