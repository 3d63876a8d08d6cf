"""Corrections of Mitsuba's rough BSDFs to caustique's model, computed independently from the papers.

Both renderers use GGX with exact or Schlick's Fresnel terms and sample visible normals. They differ in three points:

- Masking-shadowing in reflection: Mitsuba multiplies G1(o) G1(i) [Walter et al. 2007, 23], caustique correlates heights
[Heitz 2014, 99].
- Multiple scattering between facets: Mitsuba loses this light, caustique adds the separable lobe of Kulla and Conty
  ["Revisiting Physically Based Shading at Imageworks", 2017], for glass on both sides.
- Rough matte: Mitsuba's roughplastic computes transmittances from facets that lose light; a white one in a white
furnace
  keeps 0.84 of the light at alpha 0.16 and 0.4 at 0.81. Only its reflecting facets are used here. The diffuse base is
  coupled as in Kelemen and Szirmay-Kalos [2001], (1 - E(o)) (1 - E(i)) / (pi (1 - E_avg)), which conserves energy.

Metals with a roughness texture are not corrected, because their tables would differ from point to point.

`corrected` wraps a BSDF of Mitsuba, multiplies it by the ratio of the masking terms and adds the lobe. If the renderers
agree only with it, these three points are the whole difference. This module computes the albedos by quadrature.
"""

import drjit as dr
import mitsuba as mi
import numpy as np

NODES = 128
#: Quadrature points along each axis of the visible-normal samples.
POINTS = 96
#: Probability of sampling the diffuse base of matte surfaces.
DIFFUSE_PROBABILITY = 0.6


def _lambda(alpha, z):
    """Smith's Lambda of isotropic GGX for the cosine z."""
    slope2 = alpha**2 * (1 / np.maximum(z * z, 1e-12) - 1)
    return 0.5 * (np.sqrt(1 + slope2) - 1)


def _visible_normals(alpha, mu):
    """Visible facet normals for the cosine mu [Dupuy and Benyoub 2023], their weights, and the direction."""
    u, rest = np.meshgrid(*[(np.arange(POINTS) + 0.5) / POINTS] * 2)
    # More points for steep facets, which are rare and lose most of their light.
    v, weights = 1 - rest**2, 2 * rest / POINTS**2
    o = np.array([np.sqrt(1 - mu * mu), 0.0, mu])
    stretched = o * [alpha, alpha, 1.0]
    stretched /= np.linalg.norm(stretched)
    z = (1 - v) * (1 + stretched[2]) - stretched[2]
    r = np.sqrt(np.maximum(1 - z * z, 0))
    cap = np.stack([r * np.cos(2 * np.pi * u), r * np.sin(2 * np.pi * u), z], axis=-1) + stretched
    h = cap * [alpha, alpha, 1.0]
    return h / np.linalg.norm(h, axis=-1, keepdims=True), weights, o


def _fresnel(cos, eta):
    """Fresnel reflectance for unpolarised light, and the refracted cosine."""
    sin2 = (1 - cos * cos) / eta**2
    total = sin2 >= 1
    cos_t = np.sqrt(np.maximum(1 - sin2, 0))
    s = (cos - eta * cos_t) / (cos + eta * cos_t)
    p = (eta * cos - cos_t) / (eta * cos + cos_t)
    return np.where(total, 1.0, 0.5 * (s * s + p * p)), cos_t


def _single_scattering(alpha, mu, eta=None):
    """Shares of light along mu that facets reflect and transmit in one bounce, for a perfect mirror or glass of index
    eta."""
    h, weights, o = _visible_normals(alpha, mu)
    cos = np.clip(h @ o, 0, 1)
    mirrored = 2 * cos[..., None] * h - o
    lambda_o = _lambda(alpha, mu)
    up = mirrored[..., 2] > 0
    reflected = np.where(up, (1 + lambda_o) / (1 + lambda_o + _lambda(alpha, mirrored[..., 2])), 0)
    if eta is None:
        return (weights * reflected).sum(), 0.0
    f, cos_t = _fresnel(cos, eta)
    refracted = (cos / eta - cos_t)[..., None] * h - o / eta
    down = refracted[..., 2] < 0
    transmitted = np.where(down, 1 / (1 + _lambda(alpha, refracted[..., 2])), 0)
    return (weights * f * reflected).sum(), (weights * (1 - f) * transmitted).sum()


