//! Light selection by expected irradiance: a tree of clusters with bounds on their positions and directions [Conty and
//! Kulla, "Importance Sampling of Many Lights with Adaptive Tree Splitting", 2018].
//!
//! A cluster has a bounding sphere of its lights and a bounding cone of their axes. Selection descends from the root to
//! a leaf. Of the up to four children of a cluster, which are evaluated at once, the probability of each is
//! proportional to a bound on its irradiance at the receiver: intensity at the smallest possible angle to an axis, over
//! the squared distance. A cluster that cannot light the receiver is never selected. In a small and distant cluster
//! whose lights have similar axes, all lights are seen alike, so selection there is by power.

use super::bounds::{Bounds, split, union};
use super::kind::{Emitter, Light};
use super::receiver::Receiver;
use crate::math::Vec3;
use std::f32::consts::PI;
use std::ops::Range;
use wide::{CmpGe, CmpGt, CmpLe, CmpLt, f32x4};

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
/// Index of a leaf that does not exist.
const NONE: u32 = u32::MAX;
/// Number of children of a cluster.
const WIDTH: usize = 4;

/// Up to four clusters of lights with a common parent, side by side for vector instructions. Absent ones have no
/// intensity.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct Siblings {
    center: [f32x4; 3],
    radius2: f32x4,
    axis: [f32x4; 3],
    intensity: f32x4,
    cos_spread: f32x4,
    sin_spread: f32x4,
    cos_reach: f32x4,
    /// Mask of clusters with two-sided lights.
    two_sided: f32x4,
    /// Mask of clusters whose intensity falls off with the cosine.
    cosine: f32x4,
    /// Index in [`LightTree::order`] of the first light of each cluster; the others follow.
    first: [u32; WIDTH],
    /// Number of lights in each cluster.
    count: [u32; WIDTH],
    /// Index of the siblings that are the children of each cluster; 0 for a leaf.
    children: [u32; WIDTH],
    /// Index of the parent, a cluster.
    parent: u32,
}

/// Importance of four clusters at a receiver.
struct Importance {
    /// Approximate upper bounds on the irradiance (W/m2, luminance).
    values: [f32; WIDTH],
    /// Sums of the values up to each cluster.
    sums: [f64; WIDTH],
    /// For each cluster, a bit that says whether it is compact: whether the receiver sees all its lights at about the
    /// same distance and angle.
    compact: u32,
}

impl Importance {
    /// Sum of all values.
    #[inline]
    fn total(&self) -> f64 {
        self.sums[WIDTH - 1]
    }

    /// Probability of selecting a cluster in proportion to its value.
    #[inline]
    fn probability(&self, lane: usize) -> f32 {
        if self.total() > 0.0 { (f64::from(self.values[lane]) / self.total()) as f32 } else { 0.0 }
    }

    #[inline]
    fn is_compact(&self, lane: usize) -> bool {
        self.compact >> lane & 1 != 0
    }

    /// Selects a cluster in proportion to its value by the uniform number `u`, and returns a new uniform number with
    /// it. The total must be positive.
    #[inline]
    fn select(&self, u: f64) -> (usize, f64) {
        let target = (u * self.total()).min(self.total().next_down());
        // Clusters without importance end where they begin, so none is selected.
        let lane = self.sums[..WIDTH - 1].iter().map(|&sum| usize::from(target >= sum)).sum::<usize>();
        let before = if lane == 0 { 0.0 } else { self.sums[lane - 1] };
        (lane, ((target - before) / (self.sums[lane] - before)).min(1.0f64.next_down()))
    }
}

