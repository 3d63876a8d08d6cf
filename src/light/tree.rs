//! Choosing lights by what they may bring to a point: a tree of clusters, each with a bound on where it shines [Conty and Kulla, "Importance
//! Sampling of Many Lights with Adaptive Tree Splitting", 2018].
//!
//! A cluster is a sphere around its lights and a cone around their axes. A choice goes from the root to a leaf, at each step by how much
//! light each half may send to the point: intensity by the least angle to an axis over the distance squared. What is
//! certain to send nothing is never chosen.

use super::emitter::Emitter;
use super::receiver::Receiver;
use crate::math::{Vec3, luminance};
use std::f32::consts::PI;

/// Classes of position along an axis at whose borders clusters are split.
const BUCKETS: usize = 12;
/// From this depth on clusters are halved by number, so that the tree's depth has a bound.
const BALANCED_FROM: u32 = 40;
/// Nearer lights (m2) count as if they were that far, so that sums stay finite.
const LEAST_DISTANCE2: f32 = 1e-12;
/// What light along a surface counts for over light from above, since it may be reflected well; and from behind, where a normal is no longer sure.
const GRAZING: f32 = 0.1;
const BEHIND: f32 = 0.01;
/// What is not in the tree.
const NONE: u32 = u32::MAX;

/// Where lights of a cluster are and shine.
#[derive(Clone, Copy, Debug)]
struct Bounds {
    low: Vec3,
    high: Vec3,
    axis: Vec3,
    /// Greatest angle between the axis and that of a light (rad).
    spread: f32,
    /// Greatest angle between a light's axis and what it sends (rad).
    reach: f32,
    two_sided: bool,
    /// All of them send as much as the cosine says, not the same up to `reach`.
    cosine: bool,
    /// Sum of the lights' greatest radiant intensities (W/sr, luminance).
    intensity: f32,
}

impl Bounds {
    /// Of one light; `None` for those at infinity and those that send nothing.
    fn of(emitter: &Emitter) -> Option<Bounds> {
        let at = |p: Vec3, axis, spread, reach, intensity| Bounds {
            low: p,
            high: p,
            axis,
            spread,
            reach,
            two_sided: false,
            cosine: false,
            intensity,
        };
        let bounds = match emitter {
            Emitter::Triangle { area, two_sided, radiance, plane, corners, .. } => {
                let [a, b, c] = [corners[0], corners[0] + corners[1], corners[0] + corners[2]];
                let intensity = luminance(*radiance) * area;
                let bounds = at(a, plane.truncate(), 0.0, 0.5 * PI, intensity);
                Bounds { low: a.min(b).min(c), high: a.max(b).max(c), two_sided: *two_sided, cosine: true, ..bounds }
            }
            Emitter::Point { p, intensity } => at(*p, Vec3::Z, PI, 0.5 * PI, luminance(*intensity)),
            Emitter::Spot { p, frame, intensity, cos_outer, .. } => {
                at(*p, frame.n, 0.0, cos_outer.clamp(-1.0, 1.0).acos(), luminance(*intensity))
            }
            Emitter::Sun { .. } | Emitter::Environment => return None,
        };
        (bounds.intensity > 0.0 && bounds.intensity.is_finite()).then_some(bounds)
    }

    fn center(&self) -> Vec3 {
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

    /// What it costs to have these lights in one cluster: intensity times the size in space and in directions.
    fn cost(&self) -> f32 {
        let (spread, edge) = (self.spread, (self.spread + self.reach).min(PI));
        let (sin, cos) = spread.sin_cos();
        // The solid angle of the axes, and around it that of the reach, by the cosine.
        let rim = 2.0 * edge * sin - (spread - 2.0 * edge).cos() - 2.0 * spread * sin + cos;
        let directions = 2.0 * PI * (1.0 - cos) + 0.5 * PI * rim;
        self.intensity * directions * self.low.distance_squared(self.high)
    }
}

/// The cone around two cones, each an axis and a half angle.
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

/// What a choice asks of a cluster, in a cache line.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct Node {
    center: Vec3,
    radius2: f32,
    axis: Vec3,
    intensity: f32,
    cos_spread: f32,
    sin_spread: f32,
    cos_reach: f32,
    two_sided: bool,
    cosine: bool,
    /// The emitter of a leaf.
    emitter: u32,
    /// The first of two children side by side; 0 in a leaf.
    children: u32,
    parent: u32,
}

