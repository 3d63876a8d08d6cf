// The sums of equation (6) over windows, and their derivatives, for float and double. combination.py compiles and calls
// this file, and describes the quantities.
//
// Images are rows of `width` pixels. A plane is a pair of pictures of one image of a batch; each thread computes whole
// planes, so that no sum depends on the number of threads.

#include <algorithm>
#include <cmath>
#include <vector>

namespace {

// Largest exponent of an affinity, as in combination.py and src/combine/affinity.rs.
constexpr double MAX_DISTANCE = 60.0;

struct Shape {
    long planes, height, width, window, dilation;
    long area() const { return height * width; }
};

// exp(-x) for 0 <= x <= MAX_DISTANCE without branches, so that loops vectorise; relative error below 5e-7.
inline float exp_minus(float x) {
    const float t = -x * 1.44269504f, shifted = t + 12582912.0f, f = t - (shifted - 12582912.0f);
    float p = 1.540353e-4f;
    for (float c : {1.3333558e-3f, 9.6181291e-3f, 5.5504109e-2f, 2.4022651e-1f, 6.9314718e-1f, 1.0f}) p = p * f + c;
    int bits, shift;
    __builtin_memcpy(&bits, &p, 4);
    __builtin_memcpy(&shift, &shifted, 4);
    bits = (int)((unsigned)bits + ((unsigned)shift << 23));
    __builtin_memcpy(&p, &bits, 4);
    return p;
}
inline double exp_minus(double x) { return std::exp(-x); }

// Calls f(row, v, u, from, to) for all offsets (u, v) of the windows of row y, in steps of the dilation: the centre x has
// the neighbour at the index x + row of a picture for from <= x < to.
template <class F>
void each_offset(const Shape& s, long y, F f) {
    const long r = s.window / 2;
    for (long v = -r; v <= r; v++) {
        const long i_y = y + v * s.dilation;
        if (i_y < 0 || i_y >= s.height) continue;
        for (long u = -r; u <= r; u++) {
            const long dx = u * s.dilation;
            f(i_y * s.width + dx, v, u, std::max(0L, -dx), std::min(s.width, s.width - dx));
        }
    }
}

template <class T, int D>
void affinity_plane(const Shape& s, const T* phi, const T* weight, const T* falloff, const T* difference, T* total, T*
sums) {
    const long n = s.area();
    for (long y = 0; y < s.height; y++) {
        T *t = total + y * s.width, *a0 = sums + y * s.width, *a1 = a0 + n, *a2 = a1 + n;
        const T *centre = phi + y * s.width, *fall = falloff + y * s.width;
        each_offset(s, y, [&](long row, long v, long u, long from, long to) {
            const T *other = phi + row, *source = weight + row, *d0 = difference + row, *d1 = d0 + n, *d2 = d1 + n;
            const T length = T(u * u + v * v);
#pragma GCC ivdep
            for (long x = from; x < to; x++) {
                T distance = fall[x] * length;
                for (int k = 0; k < D; k++) {
                    const T step = centre[k * n + x] - other[k * n + x];
                    distance += step * step;
                }
                const T w = source[x] * exp_minus(std::min(distance, T(MAX_DISTANCE)));
                t[x] += w;
                a0[x] += w * d0[x];
                a1[x] += w * d1[x];
                a2[x] += w * d2[x];
            }
        });
    }
}

template <class T, int D>
void affinity_gradient(const Shape& s, const T* phi, const T* weight, const T* falloff, const T* difference,
                       const T* total_grad, const T* sums_grad, T* phi_grad, T* weight_grad, T* falloff_grad) {
    const long n = s.area();
    // Gradients of the row of centres, apart from those of their neighbours, which may be in the same row.
    std::vector<T> own((D + 1) * s.width);
    for (long y = 0; y < s.height; y++) {
        std::fill(own.begin(), own.end(), T(0));
        T *mine = own.data(), *fall_grad = mine + D * s.width;
        const T *centre = phi + y * s.width, *fall = falloff + y * s.width, *tg = total_grad + y * s.width;
        const T *g0 = sums_grad + y * s.width, *g1 = g0 + n, *g2 = g1 + n;
        each_offset(s, y, [&](long row, long v, long u, long from, long to) {
            const T *other = phi + row, *source = weight + row, *d0 = difference + row, *d1 = d0 + n, *d2 = d1 + n;
            T *other_grad = phi_grad + row, *source_grad = weight_grad + row;
            const T length = T(u * u + v * v);
#pragma GCC ivdep
            for (long x = from; x < to; x++) {
                T step[D], distance = fall[x] * length;
                for (int k = 0; k < D; k++) {
                    step[k] = centre[k * n + x] - other[k * n + x];
                    distance += step[k] * step[k];
                }
                const T a = exp_minus(std::min(distance, T(MAX_DISTANCE)));
                const T a_grad = a * (tg[x] + g0[x] * d0[x] + g1[x] * d1[x] + g2[x] * d2[x]);
                source_grad[x] += a_grad;
                // The derivative by minus the distance; zero where the distance is clamped.
                const T minus = distance > T(MAX_DISTANCE) ? T(0) : a_grad * source[x];
                fall_grad[x] -= minus * length;
                for (int k = 0; k < D; k++) {
                    const T change = 2 * minus * step[k];
                    mine[k * s.width + x] -= change;
                    other_grad[k * n + x] += change;
                }
            }
        });
        for (long x = 0; x < s.width; x++) {
            for (int k = 0; k < D; k++) phi_grad[k * n + y * s.width + x] += mine[k * s.width + x];
            falloff_grad[y * s.width + x] += fall_grad[x];
        }
    }
}

template <class T>
void kernel_plane(const Shape& s, const T* weights, const T* difference, T* total, T* sums) {
    const long n = s.area(), r = s.window / 2;
    for (long y = 0; y < s.height; y++) {
        T *t = total + y * s.width, *a0 = sums + y * s.width, *a1 = a0 + n, *a2 = a1 + n;
        each_offset(s, y, [&](long row, long v, long u, long from, long to) {
            const T* w = weights + ((v + r) * s.window + u + r) * n + y * s.width;
            const T *d0 = difference + row, *d1 = d0 + n, *d2 = d1 + n;
#pragma GCC ivdep
            for (long x = from; x < to; x++) {
                t[x] += w[x];
                a0[x] += w[x] * d0[x];
                a1[x] += w[x] * d1[x];
                a2[x] += w[x] * d2[x];
            }
        });
    }
}

template <class T>
void kernel_gradient(const Shape& s, const T* difference, const T* total_grad, const T* sums_grad, T* weights_grad) {
    const long n = s.area(), r = s.window / 2;
    for (long y = 0; y < s.height; y++) {
        const T *tg = total_grad + y * s.width, *g0 = sums_grad + y * s.width, *g1 = g0 + n, *g2 = g1 + n;
        each_offset(s, y, [&](long row, long v, long u, long from, long to) {
            T* w = weights_grad + ((v + r) * s.window + u + r) * n + y * s.width;
            const T *d0 = difference + row, *d1 = d0 + n, *d2 = d1 + n;
#pragma GCC ivdep
            for (long x = from; x < to; x++) w[x] = tg[x] + g0[x] * d0[x] + g1[x] * d1[x] + g2[x] * d2[x];
        });
    }
}

// Runs f<D>() for the number of dimensions of the feature space, 1 to 8.
template <class F>
void for_dimensions(long dimensions, F f) {
    switch (dimensions) {
        case 1: return f.template operator()<1>();
        case 2: return f.template operator()<2>();
        case 3: return f.template operator()<3>();
        case 4: return f.template operator()<4>();
        case 5: return f.template operator()<5>();
        case 6: return f.template operator()<6>();
        case 7: return f.template operator()<7>();
        default: return f.template operator()<8>();
    }
}

}  // namespace

