//! Evaluation of a BSDF for many photons at one point, without densities.

use super::layered::{Layered, MIN_COSINE};
use super::profile::{Position, Profile};
use super::{LobeSet, Shading};
use crate::math::{Rgb, Vec3};
use std::f32::consts::FRAC_1_PI;
use wide::{CmpGe, CmpGt, f32x8};

/// A BSDF prepared for [`Shading::gather`], the radiance that photons cause, with many photons.
pub struct Gathering<'a> {
    shading: &'a Shading<'a>,
    set: LobeSet,
    kind: GatherCase<'a>,
}

/// Cases of a BSDF that differ in the cost per photon. Most photons fall on the first two.
enum GatherCase<'a> {
    /// The BSDF scatters nothing in the requested lobes.
    Nothing,
    /// Diffuse reflection: `factor`, times the transmittance `through` of a rough interface.
    Diffuse { factor: Rgb, through: Option<&'a Profile> },
    /// Reflecting facets without a cover, and whether the diffuse base below them counts.
    Facets(&'a Layered<'a>, bool),
    /// Any other BSDF, evaluated in general.
    Any,
}

impl<'a> Shading<'a> {
    /// Prepares the evaluation of photons with the lobes of `set`.
    #[inline]
    pub fn gathering(&'a self, set: LobeSet) -> Gathering<'a> {
        let kind = if self.cos_og == 0.0 {
            GatherCase::Nothing
        } else if self.has_normal_map() {
            GatherCase::Any
        } else if let Some((factor, through)) = self.bsdf.diffuse_only(&self.view, set) {
            GatherCase::Diffuse { factor, through }
        } else {
            match self.bsdf.reflecting_facets_only(&self.view, set) {
                Some(layered) => GatherCase::Facets(layered, set.intersects(LobeSet::BROAD)),
                None => GatherCase::Any,
            }
        };
        Gathering { shading: self, set, kind }
    }
}

/// Dot products of eight vectors, given by their coordinates, with one.
#[inline]
fn dot(v: &[f32x8; 3], w: Vec3) -> f32x8 {
    v[0] * w.x + v[1] * w.y + v[2] * w.z
}

impl Gathering<'_> {
    /// 1 if the viewer is in front of the surface, -1 behind. Only photons on that side count.
    #[inline]
    fn side(&self) -> f32 {
        if self.shading.view.side == 1 { -1.0 } else { 1.0 }
    }

    /// Radiance towards the viewer per flux over kernel area of a photon from `wi`, as [`Shading::gather`] returns it.
    /// `cosine` is the cosine of `wi` with the geometric normal of the surface where the photon was stored.
    #[inline]
    pub fn photon(&self, wi: Vec3, cosine: f32) -> Rgb {
        match &self.kind {
            GatherCase::Nothing => Rgb::ZERO,
            GatherCase::Any | GatherCase::Facets(..) => self.shading.gather(wi, cosine, self.set),
            GatherCase::Diffuse { factor, through } => {
                let side = self.side();
                let (cos_s, cos_g) = (wi.dot(self.shading.frame.n) * side, wi.dot(self.shading.ng) * side);
                if cos_s < MIN_COSINE || cos_g <= 0.0 || cosine <= 0.0 {
                    return Rgb::ZERO;
                }
                let through = through.map_or(1.0, |through| through.at(Position::new(cos_s)));
                *factor * (through * cos_s / cosine)
            }
        }
    }

    /// [`Gathering::photon`] for eight photons. `wi` is the x, y and z coordinates of their directions, the result is
    /// red, green and blue.
    #[inline]
    pub fn photons8(&self, wi: [f32x8; 3], cosine: f32x8) -> [f32x8; 3] {
        if matches!(self.kind, GatherCase::Nothing | GatherCase::Any) {
            return self.each(wi, cosine);
        }
        let (side, frame) = (self.side(), &self.shading.frame);
        let (cos_s, cos_g) = (dot(&wi, frame.n) * side, dot(&wi, self.shading.ng) * side);
        let zero = f32x8::ZERO;
        let counts = cos_s.cmp_ge(f32x8::splat(MIN_COSINE)) & cos_g.cmp_gt(zero) & cosine.cmp_gt(zero);
        // Lanes that do not count may hold any value. The last step masks them.
        let scale = counts.blend(cos_s / cosine, zero);
        let at = Positions::new(cos_s);
        match &self.kind {
            GatherCase::Diffuse { factor, through } => {
                let through = through.map_or(f32x8::ONE, |through| at.of(through)) * scale;
                [through * factor.x, through * factor.y, through * factor.z]
            }
            GatherCase::Facets(..) if self.mirrors_any(&wi, cos_g) => self.each(wi, cosine),
            GatherCase::Facets(layered, broad) => {
                let i = [dot(&wi, frame.t), dot(&wi, frame.b), cos_s.fast_max(f32x8::splat(MIN_COSINE))];
                self.facets(layered, *broad, &i, &at).map(|f| counts.blend(f * scale, f32x8::ZERO))
            }
            GatherCase::Nothing | GatherCase::Any => [f32x8::ZERO; 3],
        }
    }