class Profile:
    """A tabulated function of the cosine, with nodes equidistant in its square root."""

    def __init__(self, function):
        roots = np.linspace(0, 1, NODES)
        values = np.array([max(function(max(t * t, 1e-4)), 0.0) for t in roots])
        # Cosine-weighted average over the hemisphere: 2 mu dmu = 4 t^3 dt.
        weighted = values * 4 * roots**3
        self.average = float(((weighted[1:] + weighted[:-1]) / 2).sum() / (NODES - 1))
        self.values = mi.Float(values.astype(np.float32))
        self.roots = mi.ContinuousDistribution(mi.ScalarVector2f(0, 1), mi.Float((weighted + 1e-6).astype(np.float32)))

    def draw(self, sample):
        """Sample a direction of the upper hemisphere in proportion to profile times cosine."""
        mu = dr.square(self.roots.sample(sample.x))
        sine, (s, c) = dr.sqrt(dr.maximum(1 - mu * mu, 0)), dr.sincos(dr.two_pi * sample.y)
        return mi.Vector3f(sine * c, sine * s, mu)

    def pdf(self, mu):
        """Density per solid angle of `draw`: with mu = t^2, dmu = 2 t dt."""
        t = dr.sqrt(dr.clip(mu, 1e-6, 1))
        return self.roots.eval_pdf_normalized(t) / (4 * dr.pi * t)

    def at(self, mu):
        """The interpolated value at cosine mu."""
        x = dr.sqrt(dr.clip(mu, 0, 1)) * (NODES - 1)
        i = dr.minimum(mi.UInt32(x), NODES - 2)
        a, b = dr.gather(mi.Float, self.values, i), dr.gather(mi.Float, self.values, i + 1)
        return a + (b - a) * (x - mi.Float(i))


def _average_fresnel(eta):
    """Average reflectance of a smooth interface over the hemisphere."""
    mu = np.sqrt((np.arange(100000) + 0.5) / 100000)
    return _fresnel(mu, eta)[0].mean()


def _lost_energy(alpha, eta=None):
    """The share of light that single scattering loses, as a `Profile`."""
    return Profile(lambda mu: 1 - sum(_single_scattering(alpha, mu, eta)))


def _multiple_scattering(fresnel, kept):
    """Multiply scattered light for average reflectance `fresnel`, relative to the energy that a perfect mirror
    loses."""
    return fresnel * fresnel * kept / (1 - fresnel * (1 - kept))


