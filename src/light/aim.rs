//! Aiming light from infinity: half of its paths start over the objects that can make caustics.
//!
//! Light from infinity enters through a disc as large as the scene, and of a small glass on a wide floor it would
//! hardly hit anything. Paths are drawn from a mixture of the whole disc and of the discs of the targets' bounding
//! spheres; each carries the flux that its density in the mixture asks for, so the estimate is the same and no path is
//! lost.

use super::{Cdf, EmissionSample, EntryDisc, Region, Sky};
use crate::geometry::Shapes;
use crate::material::Materials;
use crate::math::{Frame, Vec2, Vec3, warp};
use std::f32::consts::PI;

/// Share of the paths that are aimed.
const AIMED: f32 = 0.5;
/// More targets than this are joined, those first whose joint sphere is smallest.
const MAX_TARGETS: usize = 32;
/// More objects than this are joined by where they are, before that is looked at.
const MAX_SPHERES: usize = 512;

/// Shares of the paths that go through a region of interest and its initial_media, without targets and with them.
const LIT: (f32, f32) = (0.5, 1.0 / 3.0);
/// Squared distance of a line from a point.
#[inline]
fn from_line(center: Vec3, p: Vec3, d: Vec3) -> f32 {
    let v = p - center;
    (v - d * v.dot(d)).length_squared()
}

/// Bounding spheres of what can make caustics.
pub struct CausticTargets {
    spheres: Vec<(Vec3, f32)>,
    /// Choice in proportion to the discs' areas.
    choice: Option<Cdf>,
    /// Sum of the areas.
    area: f32,
}

/// Bounding sphere of points: the centre of their box, the farthest of them.
fn bounding_sphere(points: impl Iterator<Item = Vec3> + Clone) -> Option<(Vec3, f32)> {
    let (low, high) =
        points.clone().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
    let center = (low + high) * 0.5;
    let radius2 = points.map(|p| p.distance_squared(center)).fold(0.0, f32::max);
    (center.is_finite() && radius2 > 0.0).then(|| (center, radius2.sqrt()))
}

/// The sphere around two spheres.
fn join(a: (Vec3, f32), b: (Vec3, f32)) -> (Vec3, f32) {
    let distance = a.0.distance(b.0);
    if distance + b.1 <= a.1 {
        return a;
    }
    if distance + a.1 <= b.1 {
        return b;
    }
    let radius = 0.5 * (distance + a.1 + b.1);
    (a.0 + (b.0 - a.0) * ((radius - a.1) / distance), radius)
}

/// At most `most` spheres: groups are halved along their widest axis until there are so many.
fn halved(spheres: Vec<(Vec3, f32)>, most: usize) -> Vec<(Vec3, f32)> {
    if spheres.len() <= most {
        return spheres;
    }
    let mut groups = vec![spheres];
    while groups.len() < most {
        let Some(largest) = (0..groups.len()).max_by_key(|&g| groups[g].len()) else { break };
        let mut group = groups.swap_remove(largest);
        if group.len() < 2 {
            groups.push(group);
            break;
        }
        let (low, high) =
            group.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), s| (low.min(s.0), high.max(s.0)));
        let extent = high - low;
        let axis = extent.to_array().iter().position(|&e| e == extent.max_element()).unwrap_or(0);
        group.sort_by(|a, b| a.0[axis].total_cmp(&b.0[axis]));
        let rest = group.split_off(group.len() / 2);
        groups.extend([group, rest]);
    }
    groups.into_iter().filter_map(|group| group.into_iter().reduce(join)).collect()
}

/// At most `most` spheres: the two whose joint sphere is smallest are joined until there are so many, so that what is
/// small and alone stays so.
fn gathered(mut spheres: Vec<(Vec3, f32)>, most: usize) -> Vec<(Vec3, f32)> {
    // The best partner of each among those after it; only what has lost its own is looked at again.
    let partner = |spheres: &[(Vec3, f32)], i: usize| {
        let joint = |j: usize| (join(spheres[i], spheres[j]).1, j);
        (i + 1..spheres.len()).map(joint).min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f32::INFINITY, i))
    };
    let mut best: Vec<(f32, usize)> = (0..spheres.len()).map(|i| partner(&spheres, i)).collect();
    while spheres.len() > most {
        let Some(i) = (0..best.len()).min_by(|&a, &b| best[a].0.total_cmp(&best[b].0)) else { break };
        let j = best[i].1;
        spheres[i] = join(spheres[i], spheres[j]);
        spheres.remove(j);
        best.remove(j);
        for k in 0..spheres.len() {
            if k == i || best[k].1 == i || best[k].1 == j {
                best[k] = partner(&spheres, k);
                continue;
            }
            if best[k].1 > j {
                best[k].1 -= 1;
            }
            let joint = if k < i { join(spheres[k], spheres[i]).1 } else { f32::INFINITY };
            if joint < best[k].0 {
                best[k] = (joint, i);
            }
        }
    }
    spheres
}

