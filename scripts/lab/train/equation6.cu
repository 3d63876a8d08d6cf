// The functions of equation6.cpp on a GPU. The last number of the shape is the stream instead of the threads.
//
// A thread computes one pixel of one plane. Windows are symmetric: the neighbours of a pixel are also the centres of the
// windows that contain it, so each thread adds up its own derivatives, without atomics.

namespace {

constexpr double MAX_DISTANCE = 60.0;

struct Shape {
    long planes, height, width, window, dilation;
    __device__ long area() const { return height * width; }
};

__device__ inline float exp_minus(float x) { return expf(-x); }
__device__ inline double exp_minus(double x) { return exp(-x); }

// Calls f(v, u, neighbour) for all neighbours of pixel p inside the picture.
template <class F>
__device__ void each_neighbour(const Shape& s, long p, F f) {
    const long r = s.window / 2, y = p / s.width, x = p % s.width;
    for (long v = -r; v <= r; v++) {
        const long i_y = y + v * s.dilation;
        if (i_y < 0 || i_y >= s.height) continue;
        for (long u = -r; u <= r; u++) {
            const long i_x = x + u * s.dilation;
            if (i_x >= 0 && i_x < s.width) f(v, u, i_y * s.width + i_x);
        }
    }
}

template <class T, int D>
__global__ void affinity_pixels(Shape s, const T* phi, const T* weight, const T* falloff, const T* difference, T* total,
                                T* sums) {
    const long n = s.area(), id = blockIdx.x * (long)blockDim.x + threadIdx.x;
    if (id >= s.planes * n) return;
    const long plane = id / n, p = id % n;
    phi += plane * D * n, weight += plane * n, difference += plane * 3 * n;
    T own[D], t = 0, a[3] = {0, 0, 0};
    for (int k = 0; k < D; k++) own[k] = phi[k * n + p];
    const T fall = falloff[id];
    each_neighbour(s, p, [&](long v, long u, long i) {
        T distance = fall * T(u * u + v * v);
        for (int k = 0; k < D; k++) {
            const T step = own[k] - phi[k * n + i];
            distance += step * step;
        }
        const T w = weight[i] * exp_minus(distance < T(MAX_DISTANCE) ? distance : T(MAX_DISTANCE));
        t += w;
        for (int c = 0; c < 3; c++) a[c] += w * difference[c * n + i];
    });
    total[id] = t;
    for (int c = 0; c < 3; c++) sums[(plane * 3 + c) * n + p] = a[c];
}

template <class T, int D>
__global__ void affinity_gradient_pixels(Shape s, const T* phi, const T* weight, const T* falloff, const T* difference,
                                         const T* total_grad, const T* sums_grad, T* phi_grad, T* weight_grad,
                                         T* falloff_grad) {
    const long n = s.area(), id = blockIdx.x * (long)blockDim.x + threadIdx.x;
    if (id >= s.planes * n) return;
    const long plane = id / n, p = id % n;
    phi += plane * D * n, weight += plane * n, falloff += plane * n, difference += plane * 3 * n;
    total_grad += plane * n, sums_grad += plane * 3 * n;
    T own[D], own_grad[D] = {}, source_grad = 0, fall_grad = 0;
    for (int k = 0; k < D; k++) own[k] = phi[k * n + p];
    each_neighbour(s, p, [&](long v, long u, long i) {
        const T length = T(u * u + v * v);
        T step[D], feature_distance = 0;
        for (int k = 0; k < D; k++) {
            step[k] = own[k] - phi[k * n + i];
            feature_distance += step[k] * step[k];
        }
        // The pixel as the centre of a window, the neighbour as a source; minus is the derivative by minus the
        // distance, zero where the distance is clamped.
        T distance = falloff[p] * length + feature_distance;
        T a_grad = total_grad[p];
        for (int c = 0; c < 3; c++) a_grad += sums_grad[c * n + p] * difference[c * n + i];
        const bool near = distance <= T(MAX_DISTANCE);
        const T minus = near ? a_grad * exp_minus(distance) * weight[i] : T(0);
        fall_grad -= minus * length;
        // The neighbour as the centre, the pixel as a source.
        distance = falloff[i] * length + feature_distance;
        a_grad = total_grad[i];
        for (int c = 0; c < 3; c++) a_grad += sums_grad[c * n + i] * difference[c * n + p];
        a_grad *= exp_minus(distance < T(MAX_DISTANCE) ? distance : T(MAX_DISTANCE));
        source_grad += a_grad;
        const T other_minus = distance <= T(MAX_DISTANCE) ? a_grad * weight[p] : T(0);
        for (int k = 0; k < D; k++) own_grad[k] -= 2 * (minus + other_minus) * step[k];
    });
    for (int k = 0; k < D; k++) phi_grad[(plane * D + k) * n + p] = own_grad[k];
    weight_grad[id] = source_grad;
    falloff_grad[id] = fall_grad;
}

template <class T>
__global__ void kernel_pixels(Shape s, const T* weights, const T* difference, T* total, T* sums) {
    const long n = s.area(), id = blockIdx.x * (long)blockDim.x + threadIdx.x;
    if (id >= s.planes * n) return;
    const long plane = id / n, p = id % n, r = s.window / 2;
    weights += plane * s.window * s.window * n, difference += plane * 3 * n;
    T t = 0, a[3] = {0, 0, 0};
    each_neighbour(s, p, [&](long v, long u, long i) {
        const T w = weights[((v + r) * s.window + u + r) * n + p];
        t += w;
        for (int c = 0; c < 3; c++) a[c] += w * difference[c * n + i];
    });
    total[id] = t;
    for (int c = 0; c < 3; c++) sums[(plane * 3 + c) * n + p] = a[c];
}

template <class T>
__global__ void kernel_gradient_pixels(Shape s, const T* difference, const T* total_grad, const T* sums_grad,
                                       T* weights_grad) {
    const long n = s.area(), id = blockIdx.x * (long)blockDim.x + threadIdx.x;
    if (id >= s.planes * n) return;
    const long plane = id / n, p = id % n, r = s.window / 2;
    weights_grad += plane * s.window * s.window * n, difference += plane * 3 * n, sums_grad += plane * 3 * n;
    const T t = total_grad[id], g[3] = {sums_grad[p], sums_grad[n + p], sums_grad[2 * n + p]};
    each_neighbour(s, p, [&](long v, long u, long i) {
        T grad = t;
        for (int c = 0; c < 3; c++) grad += g[c] * difference[c * n + i];
        weights_grad[((v + r) * s.window + u + r) * n + p] = grad;
    });
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

constexpr int BLOCK = 128;

struct Launch {
    Shape shape;
    unsigned blocks;
    cudaStream_t stream;
    explicit Launch(const long* s)
        : shape{s[0], s[2], s[3], s[4], s[5]},
          blocks(unsigned((s[0] * s[2] * s[3] + BLOCK - 1) / BLOCK)),
          stream(reinterpret_cast<cudaStream_t>(s[6])) {}
};

}  // namespace

// The shape is planes, dimensions, height, width, window, dilation, stream.
#define DEFINE(T, SUFFIX)                                                                                              \
    extern "C" void affinity_##SUFFIX(const long* shape, const T* phi, const T* weight, const T* falloff,              \
                                      const T* difference, T* total, T* sums) {                                        \
        const Launch l(shape);                                                                                         \
        for_dimensions(shape[1], [&]<int D>() {                                                                        \
            affinity_pixels<T, D><<<l.blocks, BLOCK, 0, l.stream>>>(l.shape, phi, weight, falloff, difference, total,  \
                                                                    sums);                                             \
        });                                                                                                            \
    }                                                                                                                  \
    extern "C" void affinity_gradient_##SUFFIX(const long* shape, const T* phi, const T* weight, const T* falloff,     \
                                               const T* difference, const T* total_grad, const T* sums_grad,           \
                                               T* phi_grad, T* weight_grad, T* falloff_grad) {                         \
        const Launch l(shape);                                                                                         \
        for_dimensions(shape[1], [&]<int D>() {                                                                        \
            affinity_gradient_pixels<T, D><<<l.blocks, BLOCK, 0, l.stream>>>(                                          \
                l.shape, phi, weight, falloff, difference, total_grad, sums_grad, phi_grad, weight_grad,               \
                falloff_grad);                                                                                         \
        });                                                                                                            \
    }                                                                                                                  \
    extern "C" void kernel_##SUFFIX(const long* shape, const T* weights, const T* difference, T* total, T* sums) {     \
        const Launch l(shape);                                                                                         \
        kernel_pixels<T><<<l.blocks, BLOCK, 0, l.stream>>>(l.shape, weights, difference, total, sums);                 \
    }                                                                                                                  \
    extern "C" void kernel_gradient_##SUFFIX(const long* shape, const T* difference, const T* total_grad,              \
                                             const T* sums_grad, T* weights_grad) {                                    \
        const Launch l(shape);                                                                                         \
        kernel_gradient_pixels<T><<<l.blocks, BLOCK, 0, l.stream>>>(l.shape, difference, total_grad, sums_grad,        \
                                                                    weights_grad);                                     \
    }

DEFINE(float, f32)
DEFINE(double, f64)