class Corrected(mi.BSDF):
    """A rough BSDF of Mitsuba (`kind`: metal, glass, matte) with height-correlated masking and multiple scattering."""

    def __init__(self, properties):
        mi.BSDF.__init__(self, properties)
        self.kind, self.nested, self.base = properties["kind"], properties["nested"], properties.get_texture("base")
        self.alpha = properties["alpha"]
        ior = self.ior = properties.get("ior", 1.5)
        flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide
        if self.kind == "glass":
            flags = flags | mi.BSDFFlags.GlossyTransmission | mi.BSDFFlags.BackSide | mi.BSDFFlags.NonSymmetric
            self.losses = [_lost_energy(self.alpha, ior), _lost_energy(self.alpha, 1 / ior)]
            averages, index2 = [loss.average for loss in self.losses], [1.0, ior**2]
            # Reciprocity requires transmitted shares of k n^2 average, with n and average of the other side.
            transmitted = [1 - _average_fresnel(ior), 1 - _average_fresnel(1 / ior)]
            self.passed = float(min(transmitted[0] / index2[1], transmitted[1]) / max(averages))
            self.passes = [float(self.passed * index2[1 - s] * averages[1 - s]) for s in (0, 1)]
            self.returned = [(1 - self.passes[s]) / averages[s] for s in (0, 1)]
        else:
            self.loss = _lost_energy(self.alpha)
        if self.kind == "matte":
            # KHR_materials_specular's strength scales F0 and F90.
            strength = properties.get("strength", 1.0)
            again = self.again = float(_multiple_scattering(strength * _average_fresnel(ior), 1 - self.loss.average))
            self.through = Profile(
                lambda mu: (
                    1
                    - strength * _single_scattering(self.alpha, mu, ior)[0]
                    - again * (1 - _single_scattering(self.alpha, mu)[0])
                )
            )
        self.m_components = [flags]
        self.m_flags = flags

    def _ratio(self, wi, wo):
        """Ratio of correlated to separable masking."""

        def of(w):
            z2 = dr.maximum(w.z * w.z, 1e-12)
            return 0.5 * (dr.sqrt(1 + self.alpha**2 * (1 / z2 - 1)) - 1)

        a, b = of(wi), of(wo)
        return dr.select(wi.z * wo.z > 0, (1 + a) * (1 + b) / (1 + a + b), 1)

    def _multiple(self, si, wo, active):
        """The separable multiple-scattering lobes times the cosine."""
        base = self.base.eval(si, active)
        mu_i, mu_o = dr.abs(si.wi.z), dr.abs(wo.z)
        if self.kind != "glass":
            loss = self.loss
            lost = loss.at(mu_i) * loss.at(mu_o) / loss.average
            if self.kind == "metal":
                value = _multiple_scattering(base + (1 - base) / 21, 1 - loss.average) * lost
            else:
                through = self.through
                value = self.again * lost + base * (through.at(mu_i) * through.at(mu_o) / through.average)
            return dr.select((si.wi.z > 0) & (wo.z > 0), value * mu_o * dr.inv_pi, 0)
        above = si.wi.z > 0
        own_i = dr.select(above, self.losses[0].at(mu_i), self.losses[1].at(mu_i))
        own_o = dr.select(wo.z > 0, self.losses[0].at(mu_o), self.losses[1].at(mu_o))
        back = dr.select(above, self.returned[0], self.returned[1])
        # Radiance scales with the squared index of the viewer's side.
        through = base * (self.passed * dr.select(above, 1.0, self.ior**2))
        return dr.select(si.wi.z * wo.z > 0, mi.Color3f(back), through) * (own_i * own_o * mu_o * dr.inv_pi)

    def _separable_probability(self, wi):
        """Probability of sampling the separable lobes: about their share of the scattered light."""
        if self.kind == "matte":
            return DIFFUSE_PROBABILITY
        mu = dr.abs(wi.z)
        lost = (
            self.loss.at(mu)
            if self.kind == "metal"
            else dr.select(wi.z > 0, self.losses[0].at(mu), self.losses[1].at(mu))
        )
        return 0.01 + 0.98 * dr.clip(lost, 0, 1)

    def _separable_pdf(self, wi, wo):
        """Density per solid angle of a direction sampled from the separable lobes."""
        mu = dr.abs(wo.z)
        if self.kind == "glass":
            own = dr.select(wo.z > 0, self.losses[0].pdf(mu), self.losses[1].pdf(mu))
            passes = dr.select(wi.z > 0, self.passes[0], self.passes[1])
            return own * dr.select(wi.z * wo.z > 0, 1 - passes, passes)
        return dr.select(wo.z > 0, mu * dr.inv_pi if self.kind == "matte" else self.loss.pdf(mu), 0)

    def eval_pdf(self, ctx, si, wo, active=True):
        f, pdf = self.nested.eval_pdf(ctx, si, wo, active)
        f = f * self._ratio(si.wi, wo) + self._multiple(si, wo, active)
        if self.kind != "glass":
            active = active & (si.wi.z > 0)
        share = self._separable_probability(si.wi)
        pdf = (1 - share) * pdf + share * self._separable_pdf(si.wi, wo)
        return dr.select(active, f, 0), dr.select(active, pdf, 0)

    def eval(self, ctx, si, wo, active=True):
        return self.eval_pdf(ctx, si, wo, active)[0]

    def pdf(self, ctx, si, wo, active=True):
        return self.eval_pdf(ctx, si, wo, active)[1]

    def sample(self, ctx, si, sample1, sample2, active=True):
        share = self._separable_probability(si.wi)
        separable = sample1 < share
        nested, weight = self.nested.sample(ctx, si, (sample1 - share) / (1 - share), sample2, active & ~separable)
        if self.kind == "glass":
            passes = sample1 < share * dr.select(si.wi.z > 0, self.passes[0], self.passes[1])
            above = (si.wi.z > 0) ^ passes
            other = dr.select(above, self.losses[0].draw(sample2), self.losses[1].draw(sample2))
            other.z = dr.select(above, other.z, -other.z)
        elif self.kind == "metal":
            other = self.loss.draw(sample2)
        else:
            other = mi.warp.square_to_cosine_hemisphere(sample2)
        drawn = mi.BSDFSample3f()
        drawn.wo = dr.select(separable, other, nested.wo)
        value, drawn.pdf = self.eval_pdf(ctx, si, drawn.wo, active)
        # Facet samples may go to the wrong side; their density is not part of the sum.
        valid = active & (separable | (dr.max(weight) > 0)) & (drawn.pdf > 0)
        through = si.wi.z * drawn.wo.z < 0
        drawn.eta = 1.0
        if self.kind == "glass":
            drawn.eta = dr.select(through, dr.select(si.wi.z > 0, self.ior, 1 / self.ior), 1.0)
        drawn.sampled_type = dr.select(
            through, mi.UInt32(+mi.BSDFFlags.GlossyTransmission), mi.UInt32(+mi.BSDFFlags.GlossyReflection)
        )
        drawn.sampled_component = 0
        drawn.pdf = dr.select(valid, drawn.pdf, 0)
        return drawn, dr.select(valid, value / drawn.pdf, 0)

    def to_string(self):
        return f"Corrected[alpha={self.alpha}, nested={self.nested}]"


def register():
    """Register the BSDF type `corrected` for the current variant."""
    mi.register_bsdf("corrected", Corrected)
