//! Number formats of the report's tables and plots.

use super::curve::Mean;

/// A number with three significant digits: `0.0123`, `12.3`, `4.56e-5`.
pub fn short(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return format!("{x}");
    }
    let power = x.abs().log10().floor();
    match power {
        -3.0..5.0 => format!("{x:.digits$}", digits = (2.0 - power).max(0.0) as usize),
        _ => format!("{x:.2e}"),
    }
}

/// [`short`] without trailing zeros: `6`, `0.5`, `2e-5`.
pub fn plain(x: f64) -> String {
    let shown = short(x);
    let trimmed = |text: &str| match text.split_once('.') {
        Some(_) => text.trim_end_matches('0').trim_end_matches('.').to_string(),
        None => text.to_string(),
    };
    shown.split_once('e').map_or_else(|| trimmed(&shown), |(digits, power)| format!("{}e{power}", trimmed(digits)))
}

/// A mean and its standard error with `digits` decimals: `-0.672 ± 0.014`; the mean alone without a standard error.
pub fn with_error(mean: &Mean, digits: usize) -> String {
    let value = minus(&format!("{:.digits$}", mean.value));
    mean.error.map_or(value.clone(), |error| format!("{value} ± {error:.digits$}"))
}

/// A mean rounded to two digits of its standard error: `0.7283 ± 0.0056`; [`short`] without a standard error.
pub fn short_with_error(mean: &Mean) -> String {
    match mean.error.filter(|error| *error > 0.0 && error.is_finite()) {
        Some(error) => with_error(mean, (1.0 - error.log10().floor()).clamp(0.0, 8.0) as usize),
        None => short(mean.value),
    }
}

/// A number of iterations in words: `1 iteration`, `12 iterations`.
pub fn iterations(n: u64) -> String {
    if n == 1 { "1 iteration".into() } else { format!("{n} iterations") }
}

/// The text of a number with hyphens replaced by minus signs.
pub fn minus(text: &str) -> String {
    text.replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_significant_digits() {
        let shown = [0.0123456, 1.0, 12.345, 1234.0, 0.0000456, 1234567.0, 0.0].map(short);
        assert_eq!(shown, ["0.0123", "1.00", "12.3", "1234", "4.56e-5", "1.23e6", "0"]);
        assert_eq!([1000.0, 0.001, 0.5, 2e-5, 1e6].map(plain), ["1000", "0.001", "0.5", "2e-5", "1e6"]);
        assert_eq!(short_with_error(&Mean { value: 0.72834, error: Some(0.00557) }), "0.7283 ± 0.0056");
        assert_eq!(with_error(&Mean { value: -0.6721, error: Some(0.0144) }, 2), "−0.67 ± 0.01");
    }
}
