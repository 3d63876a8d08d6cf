"""What Mitsuba's rough BSDFs lack of caustique's, computed here from the papers.

Both use GGX with exact or Schlick's Fresnel terms and draw visible normals. Two things differ:

- Masking on one side: Mitsuba multiplies G1(o) G1(i) [Walter et al. 2007, 23], caustique correlates heights [Heitz 2014, 99].
- Light that facets scatter more than once: Mitsuba drops it, caustique gives it back by the separable lobe of Kulla and Conty
  ["Revisiting Physically Based Shading at Imageworks", 2017], for glass on both sides.

`corrected` wraps one of Mitsuba's BSDFs, multiplies by the ratio of the maskings and adds the lobe. If the two renderers agree with
it and not without, these two are all the difference. The albedos come from a quadrature of this module's own.
"""

import drjit as dr
import mitsuba as mi
import numpy as np

NODES = 128
#: Points of the quadrature along each axis of the square of visible normals.
POINTS = 96
#: Share of directions drawn for the separable lobe.
SHARE = 0.15


def _lambda(alpha, z):
    """Smith's Lambda of an isotropic GGX for the cosine z."""
    slope2 = alpha**2 * (1 / np.maximum(z * z, 1e-12) - 1)
    return 0.5 * (np.sqrt(1 + slope2) - 1)


def _visible_normals(alpha, mu):
    """Facet normals seen along the cosine mu, equally likely [Dupuy and Benyoub 2023]; and the direction."""
    u, v = np.meshgrid(*[(np.arange(POINTS) + 0.5) / POINTS] * 2)
    o = np.array([np.sqrt(1 - mu * mu), 0.0, mu])
    stretched = o * [alpha, alpha, 1.0]
    stretched /= np.linalg.norm(stretched)
    # Denser where a cap ends: grazing facets matter most.
    z = (1 - v) * (1 + stretched[2]) - stretched[2]
    r = np.sqrt(np.maximum(1 - z * z, 0))
    cap = np.stack([r * np.cos(2 * np.pi * u), r * np.sin(2 * np.pi * u), z], axis=-1) + stretched
    h = cap * [alpha, alpha, 1.0]
    return h / np.linalg.norm(h, axis=-1, keepdims=True), o


def _fresnel(cos, eta):
    """Fresnel's equations for unpolarised light; and the refracted cosine."""
    sin2 = (1 - cos * cos) / eta**2
    total = sin2 >= 1
    cos_t = np.sqrt(np.maximum(1 - sin2, 0))
    s = (cos - eta * cos_t) / (cos + eta * cos_t)
    p = (eta * cos - cos_t) / (eta * cos + cos_t)
    return np.where(total, 1.0, 0.5 * (s * s + p * p)), cos_t


def _scattered(alpha, mu, eta=None):
    """Share of light along mu that facets scatter once: of a perfect reflector, or of glass of the relative index eta."""
    h, o = _visible_normals(alpha, mu)
    cos = np.clip(h @ o, 0, 1)
    mirrored = 2 * cos[..., None] * h - o
    lambda_o = _lambda(alpha, mu)
    up = mirrored[..., 2] > 0
    reflected = np.where(up, (1 + lambda_o) / (1 + lambda_o + _lambda(alpha, mirrored[..., 2])), 0)
    if eta is None:
        return reflected.mean()
    f, cos_t = _fresnel(cos, eta)
    refracted = (cos / eta - cos_t)[..., None] * h - o / eta
    down = refracted[..., 2] < 0
    transmitted = np.where(down, 1 / (1 + _lambda(alpha, refracted[..., 2])), 0)
    return (f * reflected + (1 - f) * transmitted).mean()


class Loss:
    """What facets lose, by cosine; nodes are even in its square root."""

    def __init__(self, alpha, eta=None):
        roots = np.linspace(0, 1, NODES)
        values = np.array([max(1 - _scattered(alpha, max(t * t, 1e-4), eta), 0) for t in roots])
        # The average over the hemisphere: 2 mu dmu = 4 t^3 dt.
        weighted = values * 4 * roots**3
        self.average = float(((weighted[1:] + weighted[:-1]) / 2).sum() / (NODES - 1))
        self.values = mi.Float(values.astype(np.float32))

    def at(self, mu):
        """Interpolated."""
        x = dr.sqrt(dr.clip(mu, 0, 1)) * (NODES - 1)
        i = dr.minimum(mi.UInt32(x), NODES - 2)
        a, b = dr.gather(mi.Float, self.values, i), dr.gather(mi.Float, self.values, i + 1)
        return a + (b - a) * (x - mi.Float(i))


def _average_fresnel(eta):
    """Average reflectance of a smooth interface over the hemisphere."""
    mu = np.sqrt((np.arange(100000) + 0.5) / 100000)
    return _fresnel(mu, eta)[0].mean()