    /// [`Gathering::photon`] for each of eight photons.
    #[inline(never)]
    fn each(&self, wi: [f32x8; 3], cosine: f32x8) -> [f32x8; 3] {
        let ([x, y, z], cosine) = (wi.map(|c| c.to_array()), cosine.to_array());
        let f: [Rgb; 8] = std::array::from_fn(|k| self.photon(Vec3::new(x[k], y[k], z[k]), cosine[k]));
        std::array::from_fn(|c| f32x8::from(f.map(|f| f[c])))
    }

    /// Whether one of eight photons also reaches the surface from its mirror image, see [`Shading::second`]. `cos_g` are
    /// their cosines with the geometric normal on the viewer's side.
    #[inline]
    fn mirrors_any(&self, wi: &[f32x8; 3], cos_g: f32x8) -> bool {
        let (n, ng) = (self.shading.frame.n, self.shading.ng);
        if n == ng {
            return false;
        }
        let cos_mirrored = dot(wi, n) * self.side() - cos_g * (2.0 * n.dot(ng));
        (cos_mirrored.cmp_gt(f32x8::ZERO) & cos_g.cmp_gt(f32x8::ZERO)).any()
    }

    /// [`Layered::eval`] for eight directions on the viewer's side.
    #[inline]
    fn facets(&self, layered: &Layered<'_>, broad: bool, i: &[f32x8; 3], at: &Positions) -> [f32x8; 3] {
        let (n, view) = (layered.interface, &self.shading.view);
        let (o, ggx) = (view.o, &n.ggx);
        let (ax, ay) = (ggx.alpha_x, ggx.alpha_y);
        // See `Ggx::reflection`.
        let h = [i[0] + o.x, i[1] + o.y, i[2] + o.z];
        let length2 = h[0] * h[0] + h[1] * h[1] + h[2] * h[2];
        let square = |x: f32x8| x * x;
        let stretched = (square(h[0] * (1.0 / ax)) + square(h[1] * (1.0 / ay)) + square(h[2])) / length2;
        let root = (square(i[0] * ax) + square(i[1] * ay) + square(i[2])).sqrt();
        let both = i[2] * view.root + root * o.z;
        let value = f32x8::splat(0.5 * FRAC_1_PI / (ax * ay)) / (square(stretched) * both);
        let cos = (length2.sqrt() * 0.5).fast_min(f32x8::ONE);
        let grazing = n.dielectric.smooth[0].grazing_weight_from_thin(cos);
        let inverse = f32x8::ONE - cos;
        let schlick = square(square(inverse)) * inverse;
        let loss = at.of(&n.loss) * view.loss;
        let through = if broad { at.of(&n.through) * view.through } else { f32x8::ZERO };
        std::array::from_fn(|c| {
            let (base, f0) = (layered.base[c], n.dielectric.f0[c]);
            let metal = (schlick * (1.0 - base) + base) * layered.metal;
            let matte = (grazing * (n.dielectric.f90 - f0) + f0) * (layered.matte * n.dielectric.color[c]);
            (metal + matte) * value + loss * layered.reflected_compensation[c] + through * layered.diffuse[c]
        })
    }
}

/// Positions in the tables of the cosines of eight directions.
struct Positions {
    index: [i32; 8],
    t: f32x8,
}

impl Positions {
    #[inline]
    fn new(cos: f32x8) -> Positions {
        let x = cos.fast_max(f32x8::ZERO).fast_min(f32x8::ONE).sqrt().sqrt() * Position::SCALE;
        let floor = x.fast_min(f32x8::splat(Position::SCALE - 1.0)).trunc_int();
        Positions { index: floor.to_array(), t: x - f32x8::from_i32x8(floor) }
    }