impl CausticTargets {
    /// The targets of a scene.
    pub fn new(shapes: &Shapes, materials: &Materials) -> CausticTargets {
        let spheres: Vec<(Vec3, f32)> = shapes
            .instances
            .iter()
            .filter(|instance| materials.list[instance.material as usize].focuses())
            .filter_map(|instance| {
                let mesh = &shapes.meshes[instance.mesh as usize];
                bounding_sphere(mesh.positions.iter().map(|&p| instance.point(p)))
            })
            .collect();
        let spheres = gathered(halved(spheres, MAX_SPHERES), MAX_TARGETS);
        let areas = spheres.iter().map(|s| PI * s.1 * s.1);
        let area = areas.clone().sum();
        CausticTargets { choice: Cdf::new(areas.map(f64::from)), spheres, area }
    }

    /// Turns the start of a path from infinity, drawn uniformly over the scene's disc, into one drawn from the mixture.
    /// `u` decides whether it is aimed, and at which target; `point` where on its disc.
    pub fn aim(&self, sky: &Sky, emission: &mut EmissionSample, u: f32, point: Vec2) {
        let Some(choice) = &self.choice else { return };
        if u < AIMED {
            let (target, ..) = choice.sample(f64::from(u / AIMED));
            self.through(sky, emission, target, point);
        } else {
            self.weigh(sky, emission);
        }
    }

    /// The same, and part of the paths through the disc of a region. Flux and density are those without the region:
    /// [`CausticTargets::lit`] has the mixture's.
    pub fn aim_with_region(&self, sky: &Sky, emission: &mut EmissionSample, region: Region, u: f32, point: Vec2) {
        let lit = self.share_lit();
        if u < lit {
            let radius = region.sample(u / lit);
            emission.entry = EntryDisc::Region(radius);
            emission.origin = Self::point(sky, emission.direction, (region.center, radius), point);
            self.weigh(sky, emission);
        } else {
            self.aim(sky, emission, (u - lit) / (1.0 - lit), point);
        }
    }

    fn share_lit(&self) -> f32 {
        if self.choice.is_none() { LIT.0 } else { LIT.1 }
    }

    /// Density of an aimed start in the mixture with a region, and the part of it that all light has: without the
    /// targets.
    pub fn density_with_region(&self, sky: &Sky, emission: &EmissionSample, region: Region) -> (f32, f32) {
        let lit = self.share_lit();
        let (p, d, aimed) = (emission.origin, emission.direction, emission.density.onward);
        let drawn = if let EntryDisc::Region(radius) = emission.entry { radius } else { 0.0 };
        let through = lit * region.density(from_line(region.center, p, d), drawn);
        ((1.0 - lit) * aimed + through, (1.0 - lit) * aimed * self.unaimed(sky, emission) + through)
    }

    /// The same, drawn through the disc of one target.
    pub fn through(&self, sky: &Sky, emission: &mut EmissionSample, target: usize, point: Vec2) {
        emission.entry = EntryDisc::Target(target);
        emission.origin = Self::point(sky, emission.direction, self.spheres[target], point);
        self.weigh(sky, emission);
    }

    /// A point of the line along `d` through a point of a sphere's disc, upstream of everything, as all starts are.
    fn point(sky: &Sky, d: Vec3, (center, radius): (Vec3, f32), point: Vec2) -> Vec3 {
        let frame = Frame::from_normal(d);
        let q = warp::disc_concentric(point) * radius;
        let p = center + frame.t * q.x + frame.b * q.y;
        p - d * ((p - sky.center).dot(d) + sky.radius)
    }

