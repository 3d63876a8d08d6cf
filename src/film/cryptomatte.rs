//! Cryptomatte: who covers a pixel, and how much of it.
//!
//! Friedman and Jones, "Fully Automatic ID Mattes with Support for Motion Blur and Transparency", SIGGRAPH posters
//! 2015, and the Cryptomatte specification 1.2.0 (github.com/Psyop/Cryptomatte). An id is the hash of a name, stored as
//! the float of the same bits; two ranks (id, coverage) fit into the four channels of a layer, largest coverage first.

use super::ascii::ascii_json;
use super::layers::{Layer, Plane, Sample};
use super::naming::Naming;

/// Ranks kept per pixel; two a layer.
pub const RANKS: usize = 6;

/// An id as it is stored: the bits of a float that is neither denormal, infinite nor NaN.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Id(pub u32);

impl Id {
    /// MurmurHash3_32 with seed 0 of the name's UTF-8, then the specification's `uint32_to_float32`: where the exponent
    /// would be all zeros or all ones its lowest bit is flipped, since programs flush denormals and mangle NaN.
    pub fn of(name: &str) -> Self {
        let bits = murmur(name);
        let exponent = (bits >> 23) & 0xff;
        Id(if exponent == 0 || exponent == 0xff { bits ^ (1 << 23) } else { bits })
    }

    /// The value in a file.
    pub fn to_f32(self) -> f32 {
        f32::from_bits(self.0)
    }
}

fn murmur(name: &str) -> u32 {
    // A slice in memory cannot fail to be read.
    murmur3::murmur3_32(&mut name.as_bytes(), 0).unwrap_or(0)
}

/// The ids of one kind of thing, objects or materials.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cryptomatte {
    kind: String,
    names: Vec<String>,
    ids: Vec<Id>,
}

impl Cryptomatte {
    /// Ids for `names`, in their order; things of the same name share an id. `kind` names the layers: `CryptoObject`,
    /// `CryptoMaterial`.
    pub fn new(kind: impl Into<String>, names: impl IntoIterator<Item = String>) -> Self {
        let names: Vec<String> = names.into_iter().collect();
        let ids = names.iter().map(|name| Id::of(name)).collect();
        Cryptomatte { kind: kind.into(), names, ids }
    }

    /// Ids in the order of the names.
    pub fn ids(&self) -> &[Id] {
        &self.ids
    }

    /// The header's string attributes, by name: `name`, `hash`, `conversion` and `manifest` under the key that is the
    /// first seven hex digits of the hash of the layers' name in the file.
    pub fn attributes(&self, naming: Naming) -> [(String, String); 4] {
        let name = naming.layer(&self.kind);
        let hash = format!("{:08x}", murmur(&name));
        let key = |field: &str| format!("cryptomatte/{}/{field}", &hash[..7]);
        let entries: serde_json::Map<String, serde_json::Value> =
            self.names.iter().zip(&self.ids).map(|(name, id)| (name.clone(), format!("{:08x}", id.0).into())).collect();
        let manifest = ascii_json(&serde_json::Value::Object(entries).to_string());
        [
            (key("name"), name),
            (key("hash"), "MurmurHash3_32".into()),
            (key("conversion"), "uint32_to_float32".into()),
            (key("manifest"), manifest),
        ]
    }

    /// The layers `CryptoObject00` to `02` from the ranks of every pixel; `samples` is the weight that a pixel covered
    /// entirely has gathered.
    pub fn layers(&self, pixels: &[PixelRanks], samples: f32) -> Vec<Layer> {
        let sorted: Vec<[Rank; RANKS]> = pixels.iter().map(PixelRanks::sorted).collect();
        let layer = |index: usize| {
            let plane = |(position, component): (usize, char)| {
                let rank = |ranks: &[Rank; RANKS]| ranks[2 * index + position / 2];
                let value = |rank: Rank| if position % 2 == 0 { rank.id.to_f32() } else { rank.weight / samples };
                let values = sorted.iter().map(|ranks| value(rank(ranks))).collect();
                Plane { component: component.into(), sample: Sample::Float, values }
            };
            let planes = "rgba".chars().enumerate().map(plane).collect();
            Layer { name: format!("{}{index:02}", self.kind), planes }
        };
        (0..RANKS / 2).map(layer).collect()
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Rank {
    id: Id,
    weight: f32,
}

/// What covers one pixel so far.
///
/// The weights always sum to all that was added. While at most six ids were seen they are exact; a seventh takes the
/// place of the least and inherits its weight (Metwally, Agrawal, El Abbadi, "Efficient Computation of Frequent and
/// Top-k Elements in Data Streams", 2005: whatever covers more than a sixth of the pixel is surely kept, and no weight
/// is too large by more than the least one).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PixelRanks {
    ranks: [Rank; RANKS],
}

impl PixelRanks {
    /// Adds a weight that is above zero.
    pub fn add(&mut self, id: Id, weight: f32) {
        let mut least = 0;
        for i in 0..RANKS {
            let rank = &mut self.ranks[i];
            if rank.weight == 0.0 || rank.id == id {
                rank.id = id;
                rank.weight += weight;
                return;
            }
            if rank.weight < self.ranks[least].weight {
                least = i;
            }
        }
        let rank = &mut self.ranks[least];
        rank.id = id;
        rank.weight += weight;
    }

    /// Largest weight first, ids in order among equals; absent ranks (zero) last.
    fn sorted(&self) -> [Rank; RANKS] {
        let mut ranks = self.ranks;
        ranks.sort_by(|a, b| b.weight.total_cmp(&a.weight).then(a.id.cmp(&b.id)));
        ranks
    }
}
