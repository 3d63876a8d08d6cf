//! Values in which the user gives settings.

use super::method::Method;
#[cfg(feature = "cli")]
use clap::ValueEnum;
#[cfg(feature = "cli")]
use clap::builder::PossibleValue;
use serde::{Serialize, Serializer};
use std::str::FromStr;
#[cfg(feature = "cli")]
use std::sync::LazyLock;

/// The value of `--method`; `None` is `auto`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MethodChoice(pub Option<Method>);

/// Help text of `--method auto`.
#[cfg(feature = "cli")]
const AUTO: &str =
    "vcm with the numbers of light paths, connections and merges that a pilot finds best; path or bdpt if some are 0";

impl MethodChoice {
    /// The name of the method, or `auto`.
    pub fn name(self) -> &'static str {
        self.0.map_or("auto", Method::name)
    }
}

#[cfg(feature = "cli")]
impl ValueEnum for MethodChoice {
    fn value_variants<'a>() -> &'a [Self] {
        static ALL: LazyLock<Vec<MethodChoice>> = LazyLock::new(|| {
            let methods = Method::value_variants().iter().map(|method| MethodChoice(Some(*method)));
            std::iter::once(MethodChoice(None)).chain(methods).collect()
        });
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        match self.0 {
            Some(method) => method.to_possible_value(),
            None => Some(PossibleValue::new("auto").help(AUTO)),
        }
    }
}

impl Serialize for MethodChoice {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// On or off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "cli", derive(ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum OnOff {
    /// On
    On,
    /// Off
    Off,
}

/// The value of `--initial-bandwidth`, the rule for the largest initial bandwidth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum BandwidthChoice {
    /// The bandwidth is the distance to the k-th nearest photon.
    Knn,
    /// The bandwidth is a multiple of the pixel's footprint.
    Footprint,
    /// The bandwidth is a length in scene units.
    #[serde(untagged)]
    Length(f64),
}

impl FromStr for BandwidthChoice {
    type Err = String;
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match text {
            "knn" => Ok(BandwidthChoice::Knn),
            "footprint" => Ok(BandwidthChoice::Footprint),
            length => match length.parse::<f64>() {
                Ok(r) if (1e-9..=1e9).contains(&r) => Ok(BandwidthChoice::Length(r)),
                Ok(_) => Err("a length must be from 1e-9 to 1e9".into()),
                Err(_) => Err("it is neither 'knn' nor 'footprint' nor a length".into()),
            },
        }
    }
}

/// The value of `--cppm-grid NA,NS`: cells in which the chi-squared test counts photons.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct GridChoice {
    /// Number of annuli into which the kernel's disc is divided.
    pub annuli: usize,
    /// Number of sectors of each annulus.
    pub sectors: usize,
}

impl FromStr for GridChoice {
    type Err = String;
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let parts = text.split_once(',').and_then(|(a, s)| Some((a.parse().ok()?, s.parse().ok()?)));
        let cells =
            |annuli: usize, sectors: usize| annuli.checked_mul(sectors).filter(|cells| (2..=64).contains(cells));
        match parts {
            Some((annuli, sectors)) if cells(annuli, sectors).is_some() => Ok(GridChoice { annuli, sectors }),
            Some(_) => Err("there must be 2 to 64 cells".into()),
            None => Err("it must be NA,NS, such as 2,6".into()),
        }
    }
}