    /// Gives a start the flux and density of the mixture; it has those of the uniform density alone.
    fn weigh(&self, sky: &Sky, emission: &mut EmissionSample) {
        emission.density.onward = self.density_drawn(sky, emission.origin, emission.direction, Some(emission.entry));
        emission.flux *= 1.0 / (PI * sky.radius * sky.radius * emission.density.onward);
    }

    /// The bounding spheres: centres and radii.
    pub fn spheres(&self) -> &[(Vec3, f32)] {
        &self.spheres
    }

    /// Density per area, in the mixture, of the line through `p` along the unit `d`.
    #[inline]
    pub fn density(&self, sky: &Sky, p: Vec3, d: Vec3) -> f32 {
        self.density_drawn(sky, p, d, None)
    }

    /// The same of a line that was drawn through a disc, which it is within.
    fn density_drawn(&self, sky: &Sky, p: Vec3, d: Vec3, drawn: Option<EntryDisc>) -> f32 {
        if self.choice.is_none() {
            return 1.0 / (PI * sky.radius * sky.radius);
        }
        let within = |&(target, &(center, radius)): &(usize, &(Vec3, f32))| {
            drawn == Some(EntryDisc::Target(target)) || from_line(center, p, d) < radius * radius
        };
        let discs = self.spheres.iter().enumerate().filter(within).count();
        self.uniform(sky, p, d, drawn) + AIMED * discs as f32 / self.area
    }

    /// The part of that density that paths of all light have.
    fn uniform(&self, sky: &Sky, p: Vec3, d: Vec3, drawn: Option<EntryDisc>) -> f32 {
        // A target's disc may reach over the rim of the scene's.
        let inside = drawn == Some(EntryDisc::Whole) || from_line(sky.center, p, d) <= sky.radius * sky.radius;
        if inside { (1.0 - AIMED) / (PI * sky.radius * sky.radius) } else { 0.0 }
    }

