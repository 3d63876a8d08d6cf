//! Light selection by expected irradiance: a tree of clusters with bounds on their positions and directions [Conty and
//! Kulla, "Importance Sampling of Many Lights with Adaptive Tree Splitting", 2018].
//!
//! A cluster has a bounding sphere of its lights and a bounding cone of their axes. Selection descends from the root to
//! a leaf. At each node, the probability of a child is proportional to a bound on its irradiance at the receiver:
//! intensity at the smallest possible angle to an axis, over the squared distance. A cluster that cannot light the
//! receiver is never selected. In a small and distant cluster whose lights have similar axes, all lights are seen
//! alike, so selection there is by power.

mod bounds;

use super::emitter::Emitter;
use super::receiver::Receiver;
use crate::math::Vec3;
use bounds::{Bounds, split, union};
use std::f32::consts::PI;
use std::ops::Range;

/// Minimum squared distance (m2) in the estimated irradiance, which keeps sums finite.
const MIN_DISTANCE2: f32 = 1e-12;
/// Weight of light that arrives at grazing incidence, relative to normal incidence, in the estimated irradiance: glossy
/// surfaces reflect it.
const GRAZING: f32 = 0.1;
/// Weight of light from behind the surface, in the estimated irradiance; shading normals may still receive it.
const BEHIND: f32 = 0.01;
/// Threshold of a compact cluster of lights: its squared radius is below this share of its squared distance to the
/// receiver, and its axes are within `COMPACT_COSINE`.
const COMPACT_RADIUS2: f32 = 1.0 / 64.0;
/// Cosine of the largest half angle of the cone around the lights' axes in a compact cluster.
const COMPACT_COSINE: f32 = 0.7;
/// Index of a parent or a leaf that does not exist.
const NONE: u32 = u32::MAX;

/// A cluster of lights in the tree, with the data that selection needs, in one cache line.
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
    /// Index in [`LightTree::order`] of the first light of the cluster; the others follow.
    first: u32,
    /// Number of lights in the cluster.
    count: u32,
    /// Index of the node of the first child; the second child follows it. 0 for a leaf.
    children: u32,
    parent: u32,
}

impl Node {
    fn new(bounds: &Bounds, lights: &Range<usize>, parent: u32) -> Node {
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
            first: lights.start as u32,
            count: lights.len() as u32,
            children: 0,
            parent,
        }
    }

    /// Whether a receiver (a point that receives light) sees all lights of the cluster at about the same distance and
    /// angle.
    #[inline]
    fn is_compact(&self, at: &Receiver) -> bool {
        self.cos_spread > COMPACT_COSINE && self.radius2 < COMPACT_RADIUS2 * at.p.distance_squared(self.center)
    }

    /// Approximate upper bound on the irradiance of the cluster at a receiver (W/m2, luminance); 0 only if the cluster
    /// certainly does not light the receiver.
    #[inline]
    fn importance(&self, at: &Receiver) -> f32 {
        let to = at.p - self.center;
        let distance2 = to.length_squared();
        let inverse = 1.0 / distance2.max(self.radius2).max(MIN_DISTANCE2);
        if distance2 <= self.radius2 {
            return self.intensity * inverse;
        }
        let inverse_distance = inverse.sqrt();
        let cos = self.axis.dot(to) * inverse_distance;
        let cos = if self.two_sided { cos.abs() } else { cos };
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        // Subtracts the half angle of the axes, then the half angle that the bounding sphere subtends.
        let (cos, sin) = subtract_angle(cos, sin, self.cos_spread, self.sin_spread);
        let sin2_sphere = self.radius2 * inverse;
        let (cos_sphere, sin_sphere) = ((1.0 - sin2_sphere).max(0.0).sqrt(), sin2_sphere.sqrt());
        let (cos, _) = subtract_angle(cos, sin, cos_sphere, sin_sphere);
        if cos <= self.cos_reach {
            return 0.0;
        }
        let intensity = self.intensity * inverse * if self.cosine { cos } else { 1.0 };
        if at.n == Vec3::ZERO {
            return intensity;
        }
        let cos = -at.n.dot(to) * inverse_distance;
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let (cos, _) = subtract_angle(cos, sin, cos_sphere, sin_sphere);
        intensity * if cos > 0.0 { GRAZING + (1.0 - GRAZING) * cos } else { BEHIND }
    }
}

/// Cosine and sine of the difference of two angles in [0, pi], clamped at zero.
#[inline]
fn subtract_angle(cos: f32, sin: f32, cos_by: f32, sin_by: f32) -> (f32, f32) {
    if cos >= cos_by { (1.0, 0.0) } else { (cos * cos_by + sin * sin_by, sin * cos_by - cos * sin_by) }
}

