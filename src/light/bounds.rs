//! Bounds on the positions and directions of lights, and the best split of a cluster into halves.

use crate::math::Vec3;
use std::f32::consts::PI;

/// Number of buckets along an axis of a cluster of lights; the borders between them are tried as splits.
const BUCKETS: usize = 12;
/// Depth in the light tree from which on clusters are split into halves of equal size, which limits the depth of the
/// tree.
const BALANCED_FROM: u32 = 40;

/// Bounds on the positions and directions of the lights of a cluster.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    pub low: Vec3,
    pub high: Vec3,
    pub axis: Vec3,
    /// Maximum angle between `axis`, the axis of the cluster, and the axis of any of its lights (rad).
    pub spread: f32,
    /// Maximum angle between the axis of a light and the directions in which it emits (rad).
    pub reach: f32,
    pub two_sided: bool,
    /// Whether the intensity of all lights falls off with the cosine, instead of being constant up to `reach`.
    pub cosine: bool,
    /// Sum of the maximum radiant intensities of the cluster's lights (W/sr, luminance).
    pub intensity: f32,
}

impl Bounds {
    /// Bounds of a point that emits around `axis` as far as the angle `reach` (rad), with the luminance `intensity` of its
    /// maximum radiant intensity (W/sr). `spread` is the maximum angle between `axis` and the light's own axis (rad).
    pub fn of_point(p: Vec3, axis: Vec3, spread: f32, reach: f32, intensity: f32) -> Bounds {
        Bounds { low: p, high: p, axis, spread, reach, two_sided: false, cosine: false, intensity }
    }

    /// These bounds, extended to the box from `low` to `high`.
    #[must_use]
    pub fn with_box(self, [low, high]: [Vec3; 2]) -> Bounds {
        Bounds { low, high, ..self }
    }

    /// Whether the tree can hold a light with these bounds.
    pub fn shines(&self) -> bool {
        self.intensity > 0.0 && self.intensity.is_finite()
    }

    pub fn center(&self) -> Vec3 {
        (self.low + self.high) * 0.5
    }

    fn union(&self, other: &Bounds) -> Bounds {
        let (axis, spread) = joint_cone((self.axis, self.spread), (other.axis, other.spread));
        Bounds {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
            axis,
            spread,
            reach: self.reach.max(other.reach),
            two_sided: self.two_sided || other.two_sided,
            cosine: self.cosine && other.cosine,
            intensity: self.intensity + other.intensity,
        }
    }

    /// Cost of a cluster with these bounds, which the best split minimises: intensity times the extent in space and in
    /// directions.
    pub fn cost(&self) -> f32 {
        let (spread, edge) = (self.spread, (self.spread + self.reach).min(PI));
        let (sin, cos) = spread.sin_cos();
        // The solid angle of the axes, plus the cosine-weighted solid angle of the reach around it.
        let rim = 2.0 * edge * sin - (spread - 2.0 * edge).cos() - 2.0 * spread * sin + cos;
        let directions = 2.0 * PI * (1.0 - cos) + 0.5 * PI * rim;
        self.intensity * directions * self.low.distance_squared(self.high)
    }
}

/// The smallest cone around two cones of directions, each given by an axis and a half angle (rad).
fn joint_cone(a: (Vec3, f32), b: (Vec3, f32)) -> (Vec3, f32) {
    let (wide, narrow) = if a.1 >= b.1 { (a, b) } else { (b, a) };
    let apart = wide.0.dot(narrow.0).clamp(-1.0, 1.0).acos();
    if (apart + narrow.1).min(PI) <= wide.1 {
        return wide;
    }
    let spread = 0.5 * (wide.1 + apart + narrow.1);
    let across = narrow.0 - wide.0 * wide.0.dot(narrow.0);
    match across.try_normalize() {
        Some(across) if spread < PI => {
            let (sin, cos) = (spread - wide.1).sin_cos();
            (wide.0 * cos + across * sin, spread)
        }
        _ => (wide.0, PI),
    }
}

/// Bounds of a cluster of lights, given as emitter index and bounds; `None` if there are none.
pub fn union(lights: &[(u32, Bounds)]) -> Option<Bounds> {
    lights.iter().map(|light| light.1).reduce(|a, b| a.union(&b))
}

/// Reorders the lights of a cluster into two parts with the least total cost, and returns the number of lights in the
/// first part. `depth` is the depth of the cluster in the tree.
pub fn split(lights: &mut [(u32, Bounds)], depth: u32) -> usize {
    let centers = || lights.iter().map(|light| light.1.center());
    let low = centers().fold(Vec3::INFINITY, Vec3::min);
    let extent = centers().fold(Vec3::NEG_INFINITY, Vec3::max) - low;
    let bucket =
        |axis: usize, p: Vec3| (((p[axis] - low[axis]) / extent[axis] * BUCKETS as f32) as usize).min(BUCKETS - 1);
    let mut best: Option<(f32, usize, usize)> = None;
    for axis in (0..3).filter(|&axis| extent[axis] > 0.0 && depth < BALANCED_FROM) {
        let mut buckets = [None::<Bounds>; BUCKETS];
        for (_, bounds) in lights.iter() {
            let into = &mut buckets[bucket(axis, bounds.center())];
            *into = Some(into.map_or(*bounds, |sum| sum.union(bounds)));
        }
        let join = |a: Option<Bounds>, b: &Option<Bounds>| match (a, b) {
            (Some(a), Some(b)) => Some(a.union(b)),
            (a, b) => a.or(*b),
        };
        // Splits along a short axis cost more: their halves are long and thin, so the bounds are loose.
        let thin = extent.max_element() / extent[axis];
        for border in 1..BUCKETS {
            let below = buckets[..border].iter().fold(None, join);
            let above = buckets[border..].iter().fold(None, join);
            let (Some(below), Some(above)) = (below, above) else { continue };
            let cost = thin * (below.cost() + above.cost());
            if best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, axis, border));
            }
        }
    }
    if let Some((_, axis, border)) = best {
        // A stable sort, so that the tree does not depend on how a sort breaks ties.
        lights.sort_by_key(|light| bucket(axis, light.1.center()) >= border);
        let middle = lights.partition_point(|light| bucket(axis, light.1.center()) < border);
        if middle > 0 && middle < lights.len() {
            return middle;
        }
    }
    lights.len() / 2
}
