//! Aimed emission of light from infinity: half of the light paths start towards objects that can make caustics.
//!
//! Unaimed paths enter the scene through a disc as large as the scene, so few of them hit a small glass on a wide
//! floor. Aimed starts are sampled from a mixture of the scene's disc and the discs of the targets' bounding spheres.
//! The flux of a path is divided by its density in the mixture, so the estimate remains unbiased.

use super::{Cdf, EmissionSample, EntryDisc, Region, Sky};
use crate::geometry::Shapes;
use crate::material::Objects;
use crate::math::{Frame, Rgb, Vec2, Vec3, bounding_box, warp};
use std::f32::consts::PI;

/// Share of the light paths from infinity that start on the disc of a caustic target, an object that can make caustics.
const AIMED_SHARE: f32 = 0.5;
/// Maximum number of caustic targets, the spheres around objects that can make caustics; [`merged_spheres`] merges
/// nearby ones.
const MAX_TARGETS: usize = 32;
/// Maximum number of spheres given to [`merged_spheres`], whose cost is quadratic; beforehand, [`spatially_merged`]
/// reduces more spheres to this number.
const MAX_SPHERES: usize = 512;
/// Share of the light paths from infinity that start on a disc of the region of interest (the sphere around most
/// visible surfaces), in a scene without caustic targets.
const REGION_SHARE: f32 = 0.5;
/// Share of the light paths from infinity that start on a disc of the region of interest (the sphere around most
/// visible surfaces), in a scene with caustic targets.
const REGION_SHARE_WITH_TARGETS: f32 = 1.0 / 3.0;

/// Squared distance of `center` from the line through `p` along the unit `d`.
#[inline]
fn distance_to_line2(center: Vec3, p: Vec3, d: Vec3) -> f32 {
    let v = p - center;
    (v - d * v.dot(d)).length_squared()
}

/// Caustic targets: the bounding spheres of the objects that can make caustics, towards which light paths start.
#[derive(Clone)]
pub struct CausticTargets {
    /// For each instance, its bounding sphere if it can make caustics.
    instances: Vec<Option<(Vec3, f32)>>,
    /// Centre and radius (m) of the bounding sphere of each target.
    spheres: Vec<(Vec3, f32)>,
    /// Selects a target in proportion to the area of its disc, the cross-section of its sphere; `None` without targets.
    choice: Option<Cdf>,
    /// Sum of the areas of the targets' discs, the cross-sections of their spheres (m2).
    area: f32,
}

/// Centre and radius of a sphere around points, centred in their bounding box; `None` without points.
fn bounding_sphere(points: impl Iterator<Item = Vec3> + Clone) -> Option<(Vec3, f32)> {
    let (low, high) = bounding_box(points.clone());
    let center = (low + high) * 0.5;
    let radius2 = points.map(|p| p.distance_squared(center)).fold(0.0, f32::max);
    (center.is_finite() && radius2 > 0.0).then(|| (center, radius2.sqrt()))
}

/// The bounding sphere of an instance; `None` if it has no extent.
fn sphere_of(shapes: &Shapes, instance: usize) -> Option<(Vec3, f32)> {
    let instance = &shapes.instances[instance];
    bounding_sphere(shapes.meshes[instance.mesh as usize].positions.iter().map(|&p| instance.point(p)))
}

/// Centre and radius of the smallest sphere around two spheres.
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

/// Merges spheres (centre, radius) until at most `most` remain: repeatedly halves the largest set along its widest
/// axis, then joins the spheres of each set into one.
fn spatially_merged(spheres: Vec<(Vec3, f32)>, most: usize) -> Vec<(Vec3, f32)> {
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
        let (low, high) = bounding_box(group.iter().map(|sphere| sphere.0));
        let extent = high - low;
        let axis = extent.to_array().iter().position(|&e| e == extent.max_element()).unwrap_or(0);
        group.sort_by(|a, b| a.0[axis].total_cmp(&b.0[axis]));
        let rest = group.split_off(group.len() / 2);
        groups.extend([group, rest]);
    }
    groups.into_iter().filter_map(|group| group.into_iter().reduce(join)).collect()
}

