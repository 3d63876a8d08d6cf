//! Fits of power laws.

/// `y = factor * x^exponent`, fitted by least squares of the logarithms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PowerLaw {
    /// Exponent: the slope in a log-log plot.
    pub exponent: f64,
    /// Standard error of the exponent from the scatter of the points about the line, if the points are independent.
    pub exponent_error: f64,
    /// The fitted value `y` at `x = 1`.
    pub factor: f64,
}

impl PowerLaw {
    /// Fits points `(x, y)`. Points with a coordinate that is not finite and positive are ignored. `None` for fewer
    /// than three points, or if all have the same `x`.
    pub fn fit(points: impl IntoIterator<Item = (f64, f64)>) -> Option<PowerLaw> {
        let usable = |v: f64| v.is_finite() && v > 0.0;
        let logs: Vec<(f64, f64)> =
            points.into_iter().filter(|&(x, y)| usable(x) && usable(y)).map(|(x, y)| (x.ln(), y.ln())).collect();
        let n = logs.len() as f64;
        let (mean_x, mean_y) = (logs.iter().map(|p| p.0).sum::<f64>() / n, logs.iter().map(|p| p.1).sum::<f64>() / n);
        let sxx: f64 = logs.iter().map(|p| (p.0 - mean_x).powi(2)).sum();
        if logs.len() < 3 || sxx < 1e-12 {
            return None;
        }
        let exponent = logs.iter().map(|p| (p.0 - mean_x) * (p.1 - mean_y)).sum::<f64>() / sxx;
        let scatter: f64 = logs.iter().map(|p| (p.1 - mean_y - exponent * (p.0 - mean_x)).powi(2)).sum();
        Some(PowerLaw {
            exponent,
            exponent_error: (scatter / (n - 2.0) / sxx).sqrt(),
            factor: (mean_y - exponent * mean_x).exp(),
        })
    }

    /// The fitted value `y` at `x`.
    pub fn at(&self, x: f64) -> f64 {
        self.factor * x.powf(self.exponent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Domain, Purpose, Stream};

    /// 400 fits of 8 points with 10 % noise. The standard error must match the scatter of the fitted exponents, and a
    /// wrong exponent must be more than three standard errors away.
    #[test]
    fn planted_exponents_come_back_within_their_standard_error() {
        for planted in [-1.0, -2.0 / 3.0, -0.5] {
            let fits: Vec<PowerLaw> = (0..400)
                .map(|index| {
                    let points = (0..8u32).map(|i| {
                        let x = 100.0 * 2f64.powf(f64::from(i) / 2.0);
                        // Uniform noise of standard deviation 0.1.
                        let u = Stream::new(3, 1 + u64::from(i), Domain::Test, index).vertex(0).two(Purpose::Pixel).x;
                        (x, 0.3 * x.powf(planted) * (0.1 * 12f64.sqrt() * (f64::from(u) - 0.5)).exp())
                    });
                    PowerLaw::fit(points).expect("eight points")
                })
                .collect();
            let n = fits.len() as f64;
            let mean = fits.iter().map(|f| f.exponent).sum::<f64>() / n;
            let deviation = (fits.iter().map(|f| (f.exponent - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
            let claimed = (fits.iter().map(|f| f.exponent_error.powi(2)).sum::<f64>() / n).sqrt();
            assert!((mean - planted).abs() < 4.0 * deviation / n.sqrt(), "{planted}: {mean}");
            assert!((claimed / deviation - 1.0).abs() < 0.15, "{claimed} for {deviation}");
            let away =
                |exponent: f64| fits.iter().filter(move |f| (f.exponent - exponent).abs() > 3.0 * f.exponent_error);
            // With six degrees of freedom 2.4 % lie beyond three standard errors.
            assert!(away(planted).count() < 24, "{planted}");
            assert!(away(planted + 0.33).count() > 380, "{planted}");
        }
    }

    #[test]
    fn too_few_points_give_no_fit() {
        assert_eq!(PowerLaw::fit([(1.0, 1.0), (2.0, 0.5)]), None);
        assert_eq!(PowerLaw::fit([(1.0, 1.0), (1.0, 0.5), (1.0, 0.7)]), None);
        assert_eq!(PowerLaw::fit([(1.0, 1.0), (2.0, 0.5), (3.0, 0.0), (4.0, f64::NAN)]), None);
        let law = PowerLaw::fit([(1.0, 3.0), (10.0, 0.3), (100.0, 0.03)]).expect("three points");
        assert!((law.exponent + 1.0).abs() < 1e-12 && (law.at(1000.0) - 0.003).abs() < 1e-12, "{law:?}");
    }
}