#[inline]
fn dot(a: &[f32x4; 3], b: &[f32x4; 3]) -> f32x4 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl Siblings {
    /// Siblings from the bounds and ranges of lights of at most four clusters.
    fn new(clusters: &[(Bounds, Range<usize>)], parent: u32) -> Siblings {
        let each = |of: &dyn Fn(&Bounds) -> f32| {
            f32x4::from(std::array::from_fn::<f32, WIDTH, _>(|k| clusters.get(k).map_or(0.0, |(bounds, _)| of(bounds))))
        };
        let mask = |of: &dyn Fn(&Bounds) -> bool| each(&|b| f32::from_bits(if of(b) { u32::MAX } else { 0 }));
        let lights = |of: &dyn Fn(&Range<usize>) -> usize| {
            std::array::from_fn(|k| clusters.get(k).map_or(0, |(_, range)| of(range) as u32))
        };
        Siblings {
            center: std::array::from_fn(|axis| each(&|b| b.center()[axis])),
            radius2: each(&|b| 0.25 * b.low.distance_squared(b.high)),
            axis: std::array::from_fn(|axis| each(&|b| b.axis[axis])),
            intensity: each(&|b| b.intensity),
            cos_spread: each(&|b| b.spread.cos()),
            sin_spread: each(&|b| if b.spread >= PI { 0.0 } else { b.spread.sin() }),
            cos_reach: each(&|b| b.reach.cos()),
            two_sided: mask(&|b| b.two_sided),
            cosine: mask(&|b| b.cosine),
            first: lights(&|range| range.start),
            count: lights(&|range| range.len()),
            children: [0; WIDTH],
            parent,
        }
    }

    /// Importance of the clusters at a receiver (a point that receives light). A value is 0 only if the cluster
    /// certainly does not light the receiver.
    #[inline]
    fn importance(&self, at: &Receiver) -> Importance {
        let (zero, one) = (f32x4::ZERO, f32x4::ONE);
        let to = std::array::from_fn(|axis| f32x4::splat(at.p[axis]) - self.center[axis]);
        let distance2 = dot(&to, &to);
        let inverse = one / distance2.fast_max(self.radius2).fast_max(f32x4::splat(MIN_DISTANCE2));
        let inverse_distance = inverse.sqrt();
        let sine = |cos: f32x4| (one - cos * cos).fast_max(zero).sqrt();
        let cos = dot(&self.axis, &to) * inverse_distance;
        let cos = self.two_sided.blend(cos.abs(), cos);
        // Subtracts the half angle of the axes, then the half angle that the bounding sphere subtends.
        let (cos, sin) = subtract_angle(cos, sine(cos), self.cos_spread, self.sin_spread);
        let sin2_sphere = self.radius2 * inverse;
        let (cos_sphere, sin_sphere) = ((one - sin2_sphere).fast_max(zero).sqrt(), sin2_sphere.sqrt());
        let (cos, _) = subtract_angle(cos, sin, cos_sphere, sin_sphere);
        let near = self.intensity * inverse;
        let mut far = cos.cmp_gt(self.cos_reach) & (near * self.cosine.blend(cos, one));
        if at.n != Vec3::ZERO {
            let cos = dot(&at.n.to_array().map(|n| f32x4::splat(-n)), &to) * inverse_distance;
            let (cos, _) = subtract_angle(cos, sine(cos), cos_sphere, sin_sphere);
            far *= cos.cmp_gt(zero).blend(cos * (1.0 - GRAZING) + GRAZING, f32x4::splat(BEHIND));
        }
        let values = distance2.cmp_le(self.radius2).blend(near, far).to_array();
        let mut sum = 0.0;
        let sums = values.map(|value| {
            sum += f64::from(value);
            sum
        });
        let compact = self.cos_spread.cmp_gt(f32x4::splat(COMPACT_COSINE))
            & self.radius2.cmp_lt(distance2 * f32x4::splat(COMPACT_RADIUS2));
        Importance { values, sums, compact: compact.move_mask() as u32 }
    }
}

/// Cosines and sines of the differences of angles in [0, pi], clamped at zero.
#[inline]
fn subtract_angle(cos: f32x4, sin: f32x4, cos_by: f32x4, sin_by: f32x4) -> (f32x4, f32x4) {
    let smaller = cos.cmp_ge(cos_by);
    (smaller.blend(f32x4::ONE, cos * cos_by + sin * sin_by), smaller.blend(f32x4::ZERO, sin * cos_by - cos * sin_by))
}

/// A tree of clusters over all lights at finite positions. The index of a cluster is four times that of its siblings
/// plus its place among them; cluster 0 has all lights and no siblings.
pub(super) struct LightTree {
    siblings: Vec<Siblings>,
    /// Indices of emitters, in the order of the leaves.
    order: Vec<u32>,
    /// Cumulative intensity of the lights (W/sr): for each index in `order`, the sum over the lights before; the last
    /// entry is the total.
    below: Vec<f64>,
    /// Index of the leaf of each emitter, a cluster; [`NONE`] for emitters outside the tree.
    leaves: Vec<u32>,
}

