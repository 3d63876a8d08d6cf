//! Checks whether an option has an effect with the chosen method.

use super::render::RenderOptions;
use super::values::{BandwidthChoice, OnOff};
use crate::error::{Error, Result};
use crate::photon::Kernel;
use crate::render::{BandwidthRule, Method, RadiusRule, Settings, Shard};
use crate::transport::Indirect;

/// Whether an option, given by the name of its field, has an effect with a method.
pub fn takes(option: &str, method: Method) -> bool {
    match option {
        "photons" | "knn" => method.takes_photon_count(),
        "photon_memory" => method.has_one_map(),
        "levels" => method.has_levels(),
        "initial_bandwidth" => method.has_bandwidths(),
        "alpha" | "radius_rule" => method.takes_alpha(),
        "kernel" => method.takes_kernels(BandwidthRule::Memoryless),
        "guide" => method.supports_guiding(),
        "indirect" => method.search_with_paths().is_some(),
        "light_paths" | "connections" => method.takes_counts(),
        "merging" => method.takes_counts() && method.has_bandwidths(),
        "debug_techniques" => method.has_techniques(),
        option => !option.starts_with("cppm_") || method.rules().contains(&BandwidthRule::ChiSquared),
    }
}

/// Makes the error of an option that has no effect in the case `with`, such as `with --method path`; the hint suggests the
/// method `other`.
fn no_effect(option: &str, with: &str, other: &str) -> Error {
    let option = format!("--{}", option.replace('_', "-"));
    let error = Error::usage(format!("{option} has no effect {with}"));
    error.hint(format!("leave {option} out, or choose --method {other}"))
}

impl RenderOptions {
    /// Makes the error of an option that has no effect with the chosen method; the hint suggests the method `other`.
    pub fn no_effect(&self, option: &str, chosen: Option<Method>, other: &str) -> Error {
        let plus = if self.cppm_plus { " --cppm-plus" } else { "" };
        match chosen {
            None => no_effect(option, &format!("before a method is chosen{}", plus.replace(" --", ", with --")), other),
            Some(method) => no_effect(option, &format!("with --method {}{plus}", method.name()), other),
        }
    }

    /// Names of the options that depend on the method, and whether the user has set each to something other than off.
    fn method_options(&self) -> [(&'static str, bool); 17] {
        [
            ("photons", self.photons.is_some()),
            ("light_paths", self.light_paths.is_some()),
            ("connections", self.connections.is_some()),
            ("merging", self.merging.is_some()),
            ("photon_memory", self.photon_memory.is_some()),
            ("levels", self.levels.is_some_and(|levels| levels > 1)),
            ("knn", self.knn.is_some()),
            ("initial_bandwidth", self.initial_bandwidth.is_some()),
            ("alpha", self.alpha.is_some()),
            ("radius_rule", self.radius_rule.is_some()),
            ("cppm_grid", self.cppm_grid.is_some()),
            ("cppm_k", self.cppm_k.is_some()),
            ("cppm_beta", self.cppm_beta.is_some()),
            ("cppm_significance", self.cppm_significance.is_some()),
            ("cppm_plus", self.cppm_plus),
            ("guide", self.guide == Some(OnOff::On)),
            ("indirect", self.indirect == Some(Indirect::Paths)),
        ]
    }

    /// Rejects options that have no effect with `method`. `chosen` is the method to name in the error, `None` before
    /// `auto` has chosen.
    pub(super) fn check_method(&self, method: Method, chosen: Option<Method>, rule: RadiusRule) -> Result<()> {
        let local = rule == RadiusRule::Local;
        if self.kernel.is_some_and(|kernel| kernel != Kernel::Box) && (local || !takes("kernel", method)) {
            let what = if local { "the local rule" } else { method.name() };
            return Err(Error::usage(format!("{what} needs the box kernel"))
                .hint("leave --kernel out, or choose --method sppm with the memoryless rule, or appm"));
        }
        let by_neighbours = self.initial_bandwidth == Some(BandwidthChoice::Knn);
        let contradicted = |option: &str| match option {
            "initial_bandwidth" => by_neighbours && !method.takes_photon_count(),
            "radius_rule" => self.radius_rule.is_some_and(|rule| !method.rules().contains(&rule.into())),
            "guide" => self.cppm_plus,
            "indirect" => local,
            _ => false,
        };
        let has_no_effect = |(option, set): &(&str, bool)| *set && (!takes(option, method) || contradicted(option));
        let Some((option, _)) = self.method_options().into_iter().find(has_no_effect) else { return Ok(()) };
        let other = match option {
            "photon_memory" => "pm",
            "light_paths" | "connections" | "merging" => "vcm",
            option if option.starts_with("cppm") => "cppm",
            _ => "sppm",
        };
        let shown =
            if option == "initial_bandwidth" && method.has_bandwidths() { "initial_bandwidth knn" } else { option };
        Err(self.no_effect(shown, chosen, other))
    }

    /// Rejects a shard (a part of the iterations) that has none, and shards of a method whose iterations depend on each
    /// other.
    pub(super) fn check_shard(&self, settings: &Settings) -> Result<()> {
        let Settings { shard: Shard { index, count }, iterations, method, .. } = *settings;
        if let Some(n) = iterations.filter(|n| index >= *n) {
            let error = Error::usage(format!("shard {index} of {count} holds none of {n} iterations"));
            return Err(error.hint("use fewer shards or more --iterations"));
        }
        if self.shard.is_some() && !settings.is_memoryless() {
            let rule = if method.rules().len() > 1 { " with local statistics" } else { "" };
            let name = self.method.name();
            let cause =
                format!("--shard cannot divide --method {name}{rule}: its bandwidths depend on all iterations before");
            return Err(
                Error::usage(cause).hint("choose --method sppm with the memoryless rule, or render on one machine")
            );
        }
        Ok(())
    }
}
