//! What photons add to the radiance along one direction: values only, many at a point.

use super::layered::{LEAST_COSINE, Layered};
use super::profile::{Position, Profile};
use super::{LobeSet, Shading};
use crate::math::{Rgb, Vec3};
use std::f32::consts::FRAC_1_PI;
use wide::{CmpGe, CmpGt, f32x8};

/// [`Shading::gather`] for many photons.
pub struct Gathering<'a> {
    shading: &'a Shading<'a>,
    set: LobeSet,
    kind: Kind<'a>,
}

/// Most photons meet diffuse reflection, alone or below a rough interface, which need little per photon.
enum Kind<'a> {
    Nothing,
    Diffuse {
        factor: Rgb,
        through: Option<&'a Profile>,
    },
    /// Facets that reflect only, without a covering; whether what is below them counts.
    Facets(&'a Layered<'a>, bool),
    Any,
}

impl<'a> Shading<'a> {
    /// What photons add to the radiance seen, through the lobes of `set`.
    #[inline]
    pub fn gathering(&'a self, set: LobeSet) -> Gathering<'a> {
        let kind = if self.cos_og == 0.0 {
            Kind::Nothing
        } else if self.smooth.is_some() {
            Kind::Any
        } else if let Some((factor, through)) = self.bsdf.diffuse_only(&self.seen, set) {
            Kind::Diffuse { factor, through }
        } else {
            match self.bsdf.reflecting_facets_only(&self.seen, set) {
                Some(layered) => Kind::Facets(layered, set.intersects(LobeSet::BROAD)),
                None => Kind::Any,
            }
        };
        Gathering { shading: self, set, kind }
    }
}

/// Dot product of eight vectors with one.
#[inline]
fn dot(v: &[f32x8; 3], w: Vec3) -> f32x8 {
    v[0] * w.x + v[1] * w.y + v[2] * w.z
}

impl Gathering<'_> {
    /// 1 where the viewer is in front, -1 behind: photons on that side count.
    #[inline]
    fn side(&self) -> f32 {
        if self.shading.seen.side == 1 { -1.0 } else { 1.0 }
    }

    /// [`Shading::gather`] of a photon from `wi`, which has met its surface at this cosine.
    #[inline]
    pub fn photon(&self, wi: Vec3, cosine: f32) -> Rgb {
        match &self.kind {
            Kind::Nothing => Rgb::ZERO,
            Kind::Any | Kind::Facets(..) => self.shading.gather(wi, cosine, self.set),
            Kind::Diffuse { factor, through } => {
                let side = self.side();
                let (cos_s, cos_g) = (wi.dot(self.shading.frame.n) * side, wi.dot(self.shading.ng) * side);
                if cos_s < LEAST_COSINE || cos_g <= 0.0 || cosine <= 0.0 {
                    return Rgb::ZERO;
                }
                let through = through.map_or(1.0, |through| through.at(Position::new(cos_s)));
                *factor * (through * cos_s / cosine)
            }
        }
    }

    /// [`Gathering::photon`] for eight directions, x, y, z, and cosines; the result's red, green, blue.
    #[inline]
    pub fn eight(&self, wi: [f32x8; 3], cosine: f32x8) -> [f32x8; 3] {
        if matches!(self.kind, Kind::Nothing | Kind::Any) {
            let [x, y, z] = wi.map(|c| c.to_array());
            let cosine = cosine.to_array();
            let f: [Rgb; 8] = std::array::from_fn(|k| self.photon(Vec3::new(x[k], y[k], z[k]), cosine[k]));
            return std::array::from_fn(|c| f32x8::from(f.map(|f| f[c])));
        }
        let (side, frame) = (self.side(), &self.shading.frame);
        let (cos_s, cos_g) = (dot(&wi, frame.n) * side, dot(&wi, self.shading.ng) * side);
        let zero = f32x8::ZERO;
        let counts = cos_s.cmp_ge(f32x8::splat(LEAST_COSINE)) & cos_g.cmp_gt(zero) & cosine.cmp_gt(zero);
        // Lanes that do not count are cut off in the end, whatever they hold.
        let scale = counts.blend(cos_s / cosine, zero);
        let at = Positions::new(cos_s);
        match &self.kind {
            Kind::Diffuse { factor, through } => {
                let through = through.map_or(f32x8::ONE, |through| at.of(through)) * scale;
                [through * factor.x, through * factor.y, through * factor.z]
            }
            Kind::Facets(layered, broad) => {
                let i = [dot(&wi, frame.t), dot(&wi, frame.b), cos_s.fast_max(f32x8::splat(LEAST_COSINE))];
                self.facets(layered, *broad, &i, &at).map(|f| counts.blend(f * scale, f32x8::ZERO))
            }
            Kind::Nothing | Kind::Any => [f32x8::ZERO; 3],
        }
    }