impl LightTree {
    /// Builds the tree; `None` if no light has a finite position.
    pub fn new(emitters: &[Emitter]) -> Option<LightTree> {
        let mut lights: Vec<(u32, Bounds)> = (0..)
            .zip(emitters)
            .filter_map(|(i, emitter)| Some((i, emitter.bounds().filter(Bounds::shines)?)))
            .collect();
        let all = (union(&lights)?, 0..lights.len());
        let mut siblings = vec![Siblings::new(&[all], NONE)];
        let mut leaves = vec![NONE; emitters.len()];
        // A stack of clusters to split: index, range of `lights`, depth.
        let mut open = vec![(0u32, 0..lights.len(), 0u32)];
        while let Some((cluster, range, depth)) = open.pop() {
            if range.len() == 1 {
                leaves[lights[range.start].0 as usize] = cluster;
                continue;
            }
            let parts = parts(&mut lights, range, depth);
            let index = siblings.len() as u32;
            siblings[cluster as usize / WIDTH].children[cluster as usize % WIDTH] = index;
            let bounds = |(range, _): &(Range<usize>, u32)| Some((union(&lights[range.clone()])?, range.clone()));
            siblings.push(Siblings::new(&parts.iter().filter_map(bounds).collect::<Vec<_>>(), cluster));
            open.extend((index * WIDTH as u32..).zip(parts).map(|(child, (range, depth))| (child, range, depth)));
        }
        let order = lights.iter().map(|light| light.0).collect();
        let intensities = lights.iter().map(|light| f64::from(light.1.intensity));
        let below = std::iter::once(0.0).chain(intensities.scan(0.0, |sum, intensity| {
            *sum += intensity;
            Some(*sum)
        }));
        Some(LightTree { siblings, order, below: below.collect(), leaves })
    }

    #[inline]
    fn place(&self, cluster: u32) -> (&Siblings, usize) {
        (&self.siblings[cluster as usize / WIDTH], cluster as usize % WIDTH)
    }

    /// Intensity of the light at index `k` of `order` over the intensity of the cluster that contains it, 0 to 1.
    #[inline]
    fn intensity_share(&self, k: usize, siblings: &Siblings, lane: usize) -> f32 {
        let sum = |first: usize, count: usize| self.below[first + count] - self.below[first];
        let all = sum(siblings.first[lane] as usize, siblings.count[lane] as usize);
        // The difference may round to zero if far stronger lights precede the cluster.
        if all > 0.0 { (sum(k, 1) / all) as f32 } else { 0.0 }
    }

    /// Selects a light of a cluster in proportion to intensity, by the uniform number `u`. Returns the index of its
    /// emitter and its probability.
    #[inline]
    fn sample_by_intensity(&self, siblings: &Siblings, lane: usize, u: f64) -> (u32, f32) {
        let start = siblings.first[lane] as usize;
        let end = start + siblings.count[lane] as usize;
        let target = self.below[start] + u * (self.below[end] - self.below[start]);
        let k = start + self.below[start + 1..end].partition_point(|&below| below <= target);
        (self.order[k], self.intensity_share(k, siblings, lane))
    }

    /// Approximate upper bound on the irradiance of all lights of the tree at a receiver (W/m2, luminance).
    #[inline]
    pub fn importance(&self, at: &Receiver) -> f32 {
        self.siblings[0].importance(at).values[0]
    }

    /// Divides all lights into at most `most` clusters. Where the intensity times the radius is largest, it divides first.
    pub fn clusters(&self, most: usize) -> Vec<u32> {
        let mut clusters = vec![0];
        let spread = |&cluster: &u32| {
            let (siblings, lane) = self.place(cluster);
            let [intensity, radius2] = [siblings.intensity, siblings.radius2].map(|of| of.to_array()[lane]);
            if siblings.children[lane] == 0 { 0.0 } else { intensity * radius2.sqrt() }
        };
        while let Some(widest) =
            (0..clusters.len()).max_by(|&a, &b| spread(&clusters[a]).total_cmp(&spread(&clusters[b])))
            && spread(&clusters[widest]) > 0.0
        {
            let (siblings, lane) = self.place(clusters[widest]);
            let children = siblings.children[lane];
            let parts = (0..WIDTH).filter(|&part| self.siblings[children as usize].count[part] > 0);
            let parts: Vec<u32> = parts.map(|part| children * WIDTH as u32 + part as u32).collect();
            if clusters.len() + parts.len() > most + 1 {
                break;
            }
            clusters.swap_remove(widest);
            clusters.extend(parts);
        }
        clusters
    }