impl Node {
    fn new(bounds: &Bounds, parent: u32) -> Node {
        let (sin_spread, cos_spread) = bounds.spread.sin_cos();
        Node {
            center: bounds.center(),
            radius2: 0.25 * bounds.low.distance_squared(bounds.high),
            axis: bounds.axis,
            intensity: bounds.intensity,
            cos_spread,
            sin_spread: if bounds.spread >= PI { 0.0 } else { sin_spread },
            cos_reach: bounds.reach.cos(),
            two_sided: bounds.two_sided,
            cosine: bounds.cosine,
            emitter: NONE,
            children: 0,
            parent,
        }
    }

    /// Irradiance that the cluster may bring to a receiver (W/m2, luminance), about; 0 only where it is certain to bring none.
    #[inline]
    fn importance(&self, at: &Receiver) -> f32 {
        let to = at.p - self.center;
        let distance2 = to.length_squared();
        let inverse = 1.0 / distance2.max(self.radius2).max(LEAST_DISTANCE2);
        if distance2 <= self.radius2 {
            return self.intensity * inverse;
        }
        let inverse_distance = inverse.sqrt();
        let cos = self.axis.dot(to) * inverse_distance;
        let cos = if self.two_sided { cos.abs() } else { cos };
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        // The angle beyond the cone of the axes, then beyond that of the sphere as well.
        let (cos, sin) = less(cos, sin, self.cos_spread, self.sin_spread);
        let sin2_sphere = self.radius2 * inverse;
        let (cos_sphere, sin_sphere) = ((1.0 - sin2_sphere).max(0.0).sqrt(), sin2_sphere.sqrt());
        let (cos, _) = less(cos, sin, cos_sphere, sin_sphere);
        if cos <= self.cos_reach {
            return 0.0;
        }
        let intensity = self.intensity * inverse * if self.cosine { cos } else { 1.0 };
        if at.n == Vec3::ZERO {
            return intensity;
        }
        let cos = -at.n.dot(to) * inverse_distance;
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let (cos, _) = less(cos, sin, cos_sphere, sin_sphere);
        intensity * if cos > 0.0 { GRAZING + (1.0 - GRAZING) * cos } else { BEHIND }
    }
}

/// Cosine and sine of the difference of two angles in [0, pi], not below zero.
#[inline]
fn less(cos: f32, sin: f32, cos_by: f32, sin_by: f32) -> (f32, f32) {
    if cos >= cos_by { (1.0, 0.0) } else { (cos * cos_by + sin * sin_by, sin * cos_by - cos * sin_by) }
}

/// The tree over all lights that are somewhere.
pub(super) struct LightTree {
    nodes: Vec<Node>,
    /// The leaf of every emitter; [`NONE`] for those without.
    leaves: Vec<u32>,
}

impl LightTree {
    /// `None` where no light is anywhere.
    pub fn new(emitters: &[Emitter]) -> Option<LightTree> {
        let mut lights: Vec<(u32, Bounds)> =
            (0..).zip(emitters).filter_map(|(i, emitter)| Some((i, Bounds::of(emitter)?))).collect();
        let all = union(&lights)?;
        let mut tree = LightTree { nodes: vec![Node::new(&all, NONE)], leaves: vec![NONE; emitters.len()] };
        tree.nodes.reserve(2 * lights.len());
        // Depth first, without recursion: a node and its lights, a range of the list.
        let mut open = vec![(0u32, 0..lights.len(), 0u32)];
        while let Some((node, range, depth)) = open.pop() {
            if range.len() == 1 {
                let emitter = lights[range.start].0;
                tree.nodes[node as usize].emitter = emitter;
                tree.leaves[emitter as usize] = node;
                continue;
            }
            let middle = range.start + split(&mut lights[range.clone()], depth);
            let first = tree.nodes.len() as u32;
            tree.nodes[node as usize].children = first;
            for (child, half) in (first..).zip([range.start..middle, middle..range.end]) {
                let Some(bounds) = union(&lights[half.clone()]) else { continue };
                tree.nodes.push(Node::new(&bounds, node));
                open.push((child, half, depth + 1));
            }
        }
        Some(tree)
    }