class Corrected(mi.BSDF):
    """A rough metal or glass of Mitsuba's with height-correlated masking and multiple scattering."""

    def __init__(self, properties):
        mi.BSDF.__init__(self, properties)
        self.nested, self.base = properties["nested"], properties.get_texture("base")
        self.alpha = properties["alpha"]
        self.ior = properties.get("ior", 0.0)
        flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide
        if self.ior:
            flags = flags | mi.BSDFFlags.GlossyTransmission | mi.BSDFFlags.BackSide | mi.BSDFFlags.NonSymmetric
            self.losses = [Loss(self.alpha, self.ior), Loss(self.alpha, 1 / self.ior)]
            averages = [loss.average for loss in self.losses]
            index2 = [1.0, self.ior**2]
            # Reciprocity asks for shares that pass of k n^2 average, n and average those of the other side.
            transmitted = [1 - _average_fresnel(self.ior), 1 - _average_fresnel(1 / self.ior)]
            self.passed = min(transmitted[0] / index2[1], transmitted[1]) / max(averages)
            self.returned = [(1 - self.passed * index2[1 - s] * averages[1 - s]) / averages[s] for s in (0, 1)]
        else:
            self.losses = [Loss(self.alpha)]
        self.m_components = [flags]
        self.m_flags = flags

    def _ratio(self, wi, wo):
        """Correlated over separable masking."""
        def of(w):
            z2 = dr.maximum(w.z * w.z, 1e-12)
            return 0.5 * (dr.sqrt(1 + self.alpha**2 * (1 / z2 - 1)) - 1)
        a, b = of(wi), of(wo)
        return dr.select(wi.z * wo.z > 0, (1 + a) * (1 + b) / (1 + a + b), 1)

    def _multiple(self, si, wo, active):
        """The separable lobe times the cosine."""
        base = self.base.eval(si, active)
        mu_i, mu_o = dr.abs(si.wi.z), dr.abs(wo.z)
        if not self.ior:
            loss = self.losses[0]
            fresnel, kept = base + (1 - base) / 21, 1 - loss.average
            color = fresnel * fresnel * kept / (1 - fresnel * (1 - kept))
            value = color * (loss.at(mu_i) * loss.at(mu_o) / loss.average)
            return dr.select((si.wi.z > 0) & (wo.z > 0), value * mu_o * dr.inv_pi, 0)
        above = si.wi.z > 0
        own_i = dr.select(above, self.losses[0].at(mu_i), self.losses[1].at(mu_i))
        own_o = dr.select(wo.z > 0, self.losses[0].at(mu_o), self.losses[1].at(mu_o))
        back = dr.select(above, self.returned[0], self.returned[1])
        # Radiance: times the squared index on the side it is seen from.
        through = base * (self.passed * dr.select(above, 1.0, self.ior**2))
        return dr.select(si.wi.z * wo.z > 0, mi.Color3f(back), through) * (own_i * own_o * mu_o * dr.inv_pi)

    def eval_pdf(self, ctx, si, wo, active=True):
        f, pdf = self.nested.eval_pdf(ctx, si, wo, active)
        f = f * self._ratio(si.wi, wo) + self._multiple(si, wo, active)
        cosine = dr.abs(wo.z) * dr.inv_pi * (0.5 if self.ior else 1.0)
        if not self.ior:
            cosine = dr.select(wo.z > 0, cosine, 0)
            active = active & (si.wi.z > 0)
        pdf = (1 - SHARE) * pdf + SHARE * cosine
        return dr.select(active, f, 0), dr.select(active, pdf, 0)

    def eval(self, ctx, si, wo, active=True):
        return self.eval_pdf(ctx, si, wo, active)[0]

    def pdf(self, ctx, si, wo, active=True):
        return self.eval_pdf(ctx, si, wo, active)[1]

    def sample(self, ctx, si, sample1, sample2, active=True):
        separable = sample1 < SHARE
        nested, _ = self.nested.sample(ctx, si, (sample1 - SHARE) / (1 - SHARE), sample2, active & ~separable)
        cosine = mi.warp.square_to_cosine_hemisphere(sample2)
        if self.ior:
            cosine.z = dr.select(sample1 < 0.5 * SHARE, -cosine.z, cosine.z)
        drawn = mi.BSDFSample3f()
        drawn.wo = dr.select(separable, cosine, nested.wo)
        value, drawn.pdf = self.eval_pdf(ctx, si, drawn.wo, active)
        valid = active & (separable | (nested.pdf > 0)) & (drawn.pdf > 0)
        through = si.wi.z * drawn.wo.z < 0
        drawn.eta = 1.0
        if self.ior:
            drawn.eta = dr.select(through, dr.select(si.wi.z > 0, self.ior, 1 / self.ior), 1.0)
        drawn.sampled_type = dr.select(through, mi.UInt32(+mi.BSDFFlags.GlossyTransmission),
                                       mi.UInt32(+mi.BSDFFlags.GlossyReflection))
        drawn.sampled_component = 0
        drawn.pdf = dr.select(valid, drawn.pdf, 0)
        return drawn, dr.select(valid, value / drawn.pdf, 0)

    def to_string(self):
        return f"Corrected[alpha={self.alpha}, nested={self.nested}]"


def register():
    """Makes the type `corrected` known, for the variant that is set."""
    mi.register_bsdf("corrected", Corrected)
