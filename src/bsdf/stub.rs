use super::*;
use crate::material::Material;
use crate::math::{Frame, Vec2, warp};
use std::f32::consts::FRAC_1_PI;
pub struct EnergyTables;
impl EnergyTables {
    pub fn for_materials(_: &[Material]) -> Self {
        EnergyTables
    }
}
#[derive(Clone, Copy, Debug)]
pub struct Parameters {
    pub base_color: Rgb,
}
impl Parameters {
    pub fn is_pure_transmission(&self) -> bool {
        false
    }
}
#[derive(Clone, Copy, Debug)]
pub struct Bsdf {
    c: Rgb,
}
impl Bsdf {
    pub fn new(p: &Parameters, _: &EnergyTables) -> Bsdf {
        Bsdf { c: p.base_color }
    }
    pub fn lobes(&self) -> LobeSet {
        LobeSet::BROAD
    }
}
pub struct Shading {
    pub frame: Frame,
    pub ng: Vec3,
    pub bsdf: Bsdf,
}
impl Shading {
    pub fn eval_cos(&self, wo: Vec3, wi: Vec3, _: Transport, _: LobeSet) -> Rgb {
        if wo.dot(self.ng) * wi.dot(self.ng) > 0.0 {
            self.bsdf.c * FRAC_1_PI * wi.dot(self.frame.n).abs()
        } else {
            Rgb::ZERO
        }
    }
    pub fn pdf(&self, wo: Vec3, wi: Vec3, _: Transport, _: LobeSet) -> f32 {
        if wo.dot(self.ng) * wi.dot(self.ng) > 0.0 { FRAC_1_PI * wi.dot(self.frame.n).abs() } else { 0.0 }
    }
    pub fn gather(&self, wo: Vec3, wi: Vec3, _: LobeSet) -> Rgb {
        if wo.dot(self.ng) * wi.dot(self.ng) > 0.0 { self.bsdf.c * FRAC_1_PI } else { Rgb::ZERO }
    }
    pub fn albedo(&self, _: Vec3, _: LobeSet) -> Rgb {
        self.bsdf.c
    }
    pub fn sample(&self, wo: Vec3, _: Transport, _: LobeSet, _: f32, u: Vec2) -> Option<BsdfSample> {
        let mut d = warp::hemisphere_cosine(u);
        if d.z <= 0.0 {
            return None;
        }
        let pdf = d.z * FRAC_1_PI;
        if wo.dot(self.ng) < 0.0 {
            d.z = -d.z
        }
        Some(BsdfSample {
            wi: self.frame.to_world(d),
            weight: self.bsdf.c,
            pdf_w: pdf,
            lobe: LobeSet::BROAD,
            transmitted: false,
        })
    }
}
impl Material {
    pub fn parameters(&self, _: &crate::geometry::Surface, _: &[crate::texture::Texture], _: f32) -> Parameters {
        Parameters { base_color: Vec3::new(self.base_color[0], self.base_color[1], self.base_color[2]) }
    }
    pub fn shading_frame(&self, s: &crate::geometry::Surface, _: &[crate::texture::Texture]) -> Frame {
        Frame::from_normal(s.ng)
    }
    pub fn alpha(&self, _: &crate::geometry::Surface, _: &[crate::texture::Texture]) -> f32 {
        1.0
    }
    pub fn emitted(&self, _: &crate::geometry::Surface, _: &[crate::texture::Texture]) -> Rgb {
        self.emission
    }
}
