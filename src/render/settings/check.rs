//! Checks whether options have an effect with the chosen method, and contradict each other.

use super::request::SettingsRequest;
use super::values::{BandwidthChoice, OnOff};
use super::{BandwidthRule, Method, RadiusRule, Settings, Shard};
use crate::error::{Error, Result};
use crate::photon::Kernel;
use crate::transport::Indirect;

/// An option that some methods do not take.
struct OfMethods {
    /// Name of the option's field.
    option: &'static str,
    /// Whether the user has set the option to something other than off.
    is_set: bool,
    /// Whether the option has an effect with a method.
    takes: fn(Method) -> bool,
    /// Method that errors suggest.
    other: &'static str,
}

impl SettingsRequest {
    /// Whether an option, given by the name of its field, has an effect with a method.
    pub fn takes(option: &str, method: Method) -> bool {
        let all = SettingsRequest::default().options_of_methods();
        all.iter().find(|of| of.option == option).is_none_or(|of| (of.takes)(method))
    }

    /// Makes the error of an option that has no effect with the chosen method; the hint suggests the method `other`.
    pub fn no_effect(&self, option: &str, chosen: Option<Method>, other: &str) -> Error {
        let plus = if self.cppm_plus { " --cppm-plus" } else { "" };
        let with = match chosen {
            None => format!("before a method is chosen{}", plus.replace(" --", ", with --")),
            Some(method) => format!("with --method {}{plus}", method.name()),
        };
        let option = format!("--{}", option.replace('_', "-"));
        let error = Error::usage(format!("{option} has no effect {with}"));
        error.hint(format!("leave {option} out, or choose --method {other}"))
    }

    /// The options that some methods do not take.
    fn options_of_methods(&self) -> [OfMethods; 19] {
        let of = |option, is_set, takes, other| OfMethods { option, is_set, takes, other };
        let merges: fn(Method) -> bool = |method| method.takes_counts() && method.has_bandwidths();
        let tests: fn(Method) -> bool = |method| method.rules().contains(&BandwidthRule::ChiSquared);
        [
            of("photons", self.photons.is_some(), Method::takes_photon_count, "sppm"),
            of("light_paths", self.light_paths.is_some(), Method::takes_counts, "vcm"),
            of("connections", self.connections.is_some(), Method::takes_counts, "vcm"),
            of("merging", self.merging.is_some(), merges, "vcm"),
            of("photon_memory", self.photon_memory.is_some(), Method::has_one_map, "pm"),
            of("levels", self.levels.is_some_and(|levels| levels > 1), Method::has_levels, "sppm"),
            of("knn", self.knn.is_some(), Method::takes_photon_count, "sppm"),
            of("initial_bandwidth", self.initial_bandwidth.is_some(), Method::has_bandwidths, "sppm"),
            of("alpha", self.alpha.is_some(), Method::takes_alpha, "sppm"),
            of("radius_rule", self.radius_rule.is_some(), Method::takes_alpha, "sppm"),
            of("kernel", false, |method| method.takes_kernels(BandwidthRule::Memoryless), "sppm"),
            of("cppm_grid", self.cppm_grid.is_some(), tests, "cppm"),
            of("cppm_k", self.cppm_k.is_some(), tests, "cppm"),
            of("cppm_beta", self.cppm_beta.is_some(), tests, "cppm"),
            of("cppm_significance", self.cppm_significance.is_some(), tests, "cppm"),
            of("cppm_plus", self.cppm_plus, tests, "cppm"),
            of("guide", self.guide == Some(OnOff::On), Method::supports_guiding, "sppm"),
            of("indirect", self.indirect == Some(Indirect::Paths), |m| m.search_with_paths().is_some(), "sppm"),
            of("debug_techniques", self.techniques, Method::has_techniques, "vcm"),
        ]
    }

    /// Rejects options that have no effect with `method`. `chosen` is the method to name in the error, `None` before
    /// `auto` has chosen.
    pub(super) fn check_method(&self, method: Method, chosen: Option<Method>, rule: RadiusRule) -> Result<()> {
        let local = rule == RadiusRule::Local;
        if self.kernel.is_some_and(|kernel| kernel != Kernel::Box)
            && (local || !SettingsRequest::takes("kernel", method))
        {
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
        let has_no_effect = |of: &&OfMethods| of.is_set && (!(of.takes)(method) || contradicted(of.option));
        let options = self.options_of_methods();
        let Some(OfMethods { option, other, .. }) = options.iter().find(has_no_effect) else { return Ok(()) };
        let shown = match *option {
            "initial_bandwidth" if method.has_bandwidths() => "initial_bandwidth knn",
            option => option,
        };
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
