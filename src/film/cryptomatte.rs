//! Cryptomatte: ids of the objects or materials that cover a pixel, with their coverage.
//!
//! Friedman and Jones, "Fully Automatic ID Mattes with Support for Motion Blur and Transparency", SIGGRAPH posters
//! 2015, and the Cryptomatte specification 1.2.0 (github.com/Psyop/Cryptomatte). An id is the hash of a name, stored as
//! the float of the same bits; two ranks (id, coverage) fit into the four channels of a layer, largest coverage first.

use super::layers::{Layer, LayerSet, Plane, Sample};
use super::naming::{Naming, plain_name};

/// Number of ranks, pairs of an object's id and its coverage, per pixel; each layer stores two.
pub const RANKS: usize = 6;

/// Cryptomatte id of an object or material: the bits of a float that is neither denormal, infinite nor NaN.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Id(pub u32);

impl Id {
    /// The id of a name: MurmurHash3_32 with seed 0 of the UTF-8 name, then the specification's `uint32_to_float32`: it
    /// flips the lowest bit of an exponent of all zeros or all ones, because programs flush denormals and change NaN.
    pub fn of(name: &str) -> Self {
        let bits = murmur(name);
        let exponent = (bits >> 23) & 0xff;
        Id(if exponent == 0 || exponent == 0xff { bits ^ (1 << 23) } else { bits })
    }

    /// The id as the float that files store.
    pub fn to_f32(self) -> f32 {
        f32::from_bits(self.0)
    }
}

fn murmur(name: &str) -> u32 {
    // Reading from a slice cannot fail.
    murmur3::murmur3_32(&mut name.as_bytes(), 0).unwrap_or(0)
}

/// Cryptomatte of objects or of materials: their ids and names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cryptomatte {
    kind: String,
    names: Vec<String>,
    ids: Vec<Id>,
}

impl Cryptomatte {
    /// Computes ids for `names`, in their order; equal names share an id. `kind` is the prefix of the layers:
    /// `CryptoObject` or `CryptoMaterial`.
    pub fn new(kind: impl Into<String>, names: impl IntoIterator<Item = String>) -> Self {
        let names: Vec<String> = names.into_iter().collect();
        let ids = names.iter().map(|name| Id::of(name)).collect();
        Cryptomatte { kind: kind.into(), names, ids }
    }

    /// Ids of the objects or materials, in the order of the names.
    pub fn ids(&self) -> &[Id] {
        &self.ids
    }

    /// String attributes for the EXR header, as (key, value): `name`, `hash`, `conversion` and `manifest`. The specification
    /// builds the keys from the first seven hex digits of the hash of the layers' name in the file.
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

    /// The cryptomatte layers, such as `CryptoObject00` to `02`, from the ranks of every pixel; `samples` is the total
    /// weight of a fully covered pixel.
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

/// The share of each pixel, 0 to 1, that the objects or materials of these names cover, by the cryptomatte layers of a
/// file; `None` without such layers. `kind` is their prefix, as of [`Cryptomatte::new`].
pub fn coverage<'a>(set: &LayerSet, kind: &str, names: impl IntoIterator<Item = &'a str>) -> Option<Vec<f32>> {
    let ids: Vec<u32> = names.into_iter().map(|name| Id::of(name).0).collect();
    let is_rank = |layer: &&Layer| {
        let number = plain_name(&layer.name).strip_prefix(kind).filter(|number| !number.is_empty());
        number.is_some_and(|number| number.bytes().all(|digit| digit.is_ascii_digit()))
    };
    let mut covered: Option<Vec<f32>> = None;
    for layer in set.layers.iter().filter(is_rank) {
        let covered = covered.get_or_insert_with(|| vec![0.0; set.pixels()]);
        for [id, share] in [["r", "g"], ["b", "a"]] {
            let (Some(id), Some(share)) = (layer.plane(id), layer.plane(share)) else { continue };
            for ((covered, id), share) in covered.iter_mut().zip(&id.values).zip(&share.values) {
                *covered += if ids.contains(&id.to_bits()) { *share } else { 0.0 };
            }
        }
    }
    covered
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Rank {
    id: Id,
    weight: f32,
}

/// The ids of the objects, or materials, that cover one pixel, with the weight of each, while samples are added.
///
/// The weights always sum to the total added. They are exact for up to six ids; a seventh replaces the id with the least
/// weight and inherits that weight (Metwally, Agrawal, El Abbadi, "Efficient Computation of Frequent and Top-k Elements
/// in Data Streams", 2005). An id that covers more than a sixth of the pixel is never lost, and no weight is too large by
/// more than the least one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PixelRanks {
    ranks: [Rank; RANKS],
}

impl PixelRanks {
    /// Adds `weight`, above zero, to the coverage of the pixel by `id`.
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

    /// The pixel's ids and weights by descending weight, then by id; empty ranks (weight zero) last.
    fn sorted(&self) -> [Rank; RANKS] {
        let mut ranks = self.ranks;
        ranks.sort_by(|a, b| b.weight.total_cmp(&a.weight).then(a.id.cmp(&b.id)));
        ranks
    }
}

/// The JSON text in ASCII, which EXR headers require: other characters become `\u` escapes (surrogate pairs above
/// U+FFFF).
pub fn ascii_json(json: &str) -> String {
    let mut ascii = String::with_capacity(json.len());
    for c in json.chars() {
        if c.is_ascii() {
            ascii.push(c);
        } else {
            for unit in c.encode_utf16(&mut [0; 2]) {
                ascii.push_str(&format!("\\u{unit:04x}"));
            }
        }
    }
    ascii
}