/// A tree of clusters over all lights at finite positions.
pub(super) struct LightTree {
    nodes: Vec<Node>,
    /// Indices of emitters, in the order of the leaves.
    order: Vec<u32>,
    /// Cumulative intensity of the lights (W/sr): for each index in `order`, the sum over the lights before; the last
    /// entry is the total.
    below: Vec<f64>,
    /// Index of the leaf of each emitter; [`NONE`] for emitters outside the tree.
    leaves: Vec<u32>,
}

impl LightTree {
    /// Builds the tree; `None` if no light has a finite position.
    pub fn new(emitters: &[Emitter]) -> Option<LightTree> {
        let mut lights: Vec<(u32, Bounds)> =
            (0..).zip(emitters).filter_map(|(i, emitter)| Some((i, Bounds::of(emitter)?))).collect();
        let all = union(&lights)?;
        let root = Node::new(&all, &(0..lights.len()), NONE);
        let (leaves, order, below) = (vec![NONE; emitters.len()], Vec::new(), Vec::new());
        let mut tree = LightTree { nodes: vec![root], order, below, leaves };
        tree.nodes.reserve(2 * lights.len());
        // A stack of nodes to split: index, range of `lights`, depth.
        let mut open = vec![(0u32, 0..lights.len(), 0u32)];
        while let Some((node, range, depth)) = open.pop() {
            if range.len() == 1 {
                tree.leaves[lights[range.start].0 as usize] = node;
                continue;
            }
            let middle = range.start + split(&mut lights[range.clone()], depth);
            let first = tree.nodes.len() as u32;
            tree.nodes[node as usize].children = first;
            for (child, half) in (first..).zip([range.start..middle, middle..range.end]) {
                let Some(bounds) = union(&lights[half.clone()]) else { continue };
                tree.nodes.push(Node::new(&bounds, &half, node));
                open.push((child, half, depth + 1));
            }
        }
        tree.order = lights.iter().map(|light| light.0).collect();
        let mut sum = 0.0f64;
        tree.below.push(0.0);
        tree.below.extend(lights.iter().map(|light| {
            sum += f64::from(light.1.intensity);
            sum
        }));
        Some(tree)
    }

    /// Intensity of the light at index `k` of `order` over the intensity of the cluster that contains it, 0 to 1.
    #[inline]
    fn intensity_share(&self, k: usize, node: &Node) -> f32 {
        let sum = |first: usize, count: usize| self.below[first + count] - self.below[first];
        let all = sum(node.first as usize, node.count as usize);
        // The difference may round to zero if far stronger lights precede the node.
        if all > 0.0 { (sum(k, 1) / all) as f32 } else { 0.0 }
    }

    /// Selects a light of a cluster in proportion to intensity, by the uniform number `u`. Returns the index of its
    /// emitter and its probability.
    #[inline]
    fn sample_by_intensity(&self, node: &Node, u: f64) -> (u32, f32) {
        let (start, end) = (node.first as usize, (node.first + node.count) as usize);
        let target = self.below[start] + u * (self.below[end] - self.below[start]);
        let k = start + self.below[start + 1..end].partition_point(|&below| below <= target);
        (self.order[k], self.intensity_share(k, node))
    }

    /// Approximate upper bound on the irradiance of all lights of the tree at a receiver (W/m2, luminance).
    #[inline]
    pub fn importance(&self, at: &Receiver) -> f32 {
        self.nodes[0].importance(at)
    }

    /// Selects an emitter for a receiver by the uniform number `u`. Returns its index and its probability; `None` if no
    /// light of the tree can reach the receiver.
    #[inline]
    pub fn sample(&self, at: &Receiver, mut u: f64) -> Option<(usize, f32)> {
        let (mut node, mut pdf) = (&self.nodes[0], 1.0);
        while node.children != 0 && !node.is_compact(at) {
            let [a, b] = self.children(node.children);
            let (first, second) = (a.importance(at), b.importance(at));
            let sum = first + second;
            if sum <= 0.0 {
                return None;
            }
            let share = first / sum;
            let split = f64::from(share);
            if u < split {
                u /= split;
                pdf *= share;
                node = a;
            } else {
                u = (u - split) / (1.0 - split);
                pdf *= second / sum;
                node = b;
            }
            u = u.min(1.0f64.next_down());
        }
        let (emitter, share) =
            if node.children == 0 { (self.order[node.first as usize], 1.0) } else { self.sample_by_intensity(node, u) };
        pdf *= share;
        (pdf > 0.0).then_some((emitter as usize, pdf))
    }