    /// Irradiance that all lights may bring to a receiver (W/m2, luminance).
    #[inline]
    pub fn importance(&self, at: &Receiver) -> f32 {
        self.nodes[0].importance(at)
    }

    /// An emitter and its probability; `None` where none shines.
    #[inline]
    pub fn sample(&self, at: &Receiver, mut u: f32) -> Option<(usize, f32)> {
        let (mut node, mut pdf) = (&self.nodes[0], 1.0);
        while node.children != 0 {
            let [a, b] = self.children(node.children);
            let (first, second) = (a.importance(at), b.importance(at));
            let sum = first + second;
            if sum <= 0.0 {
                return None;
            }
            let share = first / sum;
            if u < share {
                u /= share;
                pdf *= share;
                node = a;
            } else {
                u = (u - share) / (1.0 - share);
                pdf *= second / sum;
                node = b;
            }
            u = u.min(1.0f32.next_down());
        }
        (pdf > 0.0).then_some((node.emitter as usize, pdf))
    }

    /// Probability of choosing an emitter.
    #[inline]
    pub fn pdf(&self, at: &Receiver, emitter: usize) -> f32 {
        let mut node = self.leaves[emitter];
        if node == NONE {
            return 0.0;
        }
        let mut pdf = 1.0;
        while node != 0 {
            let parent = self.nodes[node as usize].parent;
            let first = self.nodes[parent as usize].children;
            let importance = self.children(first).map(|child| child.importance(at));
            let own = importance[(node - first) as usize];
            if own <= 0.0 {
                return 0.0;
            }
            pdf *= own / (importance[0] + importance[1]);
            node = parent;
        }
        pdf
    }

    #[inline]
    fn children(&self, first: u32) -> [&Node; 2] {
        let first = first as usize;
        [&self.nodes[first], &self.nodes[first + 1]]
    }
}

fn union(lights: &[(u32, Bounds)]) -> Option<Bounds> {
    lights.iter().map(|light| light.1).reduce(|a, b| a.union(&b))
}