    /// Its share of the density that an aimed start has.
    pub fn unaimed(&self, sky: &Sky, emission: &EmissionSample) -> f32 {
        match self.choice {
            None => 1.0,
            Some(_) => {
                let EmissionSample { origin, direction, entry, density, .. } = emission;
                self.uniform(sky, *origin, *direction, Some(*entry)) / density.onward
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::EmissionDensity;
    use crate::math::Rgb;
    use crate::random::{Domain, Purpose, Stream};

    /// A start of light from infinity, drawn through the disc of the scene, whose area is `whole`, before it is aimed.
    fn start(origin: Vec3, direction: Vec3, whole: f32) -> EmissionSample {
        let onward = 1.0 / whole;
        EmissionSample {
            origin,
            direction,
            flux: Rgb::splat(whole),
            light: 0,
            delta: true,
            infinite: true,
            entry: EntryDisc::Whole,
            density: EmissionDensity { direct: 1.0, start: 1.0, onward, cos: 1.0, infinite: true, delta: true },
        }
    }

    /// The flux that passes any place is the same with and without aiming and with a region of interest, and so is what
    /// goes on of it after it is thinned to the share of paths that light everything: here through small discs that a
    /// target or the region overlaps in part.
    #[test]
    fn aiming_keeps_the_flux() {
        let spheres = vec![(Vec3::new(0.3, 0.0, 0.1), 0.2), (Vec3::new(0.2, 0.1, -0.4), 0.25), (Vec3::X, 0.1)];
        let areas: Vec<f32> = spheres.iter().map(|s: &(Vec3, f32)| PI * s.1 * s.1).collect();
        let choice = Cdf::new(areas.iter().map(|&a| f64::from(a)));
        let targets = CausticTargets { spheres, choice, area: areas.iter().sum() };
        let sky = Sky { center: Vec3::ZERO, radius: 1.05, environment: None, hidden_from_camera: false };
        let d = Vec3::NEG_Y;
        let whole = PI * sky.radius * sky.radius;
        let n = 200_000u64;
        let places = [(Vec3::new(0.4, 0.0, 0.2), 0.15f32), (Vec3::new(-0.5, 0.0, 0.0), 0.2), (Vec3::X, 0.05)];
        let region = Region::new(Vec3::new(-0.4, 0.2, 0.1), 0.3, sky.radius);
        let small = Region::new(Vec3::new(0.2, 0.1, 0.2), 0.1, sky.radius);
        assert_eq!((region.wider, small.wider), (0, 2));
        let regions = [None, Some(region), Some(small)];
        for ((center, radius), region) in places.into_iter().flat_map(|place| regions.map(|region| (place, region))) {
            // All of it, and what goes on.
            let (mut sum, mut squares) = ([0.0f64; 2], [0.0f64; 2]);
            for i in 0..n {
                let draws = Stream::new(9, 0, Domain::Test, i).vertex(0);
                let q = warp::disc_concentric(draws.two(Purpose::Pixel)) * sky.radius;
                let mut emission = start(Vec3::new(q.x, sky.radius, q.y), d, whole);
                let (u, point) = (draws.one(Purpose::Lobe), draws.two(Purpose::Lens));
                let unaimed = match region {
                    Some(region) => {
                        targets.aim_with_region(&sky, &mut emission, region, u, point);
                        let (mixed, unaimed) = targets.density_with_region(&sky, &emission, region);
                        emission.flux *= emission.density.onward / mixed;
                        unaimed / mixed
                    }
                    None => {
                        targets.aim(&sky, &mut emission, u, point);
                        targets.unaimed(&sky, &emission)
                    }
                };
                assert!((0.0..=1.0001).contains(&unaimed));
                let v = emission.origin - center;
                let x = if v.x * v.x + v.z * v.z < radius * radius { f64::from(emission.flux.x) } else { 0.0 };
                let goes_on = draws.one(Purpose::Loss) < unaimed;
                for (k, x) in [x, if goes_on { x / f64::from(unaimed) } else { 0.0 }].into_iter().enumerate() {
                    sum[k] += x;
                    squares[k] += x * x;
                }
            }
            for (sum, squares) in sum.into_iter().zip(squares) {
                let mean = sum / n as f64;
                let error = ((squares / n as f64 - mean * mean) / n as f64).sqrt();
                let expected = f64::from(PI * radius * radius);
                // Two-sided 4 sigma over eighteen fluxes: one false alarm in 870 seeds; an aimed path that forgot the
                // uniform share is off by far more.
                assert!((mean - expected).abs() < 4.0 * error, "{mean} +- {error}, expected {expected}, {region:?}");
                assert!((mean * 1.5 - expected).abs() > 4.0 * error, "half as much again goes unnoticed");
            }
        }
    }

    /// A target is as bright however much smaller than the scene it is: starts drawn through its disc carry twice its
    /// area's flux, those at the rim as well. While rounding decided whether they lie in the disc, the mean was 160
    /// instead of 6.28 at R/r = 700, of a few that carried (R/r)^2 times as much.
    #[test]
    fn the_rim_of_a_small_target_carries_no_more() {
        for ratio in [10.0f32, 700.0, 7_000.0, 100_000.0] {
            let area = PI;
            let spheres = vec![(Vec3::new(0.3, -0.2, 0.5) * ratio, 1.0)];
            let targets = CausticTargets { spheres, choice: Cdf::new(std::iter::once(f64::from(area))), area };
            let sky = Sky { center: Vec3::ZERO, radius: ratio, environment: None, hidden_from_camera: false };
            let whole = PI * ratio * ratio;
            let region = Region::new(Vec3::new(-0.4, 0.2, 0.1) * ratio, 1.0, ratio);
            let (mut mean, mut greatest) = (0.0f64, 0.0f32);
            let n = 20_000u64;
            for i in 0..n {
                let draws = Stream::new(10, 0, Domain::Test, i).vertex(0);
                let point = draws.two(Purpose::Lens);
                let mut emission = start(Vec3::ZERO, warp::sphere_uniform(draws.two(Purpose::Direction)), whole);
                let lit = EmissionSample { ..emission };
                targets.through(&sky, &mut emission, 0, point);
                mean += f64::from(emission.flux.x) / n as f64;
                // Through the region's own disc, where the density is a third of a half of one over its area at least.
                let mut lit = lit;
                targets.aim_with_region(&sky, &mut lit, region, 0.0, point);
                greatest = greatest.max(1.0 / targets.density_with_region(&sky, &lit, region).0);
            }
            // 1 / (AIMED (1 / area + 1 / whole)).
            let expected = f64::from(1.0 / (AIMED * (1.0 / area + 1.0 / whole)));
            assert!((mean / expected - 1.0).abs() < 1e-4, "{ratio}: {mean}, expected {expected}");
            assert!(greatest < 6.001 * PI, "{ratio}: {greatest}");
        }
    }
}