    /// Probability with which [`LightTree::sample`] selects the emitter of this index at a receiver.
    #[inline]
    pub fn pdf(&self, at: &Receiver, emitter: usize) -> f32 {
        let mut node = self.leaves[emitter];
        if node == NONE {
            return 0.0;
        }
        let own = self.nodes[node as usize].first as usize;
        let mut pdf = 1.0;
        while node != 0 {
            let parent = self.nodes[node as usize].parent;
            let first = self.nodes[parent as usize].children;
            let importance = self.children(first).map(|child| child.importance(at));
            let sum = importance[0] + importance[1];
            pdf *= if sum > 0.0 { importance[(node - first) as usize] / sum } else { 0.0 };
            node = parent;
            // Below a compact cluster, selection is by intensity.
            let cluster = &self.nodes[node as usize];
            if cluster.is_compact(at) {
                pdf = self.intensity_share(own, cluster);
            }
        }
        pdf
    }

    #[inline]
    fn children(&self, first: u32) -> [&Node; 2] {
        let first = first as usize;
        [&self.nodes[first], &self.nodes[first + 1]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::emitter::{SpotEdge, spot_point};
    use crate::light::{Spread, TriangleLight};
    use crate::math::{Rgb, Vec2, Vec4, warp};
    use crate::random::{Domain, Purpose, Stream};

    /// Test lights: triangles, points and spots of random orientation, in a box of 10 m.
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
                    inner: 0.1,
                    outer: 0.3 + draws(3).one(Purpose::Lobe),
                    radius: if i % 8 == 1 { 0.3 } else { 0.0 },
                    edge: SpotEdge::Smooth,
                },
                _ => {
                    let corners = [p, vector(4) - 0.5, vector(5) - 0.5];
                    let normal = corners[1].cross(corners[2]);
                    let n = normal.normalize();
                    Emitter::Triangle(TriangleLight {
                        instance: 0,
                        primitive: i as u32,
                        area: 0.5 * normal.length(),
                        two_sided: i % 8 == 3,
                        radiance,
                        spread: Spread::LAMBERTIAN,
                        plane: Vec4::new(n.x, n.y, n.z, n.dot(p)),
                        corners,
                        error: 0.0,
                        uniform: true,
                    })
                }
            }
        };
        (0..n).map(light).collect()
    }

    /// Whether some point of the light shines on `p`.
    fn shines(emitter: &Emitter, p: Vec3) -> bool {
        match emitter {
            Emitter::Triangle(TriangleLight { two_sided, plane, .. }) => {
                *two_sided || plane.truncate().dot(p) - plane.w > 1e-4
            }
            Emitter::Spot { p: at, radius, frame, outer, .. } => (0..16).any(|k| {
                let u = Vec2::new((0.5 + k as f32) / 16.0, 0.99);
                let at = spot_point(*at, *radius, frame, u);
                frame.n.dot((p - at).normalize()) > 1.0 - outer + 1e-4
            }),
            _ => true,
        }
    }

    #[test]
    fn probabilities_match_sampling_and_sum_to_one() {
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
                // The bound of a cluster may be positive although those of both children are zero.
                let Some((index, pdf)) = tree.sample(&at, (f64::from(k) + 0.5) / f64::from(n)) else {
                    none += 1;
                    continue;
                };
                assert!((pdf - tree.pdf(&at, index)).abs() <= 1e-4 * pdf, "{pdf} {}", tree.pdf(&at, index));
                count[index] += 1;
            }
            assert!((sum + none as f32 / n as f32 - 1.0).abs() < 2e-3, "{sum} and {none} at {p}");
            for (index, &count) in count.iter().enumerate() {
                // `u` is in equal steps, so each interval of selection gains or loses less than one at either end.
                let expected = tree.pdf(&at, index) * n as f32;
                assert!((count as f32 - expected).abs() <= 2.0, "{count} {expected}");
            }
        }
    }

    /// Every light that shines on a point has a positive probability there, and the nearer of two equal lights has the
    /// higher one.
    #[test]
    fn every_light_that_shines_on_a_point_can_be_selected() {
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
        let point = |x: f32| Emitter::Point { p: Vec3::new(x, 0.0, 0.0), intensity: Rgb::ONE };
        let tree = LightTree::new(&[point(0.0), point(10.0)]).unwrap();
        assert!((tree.pdf(&Receiver::anywhere(Vec3::X), 0) - 81.0 / 82.0).abs() < 1e-5);
    }

    #[test]
    fn coincident_lights_are_equally_probable_and_a_tree_needs_a_light() {
        let light = Emitter::Point { p: Vec3::ONE, intensity: Rgb::ONE };
        let tree = LightTree::new(&vec![light; 1000]).unwrap();
        for p in [Vec3::ONE, Vec3::ZERO] {
            assert!((tree.pdf(&Receiver::anywhere(p), 17) - 1e-3).abs() < 1e-6);
        }
        assert!(LightTree::new(&[Emitter::Environment]).is_none());
    }
}
