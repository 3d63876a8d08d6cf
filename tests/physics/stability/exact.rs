//! Numbers with twice the digits of f64 \[Dekker 1971; Knuth, TAOCP 2, 4.2.2\]: sums and products to about 2^-100.

use std::ops::{Add, Div, Mul, Sub};

/// A sum of two f64 whose digits do not overlap.
#[derive(Clone, Copy, Debug, Default)]
pub struct Exact {
    high: f64,
    low: f64,
}

impl Exact {
    pub fn new(value: f64) -> Exact {
        Exact { high: value, low: 0.0 }
    }

    pub fn value(self) -> f64 {
        self.high + self.low
    }

    /// Relative error of `value`.
    pub fn error_of(self, value: f64) -> f64 {
        ((Exact::new(value) - self).value() / self.value()).abs()
    }

    fn renormalised(high: f64, low: f64) -> Exact {
        let sum = high + low;
        Exact { high: sum, low: low - (sum - high) }
    }
}

/// A sum and its rounding error.
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let from_b = sum - a;
    (sum, (a - (sum - from_b)) + (b - from_b))
}

impl Add for Exact {
    type Output = Exact;

    fn add(self, other: Exact) -> Exact {
        let (high, error) = two_sum(self.high, other.high);
        let (low, rest) = two_sum(self.low, other.low);
        let Exact { high, low: error } = Exact::renormalised(high, error + low);
        Exact::renormalised(high, error + rest)
    }
}

impl Sub for Exact {
    type Output = Exact;

    fn sub(self, Exact { high, low }: Exact) -> Exact {
        self + Exact { high: -high, low: -low }
    }
}

impl Mul for Exact {
    type Output = Exact;

    fn mul(self, other: Exact) -> Exact {
        let high = self.high * other.high;
        let error = self.high.mul_add(other.high, -high);
        Exact::renormalised(high, error + (self.high * other.low + self.low * other.high))
    }
}

impl Div for Exact {
    type Output = Exact;

    /// Two steps of long division.
    fn div(self, other: Exact) -> Exact {
        let first = self.high / other.high;
        let rest = self - other * Exact::new(first);
        let second = rest.high / other.high;
        let rest = rest - other * Exact::new(second);
        Exact::renormalised(first, second) + Exact::new(rest.high / other.high)
    }
}

/// A third, ten times a tenth, and a sum whose terms cancel except for the last digit.
#[test]
fn exact_numbers_have_the_digits_that_f64_lacks() {
    let third = Exact::new(1.0) / Exact::new(3.0);
    let nine = third * Exact::new(9.0) - Exact::new(3.0);
    assert!(nine.value().abs() < 1e-30, "{nine:?}");
    let tenth = Exact::new(1.0) / Exact::new(10.0);
    let one = (0..10).fold(Exact::default(), |sum, _| sum + tenth);
    assert!(one.error_of(1.0) < 1e-30 && (0..10).map(|_| 0.1).sum::<f64>() != 1.0);
    let left = Exact::new(1e20) + Exact::new(1.0) - Exact::new(1e20);
    assert_eq!(left.value(), 1.0);
}
