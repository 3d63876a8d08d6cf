//! The median.

use std::cmp::Ordering;

/// The upper median of `values` by `order`; `None` if there are no values. Reorders the values.
pub fn median<T: Copy>(values: &mut [T], order: impl FnMut(&T, &T) -> Ordering) -> Option<T> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, order).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_of_the_values_are_below() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0], f32::total_cmp), Some(2.0));
        assert_eq!(median(&mut [4, 1, 3, 2], Ord::cmp), Some(3));
        assert_eq!(median(&mut [], f64::total_cmp), None);
    }
}