    /// Values of a profile at the eight positions, like [`Profile::at`].
    #[inline]
    fn of(&self, profile: &Profile) -> f32x8 {
        let nodes = profile.nodes();
        // The bounds make every index provably valid, so that no check remains.
        let at = |k: usize, next: usize| nodes[(self.index[k] as usize & 31).min(30) + next];
        let a = f32x8::from(std::array::from_fn::<f32, 8, _>(|k| at(k, 0)));
        let b = f32x8::from(std::array::from_fn::<f32, 8, _>(|k| at(k, 1)));
        a + (b - a) * self.t
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::Bsdf;
    use crate::bsdf::{EnergyTables, Interface, Parameters};
    use crate::math::Frame;
    use crate::random::{Domain, Purpose, Stream};

    /// The special cases return the values of the general one, on both sides and with a tilted shading normal.
    #[test]
    fn special_cases_agree_with_gather() {
        let tables = EnergyTables::new([1.5]);
        let plastic =
            Parameters { base_color: Rgb::new(0.6, 0.3, 0.1), eta: 1.5, specular: 1.0, ..Parameters::default() };
        let matte = Parameters { specular: 0.0, ..plastic };
        let rough = Parameters { alpha_x: 0.5, alpha_y: 0.5, ..plastic };
        let sharp = Parameters { alpha_x: 0.05, alpha_y: 0.05, ..plastic };
        let metal = Parameters { metallic: 0.7, alpha_x: 0.6, alpha_y: 0.3, ..plastic };
        let glass = Parameters { transmission: 0.5, ..rough };
        let coated = Parameters { clearcoat: 1.0, clearcoat_alpha: 0.3, ..rough };
        for parameters in [plastic, matte, rough, sharp, metal, glass, coated] {
            let frame = Frame::from_normal(Vec3::new(0.3, 0.1, 1.0).normalize());
            let interface = Interface::new(&parameters, &tables);
            let bsdf = Bsdf::new(&parameters, &interface);
            for i in 0..2000 {
                let draws = Stream::new(1, 0, Domain::Test, i).vertex(0);
                let wo = crate::math::warp::sphere_uniform(draws.two(Purpose::Pixel));
                let wi = crate::math::warp::sphere_uniform(draws.two(Purpose::Lens));
                let shading = Shading::new(frame, Vec3::Z, bsdf, wo);
                let cosine = draws.one(Purpose::Lobe);
                let expected = shading.gather(wi, cosine, LobeSet::BROAD);
                let gathering = shading.gathering(LobeSet::BROAD);
                let found = gathering.photon(wi, cosine);
                assert!((found - expected).length() <= 1e-4 * expected.length() + 1e-7, "{found} {expected}");
                // Eight photons, of which this is one.
                let lane = (i % 8) as usize;
                let eight: [Vec3; 8] = std::array::from_fn(|k| if k == lane { wi } else { Vec3::new(0.6, 0.0, 0.8) });
                let cosines = f32x8::from(std::array::from_fn(|k| if k == lane { cosine } else { 0.8 }));
                let found = gathering.photons8(std::array::from_fn(|a| f32x8::from(eight.map(|w| w[a]))), cosines);
                let found = Rgb::from_array(found.map(|c| c.to_array()[lane]));
                assert!((found - expected).length() <= 1e-4 * expected.length() + 1e-7, "{found} {expected}");
            }
        }
    }

    /// A photon that hit a neighbouring facet at a large cosine but grazes this surface contributes in proportion to
    /// its small cosine with the shading normal. Division by its cosine with this surface would make it hundreds of
    /// times too bright.
    #[test]
    fn photons_of_neighbouring_facets_are_divided_by_their_own_cosine() {
        let tables = EnergyTables::new([1.5]);
        let parameters = Parameters { base_color: Rgb::splat(0.8), specular: 0.0, ..Parameters::default() };
        let interface = Interface::new(&parameters, &tables);
        let bsdf = Bsdf::new(&parameters, &interface);
        let frame = Frame::from_normal(Vec3::new(1e-3, 0.0, 1.0).normalize());
        let shading = Shading::new(frame, Vec3::Z, bsdf, Vec3::new(0.0, 0.6, 0.8));
        let wi = Vec3::new(1.0, 0.0, 1e-6).normalize();
        let met = wi.dot(Vec3::new(0.6, 0.0, 0.8));
        let (cos_s, cos_g) = (wi.dot(frame.n), wi.dot(Vec3::Z));
        let brought = shading.gathering(LobeSet::BROAD).photon(wi, met);
        let expected = Rgb::splat(0.8 * FRAC_1_PI * cos_s / met);
        assert!((brought - expected).length() < 1e-3 * expected.length(), "{brought} {expected}");
        assert!(cos_s / cos_g > 500.0 && brought.max_element() < 1e-2);
    }
}