// The shape is planes, dimensions, height, width, window, dilation, threads.
#define DEFINE(T, SUFFIX)                                                                                              \
    extern "C" void affinity_##SUFFIX(const long* shape, const T* phi, const T* weight, const T* falloff,              \
                                      const T* difference, T* total, T* sums) {                                        \
        const Shape s{shape[0], shape[2], shape[3], shape[4], shape[5]};                                                         \
        const long n = s.area(), d = shape[1];                                                                         \
        for_dimensions(d, [&]<int D>() {                                                                               \
            _Pragma("omp parallel for num_threads(shape[6])") for (long p = 0; p < s.planes; p++)                      \
                affinity_plane<T, D>(s, phi + p * d * n, weight + p * n, falloff + p * n, difference + 3 * p * n,      \
                                     total + p * n, sums + 3 * p * n);                                                 \
        });                                                                                                            \
    }                                                                                                                  \
    extern "C" void affinity_gradient_##SUFFIX(const long* shape, const T* phi, const T* weight, const T* falloff,     \
                                               const T* difference, const T* total_grad, const T* sums_grad,           \
                                               T* phi_grad, T* weight_grad, T* falloff_grad) {                         \
        const Shape s{shape[0], shape[2], shape[3], shape[4], shape[5]};                                                         \
        const long n = s.area(), d = shape[1];                                                                         \
        for_dimensions(d, [&]<int D>() {                                                                               \
            _Pragma("omp parallel for num_threads(shape[6])") for (long p = 0; p < s.planes; p++)                      \
                affinity_gradient<T, D>(s, phi + p * d * n, weight + p * n, falloff + p * n, difference + 3 * p * n,   \
                                        total_grad + p * n, sums_grad + 3 * p * n, phi_grad + p * d * n,               \
                                        weight_grad + p * n, falloff_grad + p * n);                                    \
        });                                                                                                            \
    }                                                                                                                  \
    extern "C" void kernel_##SUFFIX(const long* shape, const T* weights, const T* difference, T* total, T* sums) {     \
        const Shape s{shape[0], shape[2], shape[3], shape[4], shape[5]};                                                         \
        const long n = s.area();                                                                                       \
        _Pragma("omp parallel for num_threads(shape[6])") for (long p = 0; p < s.planes; p++)                          \
            kernel_plane<T>(s, weights + p * s.window * s.window * n, difference + 3 * p * n, total + p * n,           \
                            sums + 3 * p * n);                                                                         \
    }                                                                                                                  \
    extern "C" void kernel_gradient_##SUFFIX(const long* shape, const T* difference, const T* total_grad,              \
                                             const T* sums_grad, T* weights_grad) {                                    \
        const Shape s{shape[0], shape[2], shape[3], shape[4], shape[5]};                                                         \
        const long n = s.area();                                                                                       \
        _Pragma("omp parallel for num_threads(shape[6])") for (long p = 0; p < s.planes; p++)                          \
            kernel_gradient<T>(s, difference + 3 * p * n, total_grad + p * n, sums_grad + 3 * p * n,                   \
                               weights_grad + p * s.window * s.window * n);                                            \
    }

DEFINE(float, f32)
DEFINE(double, f64)
