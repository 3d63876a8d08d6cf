//! Light sources (emissive triangles, points, spots, suns and the environment), and their sampling.

mod aim;
mod bounds;
mod bulb;
mod cdf;
mod cone;
mod distribution;
mod emission;
mod environment;
mod group;
pub mod guide;
mod irradiance;
mod kind;
mod learnt;
mod learnt_lights;
mod learnt_sky;
mod learnt_table;
mod lights;
mod links;
mod picture;
mod profile;
mod receiver;
mod region;
mod sampler;
mod sky;
mod spot;
mod spread;
mod tree;

pub use aim::CausticTargets;
pub use bulb::Bulb;
pub use cdf::Cdf;
pub use cone::Cone;
pub use distribution::{Distribution, Pattern, SpotCone};
pub use emission::{DirectSample, EmissionDensity, EmissionDraws, EmissionSample, EntryDisc};
pub use environment::{Environment, ImageEnvironment};
pub use group::{Group, Groups, MAX_GROUP_NAME, MAX_GROUPS};
pub use guide::Guide;
pub use kind::{
    Emitter, EnvironmentLight, Light, LightPlacement, Owner, PointLight, PunctualKind, ShapedLight, SpotLight,
    SunLight, TriangleLight, VolumeLight,
};
pub use learnt::LearntLight;
pub use learnt_lights::{LearntLights, LightBins};
pub use learnt_sky::{LearntSky, SkySectors};
pub use learnt_table::{LightSamples, LitSample};
pub use lights::Lights;
pub use links::{LightLinks, LinkedObjects, Linking, MAX_LINKINGS};
pub use picture::Picture;
pub use profile::Profile;
pub use receiver::Receiver;
pub use region::Region;
pub use sky::Sky;
pub use spot::SpotEdge;
pub use spread::Spread;