    /// As [`Layered::eval`] does it for one direction, on the viewer's side.
    #[inline]
    fn facets(&self, layered: &Layered<'_>, broad: bool, i: &[f32x8; 3], at: &Positions) -> [f32x8; 3] {
        let (n, seen) = (layered.interface, &self.shading.seen);
        let (o, ggx) = (seen.o, &n.ggx);
        let (ax, ay) = (ggx.alpha_x, ggx.alpha_y);
        // See `Ggx::reflection`.
        let h = [i[0] + o.x, i[1] + o.y, i[2] + o.z];
        let length2 = h[0] * h[0] + h[1] * h[1] + h[2] * h[2];
        let square = |x: f32x8| x * x;
        let stretched = (square(h[0] * (1.0 / ax)) + square(h[1] * (1.0 / ay)) + square(h[2])) / length2;
        let root = (square(i[0] * ax) + square(i[1] * ay) + square(i[2])).sqrt();
        let both = i[2] * seen.root + root * o.z;
        let value = f32x8::splat(0.5 * FRAC_1_PI / (ax * ay)) / (square(stretched) * both);
        let cos = (length2.sqrt() * 0.5).fast_min(f32x8::ONE);
        let grazing = n.smooth[0].grazing_weight_from_thin(cos);
        let inverse = f32x8::ONE - cos;
        let schlick = square(square(inverse)) * inverse;
        let loss = at.of(&n.loss) * seen.loss;
        let through = if broad { at.of(&n.through) * seen.through } else { f32x8::ZERO };
        std::array::from_fn(|c| {
            let (base, f0) = (layered.base[c], n.f0[c]);
            let metal = (schlick * (1.0 - base) + base) * layered.metal;
            let matte = (grazing * (n.f90 - f0) + f0) * layered.matte;
            (metal + matte) * value + loss * layered.returned[c] + through * layered.diffuse[c]
        })
    }
}

/// Eight cosines on the axis of profiles.
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

    /// As [`Profile::at`].
    #[inline]
    fn of(&self, profile: &Profile) -> f32x8 {
        let nodes = profile.nodes();
        // Written so that no index can be out of range.
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

    /// The short ways give what the long way gives, on both sides and with a bent shading normal.
    #[test]
    fn gathering_is_gather() {
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
                // Eight at once, this one among others.
                let lane = (i % 8) as usize;
                let eight: [Vec3; 8] = std::array::from_fn(|k| if k == lane { wi } else { Vec3::new(0.6, 0.0, 0.8) });
                let cosines = f32x8::from(std::array::from_fn(|k| if k == lane { cosine } else { 0.8 }));
                let found = gathering.eight(std::array::from_fn(|a| f32x8::from(eight.map(|w| w[a]))), cosines);
                let found = Rgb::from_array(found.map(|c| c.to_array()[lane]));
                assert!((found - expected).length() <= 1e-4 * expected.length() + 1e-7, "{found} {expected}");
            }
        }
    }

    /// A photon that has met another facet squarely, and grazes the plane of this one, brings what its small cosine
    /// with the shading normal leaves. Over its cosine with this plane it would be hundreds of times what any photon
    /// should.
    #[test]
    fn photons_of_facets_nearby_bring_no_more_than_their_own_cosine_allows() {
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