/// Merges spheres (centre, radius) until at most `most` remain: repeatedly joins the pair with the smallest enclosing
/// sphere, so that small isolated spheres stay small.
fn merged_spheres(mut spheres: Vec<(Vec3, f32)>, most: usize) -> Vec<(Vec3, f32)> {
    // For each sphere, the best partner among the later ones. It is searched again only if that partner was merged.
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
    /// Finds the caustic targets of a scene from its objects and their materials.
    pub fn new(objects: Objects<'_>) -> CausticTargets {
        CausticTargets::find(objects, |instance| sphere_of(objects.shapes, instance))
    }

    /// The targets at another moment of a moving scene.
    pub fn at_moment(&self, objects: Objects<'_>) -> CausticTargets {
        let shapes = objects.shapes;
        let known = |instance: usize| self.instances.get(instance).copied().flatten();
        CausticTargets::find(objects, |instance| match known(instance) {
            Some(sphere) if !shapes.instances[instance].moves => Some(sphere),
            _ => sphere_of(shapes, instance),
        })
    }

    /// Finds the caustic targets, where `sphere` gives the bounding sphere of an instance.
    fn find(objects: Objects<'_>, sphere: impl Fn(usize) -> Option<(Vec3, f32)>) -> CausticTargets {
        let all = &objects.shapes.instances;
        // Few light paths would find a small body that scatters light, either.
        let is_target = |i: &usize| {
            let material = objects.material(&all[*i]);
            let scatters = || material.medium.is_some_and(|medium| medium.sigma_s != Rgb::ZERO);
            material.focuses() || (material.is_solid() && scatters())
        };
        let instances: Vec<_> = (0..all.len()).map(|i| Some(i).filter(is_target).and_then(&sphere)).collect();
        let spheres: Vec<(Vec3, f32)> = instances.iter().copied().flatten().collect();
        let spheres = merged_spheres(spatially_merged(spheres, MAX_SPHERES), MAX_TARGETS);
        let areas = spheres.iter().map(|s| PI * s.1 * s.1);
        let area = areas.clone().sum();
        CausticTargets { choice: Cdf::new(areas.map(f64::from)), instances, spheres, area }
    }

    /// Turns the start of a light path from infinity, sampled uniformly on the disc of the whole scene, into a start
    /// sampled from the mixture of this disc and the targets' discs. `u` selects the disc, `point` a point on a
    /// target's disc.
    pub fn aim(&self, sky: &Sky, emission: &mut EmissionSample, u: f32, point: Vec2) {
        let Some(choice) = &self.choice else { return };
        if u < AIMED_SHARE {
            let (target, ..) = choice.sample(f64::from(u / AIMED_SHARE));
            self.aim_at(sky, emission, target, point);
        } else {
            self.apply_mixture(sky, emission);
        }
    }

    /// Does the work of [`CausticTargets::aim`], and moves part of the starts to a disc of the region of interest. Flux
    /// and density do not account for the region: [`CausticTargets::density_with_region`] returns the density of the
    /// whole mixture.
    pub fn aim_with_region(&self, sky: &Sky, emission: &mut EmissionSample, region: Region, u: f32, point: Vec2) {
        let share = self.region_share();
        if u < share {
            let radius = region.sample(u / share);
            emission.entry = EntryDisc::Region(radius);
            emission.origin = Self::sample_origin(sky, emission.direction, region.center, radius, point);
            self.apply_mixture(sky, emission);
        } else {
            self.aim(sky, emission, (u - share) / (1.0 - share), point);
        }
    }

    fn region_share(&self) -> f32 {
        if self.choice.is_none() { REGION_SHARE } else { REGION_SHARE_WITH_TARGETS }
    }

    /// Density per area (1/m2) of the start of a light path from infinity in the mixture of the discs of scene, targets
    /// and region of interest, and the part of this density that is not due to the targets.
    pub fn density_with_region(&self, sky: &Sky, emission: &EmissionSample, region: Region) -> (f32, f32) {
        let share = self.region_share();
        let (p, d, aimed) = (emission.origin, emission.direction, emission.density.onward);
        let drawn = if let EntryDisc::Region(radius) = emission.entry { radius } else { 0.0 };
        let through = share * region.density(distance_to_line2(region.center, p, d), drawn);
        ((1.0 - share) * aimed + through, (1.0 - share) * aimed * self.unaimed_share(sky, emission) + through)
    }

    /// Moves the start of a light path from infinity to a point of the disc of `target`, and sets the flux and density
    /// that it has in the mixture of the discs of scene and targets.
    pub fn aim_at(&self, sky: &Sky, emission: &mut EmissionSample, target: usize, point: Vec2) {
        emission.entry = EntryDisc::Target(target);
        let (center, radius) = self.spheres[target];
        emission.origin = Self::sample_origin(sky, emission.direction, center, radius, point);
        self.apply_mixture(sky, emission);
    }

    /// Samples a line along the unit `d` through the disc of a sphere, and returns a point on it outside the scene's
    /// bounding sphere, where a light path can start.
    fn sample_origin(sky: &Sky, d: Vec3, center: Vec3, radius: f32, point: Vec2) -> Vec3 {
        let frame = Frame::from_normal(d);
        let q = warp::disc_concentric(point) * radius;
        let p = center + frame.t * q.x + frame.b * q.y;
        p - d * ((p - sky.center).dot(d) + sky.radius)
    }

    /// Replaces flux and density of a start, which assume the scene's disc alone, by those in the mixture of the discs
    /// of scene and targets.
    fn apply_mixture(&self, sky: &Sky, emission: &mut EmissionSample) {
        emission.density.onward = self.mixture_density(sky, emission.origin, emission.direction, Some(emission.entry));
        emission.flux *= 1.0 / (PI * sky.radius * sky.radius * emission.density.onward);
    }

    /// Centres and radii (m) of the targets' bounding spheres.
    pub fn spheres(&self) -> &[(Vec3, f32)] {
        &self.spheres
    }

    /// Density per area (1/m2) with which a light path from infinity starts along the line through `p` with unit
    /// direction `d`, in the mixture of the discs of scene and targets.
    #[inline]
    pub fn density(&self, sky: &Sky, p: Vec3, d: Vec3) -> f32 {
        self.mixture_density(sky, p, d, None)
    }

    /// [`CausticTargets::density`] of a line that was sampled on the disc `drawn`: the line counts as passing through
    /// this disc, even if rounding puts it outside. `None` if the line was not sampled.
    fn mixture_density(&self, sky: &Sky, p: Vec3, d: Vec3, drawn: Option<EntryDisc>) -> f32 {
        if self.choice.is_none() {
            return 1.0 / (PI * sky.radius * sky.radius);
        }
        let within = |&(target, &(center, radius)): &(usize, &(Vec3, f32))| {
            drawn == Some(EntryDisc::Target(target)) || distance_to_line2(center, p, d) < radius * radius
        };
        let discs = self.spheres.iter().enumerate().filter(within).count();
        self.scene_disc_density(sky, p, d, drawn) + AIMED_SHARE * discs as f32 / self.area
    }

    /// Density per area (1/m2) with which a start on the disc of the whole scene, not of a target, takes the line
    /// through `p` along `d`, including the share of such starts in the mixture.
    fn scene_disc_density(&self, sky: &Sky, p: Vec3, d: Vec3, drawn: Option<EntryDisc>) -> f32 {
        // A target's disc may extend beyond the scene's.
        let inside = drawn == Some(EntryDisc::Whole) || distance_to_line2(sky.center, p, d) <= sky.radius * sky.radius;
        if inside { (1.0 - AIMED_SHARE) / (PI * sky.radius * sky.radius) } else { 0.0 }
    }

    /// Part, 0 to 1, of the density of a start from infinity that is due to the disc of the whole scene, not to caustic
    /// targets.
    pub fn unaimed_share(&self, sky: &Sky, emission: &EmissionSample) -> f32 {
        match self.choice {
            None => 1.0,
            Some(_) => {
                let EmissionSample { origin, direction, entry, density, .. } = emission;
                self.scene_disc_density(sky, *origin, *direction, Some(*entry)) / density.onward
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::EmissionDensity;
    use crate::random::{Domain, Purpose, Stream};

    /// Test start of a light path from infinity, sampled on the scene's disc of area `whole` (m2) without aiming.
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

    /// The mean flux through small discs does not depend on aiming or on a region of interest, even after Russian
    /// roulette that keeps paths with their unaimed share. Targets and regions partly overlap the discs.
    #[test]
    fn aiming_keeps_the_flux() {
        let spheres = vec![(Vec3::new(0.3, 0.0, 0.1), 0.2), (Vec3::new(0.2, 0.1, -0.4), 0.25), (Vec3::X, 0.1)];
        let areas: Vec<f32> = spheres.iter().map(|s: &(Vec3, f32)| PI * s.1 * s.1).collect();
        let choice = Cdf::new(areas.iter().map(|&a| f64::from(a)));
        let area = areas.iter().sum();
        let targets = CausticTargets { instances: Vec::new(), spheres, choice, area };
        let sky = Sky {
            center: Vec3::ZERO,
            radius: 1.05,
            environment: None,
            background: None,
            hidden_from_camera: false,
            learnt: None,
        };
        let d = Vec3::NEG_Y;
        let whole = PI * sky.radius * sky.radius;
        let n = 200_000u64;
        let places = [(Vec3::new(0.4, 0.0, 0.2), 0.15f32), (Vec3::new(-0.5, 0.0, 0.0), 0.2), (Vec3::X, 0.05)];
        let region = Region::new(Vec3::new(-0.4, 0.2, 0.1), 0.3, sky.radius);
        let small = Region::new(Vec3::new(0.2, 0.1, 0.2), 0.1, sky.radius);
        assert_eq!((region.wider, small.wider), (0, 2));
        let regions = [None, Some(region), Some(small)];
        for ((center, radius), region) in places.into_iter().flat_map(|place| regions.map(|region| (place, region))) {
            // The whole flux, and the flux after roulette.
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
                        targets.unaimed_share(&sky, &emission)
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
                // Two-sided 4 sigma over eighteen fluxes: one false alarm in 870 seeds. Without the share of the
                // scene's disc, the error would be far larger.
                assert!((mean - expected).abs() < 4.0 * error, "{mean} +- {error}, expected {expected}, {region:?}");
                assert!((mean * 1.5 - expected).abs() > 4.0 * error, "half as much again goes unnoticed");
            }
        }
    }

    /// The flux of starts on the disc of a target is twice the disc's area for any size of the scene, also at the rim.
    /// When a rounded position decided whether a start was in the disc, the mean was 160 instead of 6.28 at R/r = 700,
    /// because a few starts carried (R/r)^2 times too much.
    #[test]
    fn starts_at_the_rim_of_a_small_target_carry_no_excess_flux() {
        for ratio in [10.0f32, 700.0, 7_000.0, 100_000.0] {
            let area = PI;
            let spheres = vec![(Vec3::new(0.3, -0.2, 0.5) * ratio, 1.0)];
            let choice = Cdf::new(std::iter::once(f64::from(area)));
            let targets = CausticTargets { instances: Vec::new(), spheres, choice, area };
            let sky = Sky {
                center: Vec3::ZERO,
                radius: ratio,
                environment: None,
                background: None,
                hidden_from_camera: false,
                learnt: None,
            };
            let whole = PI * ratio * ratio;
            let region = Region::new(Vec3::new(-0.4, 0.2, 0.1) * ratio, 1.0, ratio);
            let (mut mean, mut greatest) = (0.0f64, 0.0f32);
            let n = 20_000u64;
            for i in 0..n {
                let draws = Stream::new(10, 0, Domain::Test, i).vertex(0);
                let point = draws.two(Purpose::Lens);
                let mut emission = start(Vec3::ZERO, warp::sphere_uniform(draws.two(Purpose::Direction)), whole);
                let mut lit = EmissionSample { ..emission };
                targets.aim_at(&sky, &mut emission, 0, point);
                mean += f64::from(emission.flux.x) / n as f64;
                // On the region's own disc, the density is at least 1/3 * 1/2 / area.
                targets.aim_with_region(&sky, &mut lit, region, 0.0, point);
                greatest = greatest.max(1.0 / targets.density_with_region(&sky, &lit, region).0);
            }
            let expected = f64::from(1.0 / (AIMED_SHARE * (1.0 / area + 1.0 / whole)));
            assert!((mean / expected - 1.0).abs() < 1e-4, "{ratio}: {mean}, expected {expected}");
            assert!(greatest < 6.001 * PI, "{ratio}: {greatest}");
        }
    }
}
