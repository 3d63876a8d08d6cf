//! A small plot for the terminal: error against seconds or iterations, with logarithmic axes.

/// Number of columns and rows of characters in the plotting area.
const SIZE: (usize, usize) = (56, 10);

/// Plots points (x, y) above zero on logarithmic axes, as text. Returns an empty text for fewer than two points.
/// `x_name` includes the unit.
pub fn log_log(points: &[(f64, f64)], x_name: &str, y_name: &str) -> String {
    let logs: Vec<(f64, f64)> = points
        .iter()
        .filter(|(x, y)| x.is_finite() && y.is_finite() && *x > 0.0 && *y > 0.0)
        .map(|(x, y)| (x.log10(), y.log10()))
        .collect();
    if logs.len() < 2 {
        return String::new();
    }
    let range = |get: fn(&(f64, f64)) -> f64| {
        let low = logs.iter().map(get).fold(f64::INFINITY, f64::min);
        let high = logs.iter().map(get).fold(f64::NEG_INFINITY, f64::max);
        (low, (high - low).max(1e-9))
    };
    let ((x0, dx), (y0, dy)) = (range(|p| p.0), range(|p| p.1));
    let mut rows = vec![[b' '; SIZE.0]; SIZE.1];
    for (x, y) in &logs {
        let column = ((x - x0) / dx * (SIZE.0 - 1) as f64).round() as usize;
        let row = ((y - y0) / dy * (SIZE.1 - 1) as f64).round() as usize;
        rows[SIZE.1 - 1 - row][column] = b'*';
    }
    let mut text = format!("{y_name}\n");
    for (i, row) in rows.iter().enumerate() {
        let label = match i {
            0 => short(10f64.powf(y0 + dy)),
            i if i == SIZE.1 - 1 => short(10f64.powf(y0)),
            _ => String::new(),
        };
        text += format!("{label:>9} |{}", String::from_utf8_lossy(row)).trim_end();
        text.push('\n');
    }
    let (left, right) = (short(10f64.powf(x0)), short(10f64.powf(x0 + dx)));
    text += &format!("{:>9} +{}\n", "", "-".repeat(SIZE.0));
    text += &format!("{:>11}{left}{right:>width$}  {x_name}\n", "", width = SIZE.0 - left.len());
    text
}

/// A number as text with three significant digits.
fn short(x: f64) -> String {
    let digits = (2.0 - x.abs().log10().floor()).clamp(0.0, 8.0) as usize;
    if x >= 1e6 { format!("{x:.2e}") } else { format!("{x:.digits$}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_law_is_a_straight_line_from_corner_to_corner() {
        let points: Vec<(f64, f64)> = (0..10).map(|i| (2f64.powi(i), 0.5 / 2f64.powi(i))).collect();
        let text = log_log(&points, "seconds", "error");
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 1 + SIZE.1 + 2);
        assert!(lines[1].starts_with("    0.500 |*"), "{text}");
        assert!(lines[SIZE.1].ends_with('*') && lines[SIZE.1].len() == 11 + SIZE.0, "{text}");
        assert!(lines[SIZE.1 + 2].trim_start().starts_with("1.00"), "{text}");
        assert_eq!(log_log(&points[..1], "seconds", "error"), "");
        assert_eq!(log_log(&[(1.0, 0.0), (2.0, f64::NAN)], "seconds", "error"), "");
    }
}
