//! Convergence rates by theory.

use crate::plan::Search;
use crate::render::{BandwidthRule, Settings};

/// Exponent of the squared error as a power of the number of iterations, with its reason.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Theory {
    /// Exponent in the limit of many iterations, 0 or below.
    pub exponent: f64,
    /// The reason for the exponent, in a clause.
    pub because: &'static str,
}

/// Exponent by theory of the error of a method with its settings; `None` if theory has no closed form.
///
/// With squared bandwidths that shrink as i^(alpha - 1) the variance of the mean falls as N^-alpha and its squared bias
/// as N^(2 alpha - 2) \[Knaus and Zwicker 2011\]; the slower of the two is the exponent, best at alpha = 2/3
/// \[Kaplanyan and Dachsbacher 2013\].
pub fn theory(settings: &Settings) -> Option<Theory> {
    let kernel = -settings.alpha.min(2.0 - 2.0 * settings.alpha);
    let (exponent, because) = match (settings.method.search(), settings.method.rules()) {
        (Search::Map, _) => (0.0, "one map: its error stays"),
        (_, []) => (-1.0, "unbiased: variance alone, N^−1"),
        (Search::ConnectionsAndMerging, _) => (kernel, "of what is merged; where connections do, N^−1"),
        (_, [BandwidthRule::Memoryless, ..]) => (kernel, "the slower of variance N^−α and squared bias N^(2α − 2)"),
        _ => return None,
    };
    // Adding zero turns -0 into 0.
    Some(Theory { exponent: exponent + 0.0, because })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::Method;

    #[test]
    fn the_memoryless_rule_is_best_at_two_thirds() {
        let of = |alpha| theory(&Settings { alpha, ..Settings::default() }).map(|t| t.exponent);
        assert_eq!(of(2.0 / 3.0), Some(-2.0 / 3.0));
        assert_eq!((of(0.75), of(0.5), of(1.0)), (Some(-0.5), Some(-0.5), Some(0.0)));
        assert_eq!(theory(&Settings { method: Method::Path, ..Settings::default() }).map(|t| t.exponent), Some(-1.0));
        assert_eq!(theory(&Settings { method: Method::Cppm, ..Settings::default() }), None);
    }
}