    /// The indices of the emitters of a cluster.
    pub fn emitters(&self, cluster: u32) -> &[u32] {
        let (siblings, lane) = self.place(cluster);
        let first = siblings.first[lane] as usize;
        &self.order[first..first + siblings.count[lane] as usize]
    }

    /// Selects an emitter for a receiver by the uniform number `u`. Returns its index and its probability; `None` if no
    /// light of the tree can reach the receiver.
    #[inline]
    pub fn sample(&self, at: &Receiver, u: f64) -> Option<(usize, f32)> {
        self.sample_in(0, at, u)
    }

    /// Selects an emitter of a cluster as [`LightTree::sample`] does.
    #[inline]
    pub fn sample_in(&self, cluster: u32, at: &Receiver, mut u: f64) -> Option<(usize, f32)> {
        let ((mut siblings, mut lane), mut pdf) = (self.place(cluster), 1.0);
        let mut compact = siblings.importance(at).is_compact(lane);
        while siblings.children[lane] != 0 && !compact {
            siblings = &self.siblings[siblings.children[lane] as usize];
            let importance = siblings.importance(at);
            if importance.total() <= 0.0 {
                return None;
            }
            (lane, u) = importance.select(u);
            pdf *= importance.probability(lane);
            compact = importance.is_compact(lane);
        }
        let (emitter, share) = if siblings.children[lane] == 0 {
            (self.order[siblings.first[lane] as usize], 1.0)
        } else {
            self.sample_by_intensity(siblings, lane, u)
        };
        pdf *= share;
        (pdf > 0.0).then_some((emitter as usize, pdf))
    }

    /// Probabilities with which [`LightTree::sample_in`] selects the emitter of this index at a receiver, in the cluster
    /// `above` that contains it, and in the whole tree.
    #[inline]
    pub fn pdfs(&self, above: u32, at: &Receiver, emitter: usize) -> [f32; 2] {
        let mut cluster = self.leaves[emitter];
        if cluster == NONE {
            return [0.0; 2];
        }
        let (leaf, lane) = self.place(cluster);
        let own = leaf.first[lane] as usize;
        let (mut within, mut pdf) = (0.0, 1.0);
        loop {
            let (siblings, lane) = self.place(cluster);
            let importance = siblings.importance(at);
            // Below a compact cluster, selection is by intensity.
            if importance.is_compact(lane) && siblings.children[lane] != 0 {
                pdf = self.intensity_share(own, siblings, lane);
            }
            if cluster == above {
                within = pdf;
            }
            if cluster == 0 {
                return [within, pdf];
            }
            pdf *= importance.probability(lane);
            cluster = siblings.parent;
        }
    }
}