/// Sorts lights into two halves at the least cost; the length of the first.
fn split(lights: &mut [(u32, Bounds)], depth: u32) -> usize {
    let middles = || lights.iter().map(|light| light.1.center());
    let low = middles().fold(Vec3::INFINITY, Vec3::min);
    let extent = middles().fold(Vec3::NEG_INFINITY, Vec3::max) - low;
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
        // Thin boxes cost more: their halves see the lights from all sides.
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
        // Stable, so that the tree does not depend on how a sort breaks ties.
        lights.sort_by_key(|light| bucket(axis, light.1.center()) >= border);
        let middle = lights.partition_point(|light| bucket(axis, light.1.center()) < border);
        if middle > 0 && middle < lights.len() {
            return middle;
        }
    }
    lights.len() / 2
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Rgb, Vec4, warp};
    use crate::random::{Domain, Purpose, Stream};

    /// Triangles, points and spots of all orientations, in a box of 10 m.
    fn lights(n: u64) -> Vec<Emitter> {
        let light = |i: u64| {
            let draws = |k: u64| Stream::new(4, k, Domain::Test, i).vertex(0);
            let vector = |k| {
                let (a, b) = (draws(k).two(Purpose::Pixel), draws(k).one(Purpose::Lobe));
                Vec3::new(a.x, a.y, b)
            };
            let (p, radiance) = (vector(0) * 10.0, Rgb::splat(0.1 + draws(1).one(Purpose::Lobe)));
            let axis = warp::sphere_uniform(draws(2).two(Purpose::Pixel));
            match i % 4 {
                0 => Emitter::Point { p, intensity: radiance },
                1 => Emitter::Spot {
                    p,
                    frame: crate::math::Frame::from_normal(axis),
                    intensity: radiance,
                    cos_inner: 0.9,
                    cos_outer: 0.7 - draws(3).one(Purpose::Lobe),
                },
                _ => {
                    let corners = [p, vector(4) - 0.5, vector(5) - 0.5];
                    let normal = corners[1].cross(corners[2]);
                    let n = normal.normalize();
                    Emitter::Triangle {
                        instance: 0,
                        primitive: i as u32,
                        area: 0.5 * normal.length(),
                        two_sided: i % 8 == 3,
                        radiance,
                        plane: Vec4::new(n.x, n.y, n.z, n.dot(p)),
                        corners,
                        plain: true,
                    }
                }
            }
        };
        (0..n).map(light).collect()
    }

    /// Whether any point of the light shines on `p`.
    fn shines(emitter: &Emitter, p: Vec3) -> bool {
        match emitter {
            Emitter::Triangle { two_sided, plane, .. } => *two_sided || plane.truncate().dot(p) - plane.w > 1e-4,
            Emitter::Spot { p: at, frame, cos_outer, .. } => frame.n.dot((p - at).normalize()) > cos_outer + 1e-4,
            _ => true,
        }
    }

    #[test]
    fn probabilities_are_those_of_sampling_and_sum_to_one() {
        let emitters = lights(61);
        let tree = LightTree::new(&emitters).unwrap();
        for i in 0..50 {
            let draws = Stream::new(5, 0, Domain::Test, i).vertex(0);
            let p = draws.two(Purpose::Pixel).extend(draws.one(Purpose::Lobe)) * 12.0 - 1.0;
            let n = warp::sphere_uniform(draws.two(Purpose::Lens));
            let at = Receiver { n: if i % 3 == 0 { Vec3::ZERO } else { n }, ..Receiver::anywhere(p) };
            let sum: f32 = (0..emitters.len()).map(|k| tree.pdf(&at, k)).sum();
            let n = 4096;
            let (mut count, mut none) = (vec![0u32; emitters.len()], 0);
            for k in 0..n {
                // A cluster may promise light that neither half has.
                let Some((index, pdf)) = tree.sample(&at, (k as f32 + 0.5) / n as f32) else {
                    none += 1;
                    continue;
                };
                assert!((pdf - tree.pdf(&at, index)).abs() <= 1e-4 * pdf, "{pdf} {}", tree.pdf(&at, index));
                count[index] += 1;
            }
            assert!((sum + none as f32 / n as f32 - 1.0).abs() < 2e-3, "{sum} and {none} at {p}");
            for (index, &count) in count.iter().enumerate() {
                // Numbers in equal steps: each interval of choice misses less than one at either end.
                let expected = tree.pdf(&at, index) * n as f32;
                assert!((count as f32 - expected).abs() <= 2.0, "{count} {expected}");
            }
        }
    }

    /// What shines has a chance at every point, and the nearer of two equal lamps the greater one.
    #[test]
    fn no_light_that_shines_is_impossible() {
        let emitters = lights(200);
        let tree = LightTree::new(&emitters).unwrap();
        let (mut shining, mut never) = (0, 0);
        for i in 0..500 {
            let draws = Stream::new(6, 0, Domain::Test, i).vertex(0);
            let p = draws.two(Purpose::Pixel).extend(draws.one(Purpose::Lobe)) * 14.0 - 2.0;
            let at = Receiver::anywhere(p);
            for (index, emitter) in emitters.iter().enumerate() {
                let pdf = tree.pdf(&at, index);
                if shines(emitter, p) {
                    shining += 1;
                    assert!(pdf > 0.0, "{emitter:?} from {p}");
                } else if pdf == 0.0 {
                    never += 1;
                }
            }
        }
        assert!(shining > 30_000 && never > 3_000, "{shining} {never}");
        let lamp = |x: f32| Emitter::Point { p: Vec3::new(x, 0.0, 0.0), intensity: Rgb::ONE };
        let tree = LightTree::new(&[lamp(0.0), lamp(10.0)]).unwrap();
        assert!((tree.pdf(&Receiver::anywhere(Vec3::X), 0) - 81.0 / 82.0).abs() < 1e-5);
    }

    #[test]
    fn lamps_in_one_place_and_none_at_all() {
        let lamp = Emitter::Point { p: Vec3::ONE, intensity: Rgb::ONE };
        let tree = LightTree::new(&vec![lamp; 1000]).unwrap();
        for p in [Vec3::ONE, Vec3::ZERO] {
            assert!((tree.pdf(&Receiver::anywhere(p), 17) - 1e-3).abs() < 1e-6);
        }
        assert!(LightTree::new(&[Emitter::Environment]).is_none());
    }
}
