//! Albedos of anisotropic rough interfaces. They depend on the azimuth as much as on the cosine, so isotropic profiles
//! are too inaccurate.

use super::profile::{NODES, Position, Profile, node};
use crate::math::{Vec2, Vec3, Vec4, atan2_turns, sin_cos_turns};
use std::array::from_fn;
use std::f32::consts::FRAC_PI_2;
use std::sync::OnceLock;

/// Number of nodes of the azimuth in a quarter of the circle. The other quarters are mirror images.
const AZIMUTHS: usize = 13;

/// Table of two sets of four functions of the direction, at one pair of alphas: by node of the azimuth and node of the
/// cosine.
pub(super) type Row = [[[Vec4; 2]; NODES]; AZIMUTHS];

/// Tables of functions of the direction for every pair of nodes of alpha (along x and along y), computed at first use.
#[derive(Clone, Debug, Default)]
pub(super) struct AnisotropicTables(OnceLock<Box<[OnceLock<Box<Row>>]>>);

impl AnisotropicTables {
    /// The function of direction `max(constant + factors . functions, 0)`, with the four tabulated functions of set
    /// `n`, at the alphas along x and y. `make` computes both sets from the alpha along x, a smaller one along y, and a
    /// direction.
    pub fn profile(
        &self,
        [along_x, along_y]: [Position; 2],
        n: usize,
        constant: f32,
        factors: Vec4,
        make: impl Fn(f32, f32, Vec3) -> [Vec4; 2],
    ) -> AnisotropicProfile {
        let pairs = self.0.get_or_init(|| (0..NODES * NODES).map(|_| OnceLock::new()).collect());
        let row = |wide: usize, narrow: usize| {
            pairs[wide * NODES + narrow].get_or_init(|| {
                let at = |azimuth: usize, mu: f32| {
                    let (sin, cos) = (azimuth as f32 * FRAC_PI_2 / (AZIMUTHS - 1) as f32).sin_cos();
                    let r = (1.0 - mu * mu).max(0.0).sqrt();
                    make(node(wide), node(narrow), Vec3::new(r * cos, r * sin, mu))
                };
                Box::new(from_fn(|azimuth| from_fn(|j| at(azimuth, node(j)))))
            })
        };
        let swapped = along_y.value() > along_x.value();
        let (wide, narrow) = if swapped { (along_y, along_x) } else { (along_x, along_y) };
        let mut nodes = [[constant; NODES]; AZIMUTHS];
        for (i, wide_share) in wide.adjacent_nodes() {
            for (k, narrow_share) in narrow.adjacent_nodes() {
                let (row, factors) = (row(i, k), factors * (wide_share * narrow_share));
                for (sums, values) in nodes.iter_mut().zip(row.iter()) {
                    sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += factors.dot(value[n]));
                }
            }
        }
        AnisotropicProfile { azimuths: nodes.map(|nodes| Profile::from_nodes(nodes.map(|x| x.max(0.0)))), swapped }
    }
}

/// A function of the direction that is symmetric about x and y: one profile per azimuth, with linear interpolation.
#[derive(Clone, Copy, Debug)]
pub(super) struct AnisotropicProfile {
    azimuths: [Profile; AZIMUTHS],
    /// Whether the larger alpha is along y, so that x and y of directions are exchanged.
    swapped: bool,
}

/// Functions of the direction, of one kind or for both sides of an interface. They are large, so they are stored outside
/// of the interface.
#[derive(Debug)]
pub(super) enum Profiles<'a> {
    /// Functions of an interface that is shared by all surfaces of a material.
    Owned(Box<[AnisotropicProfile]>),
    /// Functions of the interface at one path vertex, in the arena of the path.
    InArena(&'a [AnisotropicProfile]),
}

impl std::ops::Deref for Profiles<'_> {
    type Target = [AnisotropicProfile];
    #[inline]
    fn deref(&self) -> &[AnisotropicProfile] {
        match self {
            Profiles::Owned(profiles) => profiles,
            Profiles::InArena(profiles) => profiles,
        }
    }
}

/// Share of a quarter circle that belongs to node `k` of the azimuth, 0 to 1.
fn share(k: usize) -> f32 {
    if k == 0 || k == AZIMUTHS - 1 { 0.5 / LAST } else { 1.0 / LAST }
}

/// Index of the last node of the azimuth, at a quarter of the circle.
const LAST: f32 = (AZIMUTHS - 1) as f32;

impl AnisotropicProfile {
    /// Position of the azimuth of `w` among the nodes: the index of the node below, and the fraction of the distance to
    /// the next.
    #[inline]
    fn azimuth_position(&self, w: Vec3) -> (usize, f32) {
        let (x, y) = (w.x.abs(), w.y.abs());
        let azimuth = if self.swapped { atan2_turns(x, y) } else { atan2_turns(y, x) } * (4.0 * LAST);
        let k = (azimuth as usize).min(AZIMUTHS - 2);
        (k, azimuth - k as f32)
    }

    /// Value of the function at the direction `w`; `mu` is the table position of its cosine with the normal.
    #[inline]
    pub fn at(&self, mu: Position, w: Vec3) -> f32 {
        let (k, t) = self.azimuth_position(w);
        let [low, high] = [k, k + 1].map(|k| self.azimuths[k].at(mu));
        low + (high - low) * t
    }

    /// Density per solid angle with which [`AnisotropicProfile::sample`] draws `w`.
    #[inline]
    pub fn pdf_w(&self, mu: Position, w: Vec3) -> f32 {
        let (k, t) = self.azimuth_position(w);
        let [low, high] = [k, k + 1].map(|k| self.azimuths[k].at_with_pdf_w(mu, w.z.abs()).1 * self.azimuths[k].mass());
        (low + (high - low) * t) / self.mass().max(f32::MIN_POSITIVE)
    }

    fn mass(&self) -> f32 {
        (0..AZIMUTHS).map(|k| share(k) * self.azimuths[k].mass()).sum()
    }

    /// Samples a direction of the upper hemisphere, see [`Profile::sample`]. `None` if the function is zero.
    pub fn sample(&self, u: Vec2) -> Option<Vec3> {
        let mut left = u.x * self.mass();
        let mut chosen = 0;
        while chosen < AZIMUTHS - 1 && left >= share(chosen) * self.azimuths[chosen].mass() {
            left -= share(chosen) * self.azimuths[chosen].mass();
            chosen += 1;
        }
        let profile = &self.azimuths[chosen];
        let rest = left / (share(chosen) * profile.mass());
        let mu = profile.sample(Vec2::new(rest, 0.0))?.z;
        // One of the four mirror images, and an azimuth from the triangular weight of the node.
        let quarter = (4.0 * u.y) as u32;
        let v = 2.0 * (4.0 * u.y - quarter as f32) - 1.0;
        let hat = v.signum() * (1.0 - (1.0 - v.abs()).max(0.0).sqrt());
        let (sin, cos) = sin_cos_turns((chosen as f32 + hat) * (0.25 / LAST));
        let r = (1.0 - mu * mu).max(0.0).sqrt();
        let (x, y) = if self.swapped { (sin, cos) } else { (cos, sin) };
        let sign = |bit: u32| if quarter & bit == 0 { r } else { -r };
        Some(Vec3::new(x * sign(1), y * sign(2), mu))
    }

    /// The mean of the function over the azimuth, as a function of the cosine.
    pub fn mean(&self) -> Profile {
        Profile::from_nodes(from_fn(|j| (0..AZIMUTHS).map(|k| share(k) * self.azimuths[k].nodes()[j]).sum()))
    }
}