/// Splits a range of at least two `lights` into at most four parts of small cost, and returns them with their depth in
/// the tree of splits. `depth` is that of the range.
fn parts(lights: &mut [(u32, Bounds)], range: Range<usize>, depth: u32) -> Vec<(Range<usize>, u32)> {
    let mut parts = vec![(range, depth)];
    while parts.len() < WIDTH {
        let largest = (0..parts.len()).max_by_key(|&k| parts[k].0.len()).unwrap_or(0);
        let (range, depth) = parts[largest].clone();
        if range.len() < 2 {
            break;
        }
        let middle = range.start + split(&mut lights[range.clone()], depth);
        parts[largest] = (range.start..middle, depth + 1);
        parts.push((middle..range.end, depth + 1));
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::SpotEdge;
    use crate::light::{EnvironmentLight, PointLight, SpotLight, Spread, TriangleLight};
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
                0 => PointLight { p, intensity: radiance }.into(),
                1 => SpotLight {
                    p,
                    frame: crate::math::Frame::from_normal(axis),
                    intensity: radiance,
                    inner: 0.1,
                    outer: 0.3 + draws(3).one(Purpose::Lobe),
                    radius: if i % 8 == 1 { 0.3 } else { 0.0 },
                    edge: SpotEdge::Smooth,
                    bulb: None,
                }
                .into(),
                _ => {
                    let corners = [p, vector(4) - 0.5, vector(5) - 0.5];
                    let normal = corners[1].cross(corners[2]);
                    let n = normal.normalize();
                    TriangleLight {
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
                    }
                    .into()
                }
            }
        };
        (0..n).map(light).collect()
    }

    fn pdf(tree: &LightTree, at: &Receiver, emitter: usize) -> f32 {
        let [_, pdf] = tree.pdfs(0, at, emitter);
        pdf
    }

    /// Whether some point of the light shines on `p`.
    fn shines(emitter: &Emitter, p: Vec3) -> bool {
        match emitter {
            Emitter::Triangle(TriangleLight { two_sided, plane, .. }) => {
                *two_sided || plane.truncate().dot(p) - plane.w > 1e-4
            }
            Emitter::Spot(spot) => (0..16).any(|k| {
                let (at, _) = spot.point(Vec2::new((0.5 + k as f32) / 16.0, 0.99)).unwrap();
                spot.frame.n.dot((p - at).normalize()) > 1.0 - spot.outer + 1e-4
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
            let sum: f32 = (0..emitters.len()).map(|k| pdf(&tree, &at, k)).sum();
            let n = 4096;
            let (mut count, mut none) = (vec![0u32; emitters.len()], 0);
            for k in 0..n {
                // The bound of a cluster may be positive although those of both children are zero.
                let Some((index, own)) = tree.sample(&at, (f64::from(k) + 0.5) / f64::from(n)) else {
                    none += 1;
                    continue;
                };
                assert!((own - pdf(&tree, &at, index)).abs() <= 1e-4 * own, "{own} {}", pdf(&tree, &at, index));
                count[index] += 1;
            }
            assert!((sum + none as f32 / n as f32 - 1.0).abs() < 2e-3, "{sum} and {none} at {p}");
            for (index, &count) in count.iter().enumerate() {
                // `u` is in equal steps, so each interval of selection gains or loses less than one at either end.
                let expected = pdf(&tree, &at, index) * n as f32;
                assert!((count as f32 - expected).abs() <= 2.0, "{count} {expected}");
            }
        }
    }

    /// Clusters divide the lights, and selecting within one has the stated probability.
    #[test]
    fn clusters_divide_the_lights() {
        let emitters = lights(61);
        let tree = LightTree::new(&emitters).unwrap();
        let clusters = tree.clusters(20);
        let mut all: Vec<u32> = clusters.iter().flat_map(|&cluster| tree.emitters(cluster)).copied().collect();
        all.sort_unstable();
        assert!(all == Vec::from_iter(0..61) && (15..=20).contains(&clusters.len()), "{clusters:?} {all:?}");
        for i in 0..20 {
            let draws = Stream::new(8, 0, Domain::Test, i).vertex(0);
            let at = Receiver::anywhere(draws.two(Purpose::Pixel).extend(draws.one(Purpose::Lobe)) * 12.0 - 1.0);
            for &cluster in &clusters {
                let n = 64;
                for k in 0..n {
                    let Some((index, own)) = tree.sample_in(cluster, &at, (f64::from(k) + 0.5) / f64::from(n)) else {
                        continue;
                    };
                    let [within, whole] = tree.pdfs(cluster, &at, index);
                    assert!(tree.emitters(cluster).contains(&(index as u32)) && (within / own - 1.0).abs() < 1e-4);
                    assert!(whole <= within * 1.0001, "{whole} {within}");
                }
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
                let pdf = pdf(&tree, &at, index);
                if shines(emitter, p) {
                    shining += 1;
                    assert!(pdf > 0.0, "{emitter:?} from {p}");
                } else if pdf == 0.0 {
                    never += 1;
                }
            }
        }
        assert!(shining > 30_000 && never > 3_000, "{shining} {never}");
        let point = |x: f32| Emitter::from(PointLight { p: Vec3::new(x, 0.0, 0.0), intensity: Rgb::ONE });
        let tree = LightTree::new(&[point(0.0), point(10.0)]).unwrap();
        assert!((pdf(&tree, &Receiver::anywhere(Vec3::X), 0) - 81.0 / 82.0).abs() < 1e-5);
    }

    #[test]
    fn coincident_lights_are_equally_probable_and_a_tree_needs_a_light() {
        let light = Emitter::from(PointLight { p: Vec3::ONE, intensity: Rgb::ONE });
        let tree = LightTree::new(&vec![light; 1000]).unwrap();
        for p in [Vec3::ONE, Vec3::ZERO] {
            assert!((pdf(&tree, &Receiver::anywhere(p), 17) - 1e-3).abs() < 1e-6);
        }
        assert!(LightTree::new(&[EnvironmentLight.into()]).is_none());
    }
}
